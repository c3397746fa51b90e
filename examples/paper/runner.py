"""Fig. 15 to 17: the runner, the guards it touches down through, and two strides."""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, pi, sin
from typing import Any

import numpy as np
import numpy.typing as npt

from hsdsl.engine.execution import Execution
from paper.results import Desk, Finding

Array = npt.NDArray[Any]

D, L, PSI = 1.0, 1.0, pi / 5
LEGS = {  # by mode: what the left and the right leg do
    "aerial": ("swing", "swing"),
    "left": ("stance", "swing"),
    "right": ("swing", "stance"),
    "ground": ("stance", "stance"),
    "last_left": ("stance", "spent"),
    "last_right": ("spent", "stance"),
    "ascent": ("spent", "spent"),
    "apex": ("spent", "spent"),
}
EDGES = {
    "aerial->left": "left touchdown",
    "aerial->right": "right touchdown",
    "left->ground": "right touchdown",
    "right->ground": "left touchdown",
    "ground->last_right": "left lift-off",
    "ground->last_left": "right lift-off",
    "last_left->ascent": "left lift-off",
    "last_right->ascent": "right lift-off",
    "ascent->apex": "apex",
}
CAPTION: dict[str, Any] = {"scheme": "relaxed", "method": "midpoint", "step": 1e-3, "relaxation": 1e-2}  # of Fig. 17
STRIDES = {"A": {"w": 0}, "B": {"w": -0.4}}
HEADER = ("stride", "event", "time", "resumed", "fine time", "x", "z", "th", "vx", "vz", "w")
BOTTOM = {"A": "0.4586068969", "B": "0.4485971990"}
KNOWN = {  # two independent integrators, agreeing to eleven digits
    "A": ("0.2435646781", "0.2435646781", "0.6755930236", "0.6755930236", "0.9259377789"),
    "B": ("0.2043666231", "0.2419518050", "0.6049710813", "0.6091929510", "0.6683909551"),
}


@dataclass(frozen=True)
class Leg:
    """A leg; ``doing`` is swing (in the air, at its angle), stance (pushing on the ground) or spent for this stride."""

    hip: tuple[float, float]
    foot: tuple[float, float]
    doing: str


@dataclass(frozen=True)
class Pose:
    """The runner at an instant: its centre (x, z), its pitch, its left and right leg, and what just happened."""

    time: float
    x: float
    z: float
    th: float
    legs: tuple[Leg, Leg]
    event: str

    @property
    def feet_down(self) -> int:
        """How many feet are on the ground."""
        return sum(leg.doing == "stance" for leg in self.legs)


def runner(desk: Desk) -> list[Finding]:
    """Run both strides as the caption has them, and finer; draw the runner, the guards and the snapshots."""
    from paper.drawing import guards, schematic, strides

    model = desk.model("pronking-runner.yaml")
    coarse = {name: model.simulate(initial=initial, **CAPTION) for name, initial in STRIDES.items()}
    fine = {name: model.simulate(initial=initial) for name, initial in STRIDES.items()}
    rows = [row for name in STRIDES for row in events(name, coarse[name], fine[name])]
    desk.table("runner-events", HEADER, rows)
    poses = {name: snapshots(run) for name, run in coarse.items()}
    curves = guard_curves(np.linspace(-0.5, 0.5, 201))
    desk.table(
        "runner-guards", ("th", *curves), list(zip(np.linspace(-0.5, 0.5, 201).tolist(), *curves.values(), strict=True))
    )
    desk.picture("fig15-runner", schematic.draw)
    desk.picture("fig16-guards", lambda: guards.draw(curves, fine))
    desk.picture("fig17-strides", lambda: strides.draw(poses))
    return findings(coarse, fine)


def pose(mode: str, time: float, state: dict[str, float], event: str) -> Pose:
    """Place hips and feet."""
    x, z, th = (state[name] for name in ("x", "z", "th"))
    hips = [(x + s * D / 2 * cos(th), z + s * D / 2 * sin(th)) for s in (1, -1)]
    feet = [(hip[0] + L * sin(PSI + th), hip[1] - L * cos(PSI + th)) for hip in hips]
    legs: list[Leg] = []
    for hip, swing, name, doing in zip(hips, feet, ("pl", "pr"), LEGS[mode], strict=True):
        legs.append(Leg(hip, (state[name], 0.0) if doing == "stance" else swing, doing))
    return Pose(time, x, z, th, (legs[0], legs[1]), event)


def snapshots(run: Execution) -> list[Pose]:
    """Return the start, the instants of transitions (several at one instant are one) and the lowest point."""
    start = run(0.0)
    found = [pose(start.mode, 0.0, start.state, "start")]
    lowest_time = lowest(run)
    together = 1e-6 * CAPTION["relaxation"]
    pending: list[str] = []
    for i, t in enumerate(run.transitions):
        if lowest_time < t.time and not any(p.event == "lowest point" for p in found):
            low = run(lowest_time)
            found.append(pose(low.mode, lowest_time, low.state, "lowest point"))
        pending.append(EDGES[t.edge])
        following = run.transitions[i + 1] if i + 1 < len(run.transitions) else None
        if following is not None and t.resumed is not None and following.time - t.resumed < together:
            continue
        found.append(pose(t.target, t.time, t.before | (t.after or {}), _joined(pending)))
        pending = []
    return found


def _joined(events: list[str]) -> str:
    return events[0] if len(events) == 1 else f"{events[0].split()[-1]}, both"


def lowest(run: Execution) -> float:
    """Return when the height is least, by the sign of its rate on a fine grid."""
    times = np.linspace(float(run.times[0]), float(run.times[-1]), 20_001)
    return float(times[int(np.argmin(run.sample(times)["z"]))])


def events(stride: str, coarse: Execution, fine: Execution) -> list[tuple[object, ...]]:
    """List the transitions of the caption's run, each beside its time in the fine one."""
    rows: list[tuple[object, ...]] = []
    for ours, better in zip(coarse.transitions, fine.transitions, strict=True):
        state = [float(ours.before[name]) for name in HEADER[5:]]
        rows.append((stride, EDGES[ours.edge], float(ours.time), ours.resumed, float(better.time), *state))
    return rows


def guard_curves(th: Array) -> dict[str, list[float]]:
    """Return the height z at which each touchdown guard lies, not-a-number where the angle is another guard's.

    A foot is on the ground where z +- d/2 sin(theta) = l cos(psi + theta). Nose down (theta < 0) the left foot, the one
    in front, is the lower one and touches first.
    """
    left = L * np.cos(PSI + th) - D / 2 * np.sin(th)
    right = L * np.cos(PSI + th) + D / 2 * np.sin(th)
    back, front = np.where(th <= 0, 1.0, np.nan), np.where(th >= 0, 1.0, np.nan)
    curves = {"G(a,l)": left * back, "G(l,g)": right * back, "G(a,r)": right * front, "G(r,g)": left * front}
    return {name: curve.tolist() for name, curve in curves.items()}


def findings(coarse: dict[str, Execution], fine: dict[str, Execution]) -> list[Finding]:
    """Say when things happen in the fine runs, and how late the caption's are."""
    found: list[Finding] = []
    for name, run in fine.items():
        for t, known in zip(run.transitions, KNOWN[name], strict=True):
            found.append(Finding("Fig. 17", f"stride {name}: {EDGES[t.edge]}, eps = 1e-8", f"{t.time:.8f}", known))
        energy = f"{coarse[name].transitions[-1].time - run.transitions[-1].time:.4f}"
        found.append(Finding("Fig. 17", f"stride {name}: apex of the caption's run late by", energy, "<= 4 eps = 0.04"))
    return found
