"""The digital control system of Fig. 1: straight lines through four quadrants."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

from hsdsl.base.errors import UsageError
from hsdsl.engine.execution import Execution, Verdict
from references.closed_form import ClosedForm, as_execution
from references.interpolation import Number, Stretch, Vector, mp, number

SOURCE = "closed form: straight lines from axis to axis (Burden et al. 2013, Fig. 1)"
FIELDS = {"D0": ("1", "1"), "D1": ("1", "0.8"), "D2": ("0.7", "1"), "D3": ("1", "1")}
STATES = {mode: ("x", "y") for mode in FIELDS}
EXITS = {"D0": {0: "D2", 1: "D1"}, "D1": {0: "D3"}, "D2": {1: "D3"}, "D3": {}}  # by axis, in the model's order


def digital_control(x: Any = -1, y: Any = -1, *, until: Any = 2) -> Execution:
    """The digital control system from a point of its first quadrant, exactly.

    Parameters
    ----------
    x, y : int, float, str or Fraction
        Where it starts, neither above 0. Text is taken as decimals, exactly: starts nearer to the diagonal than floats
        can tell still go round the side they belong to. On the diagonal the transition to ``D2`` goes first, as
        in the model, and the other is recorded as its alternative.
    until : int, float or str
        End of the execution.

    Returns
    -------
    Execution
        In modes ``D0`` to ``D3`` with states ``x``, ``y``; ``settings["error"]`` bounds its error at any time.

    Raises UsageError: the start is not in the first quadrant.
    """
    start, end = (number(x, "x"), number(y, "y")), number(until, "until")
    if max(start) > 0 or end < 0:
        raise UsageError("the digital control system starts with x and y not above 0, and until is not below 0")
    at_once = " at once; either order leads to the same point" if start[0] == start[1] else ", one after the other"
    verdict = Verdict("holds", (f"the axes are crossed at a rate of 1{at_once}",))
    found = list(_stretches(start, end))
    scene = ClosedForm("digital-control.yaml", "Digital control system", SOURCE, STATES, found, verdict, 0)
    return as_execution(scene)


def _stretches(start: Vector, until: Number) -> Iterator[Stretch]:
    mode, t, x = "D0", mp.mpf(0), start
    while True:
        speed = tuple(mp.mpf(v) for v in FIELDS[mode])
        due = {axis: t - x[axis] / speed[axis] for axis in EXITS[mode]}
        end = min([until, *due.values()])
        reached = [axis for axis, time in due.items() if time == end]
        last = tuple(x[k] + speed[k] * (end - t) if k not in reached else mp.mpf(0) for k in (0, 1))
        edges = tuple(f"{mode}->{EXITS[mode][axis]}" for axis in reached)
        yield Stretch(mode, t, end, x, last, None, _rates(speed), edges[0] if edges else None, edges[1:])
        if not edges:
            return
        mode, t, x = EXITS[mode][reached[0]], end, last


def _rates(speed: Vector) -> Callable[[int], Vector]:
    return lambda n: speed if n == 1 else (mp.mpf(0), mp.mpf(0))
