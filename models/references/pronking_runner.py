"""The pronking runner of Sec. V-C by Taylor series: forces and torques on a body with two spring legs.

m = I = l = d = 1, k = 30, g = 9.81, psi = pi/5. Side +1 is the left leg, whose hip is half a length along the body,
side -1 the right one. A swinging leg points at the angle psi to the body; one in stance pushes from its pinned foot
along itself.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from hsdsl.engine.execution import Execution
from references.by_series import by_series
from references.interpolation import mp, number
from references.series import Series, States, sin_cos, sqrt
from references.taylor import Edge, Mode

GRAVITY, STIFFNESS, ANGLE = mp.mpf("9.81"), 30, mp.pi / 5
SIDES = {"left": 1, "right": -1}
FEET = {"left": "pl", "right": "pr"}
BODY = ("x", "z", "th", "vx", "vz", "w")


def pronking_runner(w: Any = 0) -> Execution:
    """The runner's stride from (x, z, th, vx, vz) = (0, 1.1, 0, 3.4, 0) to the apex, solved to forty digits or more.

    Parameters
    ----------
    w : int, float or str
        How fast it turns at the start; text is taken as decimals, exactly. With 0 both legs touch down together.

    Returns
    -------
    Execution
        In the model's modes, with six states and a foot's position for each leg in stance; ``settings["error"]`` is its
        error at any time.

    Raises UsageError: ``w`` is no number.
    """
    start = [0, mp.mpf("1.1"), 0, mp.mpf("3.4"), 0, number(w, "w")]
    return by_series("pronking-runner", "Pronking runner", MODES, "aerial", start, 2, "0.02")


def _hip(x: States, leg: str) -> tuple[Series, Series]:
    sine, cosine = sin_cos(x["th"])
    half = mp.mpf(SIDES[leg]) / 2
    return x["x"] + cosine * half, x["z"] + sine * half


def _touches(leg: str) -> Callable[[States], Series]:
    """Depth of a swinging foot below ground."""

    def depth(x: States) -> Series:
        _, cosine = sin_cos(x["th"] + ANGLE)
        return cosine - _hip(x, leg)[1]

    return depth


def _pinned(leg: str) -> Callable[[States], Mapping[str, Series]]:
    """The foot's place, where it is when it touches down."""

    def foot(x: States) -> Mapping[str, Series]:
        sine, _ = sin_cos(x["th"] + ANGLE)
        return {FEET[leg]: _hip(x, leg)[0] + sine}

    return foot


def _leg(x: States, leg: str) -> tuple[Series, Series, Series]:
    """From foot to hip, and the length of that."""
    hip_x, hip_z = _hip(x, leg)
    along = hip_x - x[FEET[leg]]
    return along, hip_z, sqrt(along * along + hip_z * hip_z)


def _stretched(leg: str) -> Callable[[States], Series]:
    """How much longer than at rest a leg is."""
    return lambda x: _leg(x, leg)[2] - 1


def _flow(*legs: str) -> Callable[[States], Mapping[str, Any]]:
    """Forces and torques of the legs in stance, and gravity."""

    def flow(x: States) -> Mapping[str, Any]:
        sine, cosine = sin_cos(x["th"])
        push_x: Any = 0
        push_z: Any = -GRAVITY
        torque: Any = 0
        for leg in legs:
            along, up, length = _leg(x, leg)
            push = (1 - length) * STIFFNESS / length
            push_x, push_z = push * along + push_x, push * up + push_z
            torque = (cosine * push * up - sine * push * along) * (mp.mpf(SIDES[leg]) / 2) + torque
        still = {FEET[leg]: 0 for leg in legs}
        return {"x": x["vx"], "z": x["vz"], "th": x["w"], "vx": push_x, "vz": push_z, "w": torque, **still}

    return flow


def _down(source: str, target: str, leg: str) -> Edge:
    return Edge(f"{source}->{target}", target, _touches(leg), _pinned(leg))


def _off(source: str, target: str, leg: str) -> Edge:
    return Edge(f"{source}->{target}", target, _stretched(leg))


MODES = {
    "aerial": Mode(BODY, _flow(), (_down("aerial", "left", "left"), _down("aerial", "right", "right"))),
    "left": Mode((*BODY, "pl"), _flow("left"), (_down("left", "ground", "right"),)),
    "right": Mode((*BODY, "pr"), _flow("right"), (_down("right", "ground", "left"),)),
    "ground": Mode(
        (*BODY, "pl", "pr"),
        _flow("left", "right"),
        (_off("ground", "last_right", "left"), _off("ground", "last_left", "right")),
    ),
    "last_left": Mode((*BODY, "pl"), _flow("left"), (_off("last_left", "ascent", "left"),)),
    "last_right": Mode((*BODY, "pr"), _flow("right"), (_off("last_right", "ascent", "right"),)),
    "ascent": Mode(BODY, _flow(), (Edge("ascent->apex", "apex", lambda x: -x["vz"]),)),
    "apex": Mode((), None),
}
