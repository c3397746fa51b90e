"""A pendulum whose string is caught by a pin (ARGESIM comparison C7), by Taylor series."""

from __future__ import annotations

from collections.abc import Mapping

from hsdsl.engine.execution import Execution
from references.by_series import by_series
from references.interpolation import Number, mp
from references.series import Flow, Series, States, sin_cos
from references.taylor import Edge, Mode

SHORT = mp.mpf("0.3")  # the string below the pin; above it its length is 1
PIN = -mp.pi / 12
STATES = ("phi", "w")


def constrained_pendulum() -> Execution:
    """The pendulum from rest at pi/6 until t = 10, solved to forty digits or more.

    Returns
    -------
    Execution
        In modes ``long`` and ``short`` with states ``phi``, ``w``; ``settings["error"]`` is its error at any time.
    """
    caught = Edge("long->short", "short", lambda x: PIN - x["phi"], _scaled(1 / SHORT))
    freed = Edge("short->long", "long", lambda x: x["phi"] - PIN, _scaled(SHORT))
    modes = {"long": Mode(STATES, _flow(mp.one), (caught,)), "short": Mode(STATES, _flow(SHORT), (freed,))}
    name, title = "constrained-pendulum", "Pendulum whose string is caught by a pin"
    return by_series(name, title, modes, "long", (mp.pi / 6, 0), 10, "0.05")


def _flow(length: Number) -> Flow:
    def flow(x: States) -> Mapping[str, Series]:
        sine, _ = sin_cos(x["phi"])
        return {"phi": x["w"], "w": sine * (mp.mpf("-9.81") / length) - x["w"] * (mp.mpf("0.2") / mp.mpf("1.02"))}

    return flow


def _scaled(factor: Number) -> Flow:
    return lambda x: {"w": x["w"] * factor}
