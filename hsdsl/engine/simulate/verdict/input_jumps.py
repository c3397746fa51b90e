"""Jumps of inputs and functions of time within the error of a transition: does the order of the two matter?"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterator

from hsdsl.base.numbers.arithmetic import DOMAIN_ERRORS, Number
from hsdsl.engine.execution import Transition
from hsdsl.engine.kernel import ModeKernel
from hsdsl.engine.simulate.input_segments import Segment
from hsdsl.engine.simulate.verdict.place import Place
from hsdsl.engine.simulate.verdict.recorded_run import RecordedRun

Sides = tuple[Segment, Segment]


def jumps_near(run: RecordedRun, t: Number, late: float) -> Iterator[Sides]:
    """The segments on both sides of each jump of an input that is no further from a time than that may be late."""
    segments = run.problem.timeline.segments
    number = max(0, bisect_right(segments, t, key=lambda segment: segment.start) - 1)
    for before, after in zip(segments[max(0, number - 1) : number + 1], segments[number or 1 :], strict=False):
        if after.jump and abs(float(after.start) - float(t)) <= late:
            yield before, after


def indifferent(run: RecordedRun, place: Place, k: int, sides: Sides, made: Transition | None = None) -> bool:
    """Whether a transition of edge k is the same on both sides of a jump, so that both orders lead to one point.

    The jump changes neither a surface of the modes that it leaves and enters nor its reset, and the flow crosses its
    surface before and behind it. What the jump itself sets off, at once on entry, is behind it.
    """
    if made is not None and made.entry and made.time == sides[1].start and len(run.cascade(made)) == 1:
        return True
    t, x, target = place.t, place.x, place.mode.edges[k].target
    try:
        one, other = (run.problem.kernel.bind(run.index(place.mode.name), side.data) for side in sides)
        if _seen(one, k, t, x) != _seen(other, k, t, x):
            return False
        entry = made is not None and made.entry
        if not (entry or min(side.rates[k](t, *x)[0] for side in (one, other)) > place.rate_roundoff(k)):
            return False
        after = one.resets[k](t, *x)
        behind = [run.problem.kernel.bind(target, side.data).surfaces(t, *after) for side in sides]
    except DOMAIN_ERRORS:
        return False
    return behind[0] == behind[1]


def _seen(kernel: ModeKernel, k: int, t: Number, x: tuple[Number, ...]) -> tuple[object, ...]:
    """What decides on a transition, and what it makes of a state."""
    return kernel.surfaces(t, *x), kernel.conditions[k](t, *x), kernel.resets[k](t, *x)
