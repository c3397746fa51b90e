"""The flow along steps: does it vary where no step evaluated it, jump, or have no bound on its slope?

A step's polynomial knows the flow at a few points. Operations of the flow that are not as smooth as half a step is long
may be pulses that it did not see. What they may add is held against the error, on parts of the step that are halved;
there the flow is held against the polynomial's own derivative, too.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hsdsl.base.numbers.arithmetic import NOTHING
from hsdsl.base.numbers.enclosures import Array
from hsdsl.engine.simulate.stops import show
from hsdsl.engine.simulate.verdict.expanded import EXPANDED
from hsdsl.engine.simulate.verdict.expansions import RESOLVED, line
from hsdsl.engine.simulate.verdict.finding import Finding
from hsdsl.engine.simulate.verdict.run_view import RunView, visited
from hsdsl.engine.simulate.verdict.steps import MOST_PARTS, Parts, high, joined, low, steps_of, undecided
from hsdsl.mathematics.program import ModeProgram

HALVINGS = 14
SEEN = 0.5  # of a step: every method has stages on parts of such a width, and shows what is as smooth as they are long


def flows(run: RunView) -> tuple[list[Finding], list[str]]:
    """Findings about the flow of every mode along all steps in it."""
    jumping = [mode for mode in visited(run) if mode.jumps] if run.undecided("flow change") else []
    found = [_jumping(jumping)] if jumping else []
    if run.errors is None:
        return found, []
    for steps in steps_of(run, marked="changing"):
        with np.errstate(all="ignore"):
            steep = run.problem.program.modes[steps.mode].steep
            unbounded = [*_named(run, "the slope of the flow", "has no bound", *_steep(run, steps))] if steep else []
            found += unbounded or _named(run, "a change of the flow", "may not have been seen", *_unseen(run, steps))
    return found, []


def _jumping(modes: Sequence[ModeProgram]) -> Finding:
    names = ", ".join(mode.name for mode in modes)
    where = f"the flow of mode {names} jumps where sign, floor or select does, or atan2 on its cut"
    sentence = f"{where}, and the theorem is about continuous ones"
    return Finding("jump", "unknown", sentence)


def _named(run: RunView, what: str, how: str, parts: Parts, _: Any) -> Iterator[Finding]:
    if len(parts):
        first = float((parts.time + parts.start * parts.length).min())
        name = run.problem.program.modes[parts.mode].name
        yield Finding("flow", "unknown", f"{what} of mode {name} {how} close to t = {show(first)}")


def _unseen(run: RunView, steps: Parts) -> tuple[Parts, NDArray[np.bool_]]:
    """Parts of steps on which the flow may be what the step's polynomial does not show.

    Parts are halved where they may move a state by more than half of their share of what is allowed for the step, as
    long as all parts together may move it by more than that.
    """
    number = np.zeros(int(steps.row.max(initial=0)) + 1, dtype=int)
    number[steps.row] = np.arange(len(steps))
    allowance, parts, halvings = RESOLVED * np.maximum(steps.error, NOTHING), steps, 0
    decided, moved = steps.take([]), np.zeros((3, 0, steps.error.shape[1]))
    while True:
        step, here = number[parts.row], _moved_unseen(run, parts)
        open_ = np.logical_not(here[0] <= allowance[step] * parts.width[:, None] / 2)
        left: NDArray[np.bool_] = np.any(open_, axis=1)
        both, together = joined([decided, parts]), np.concatenate([moved, here], axis=1)
        far = _furthest(number[both.row], both.start, together, allowance)
        left &= np.any(np.logical_not(far <= allowance), axis=1)[step]
        if halvings == HALVINGS or not 0 < left.sum() <= MOST_PARTS // 2:
            return parts.take(left), open_[left]
        kept = np.concatenate([np.ones(len(decided), dtype=bool), ~left])
        decided, moved = both.take(kept), together[:, kept]
        parts, halvings = parts.take(left).halves(), halvings + 1


def _furthest(step: NDArray[np.int64], start: Array, moved: Array, allowance: Array) -> Array:
    """How far parts, one after another, may move states along their steps; shape (steps, n)."""
    order = np.lexsort((start, step))
    steps, first, counts = np.unique(step[order], return_index=True, return_counts=True)
    most, drift, unresolved = moved[:, order]
    drift = np.clip(
        drift, -3 * allowance[step[order]], 3 * allowance[step[order]]
    )  # no step spoils the sums of another
    sums = np.cumsum(drift, axis=0)
    since = np.abs(sums - np.repeat(sums[first] - drift[first], counts, axis=0))
    found = np.zeros(allowance.shape)
    found[steps] = (
        np.maximum.reduceat(since, first) + np.maximum.reduceat(most, first) + np.add.reduceat(unresolved, first)
    )
    return found


def _moved_unseen(run: RunView, parts: Parts) -> Array:
    """How far states are moved along parts by what these do not show; shape (3, N, n).

    Either way, in all, and by what may have any sign: that is what is unresolved or, on parts so short that not
    each has a stage, how the flow differs from the slopes of the states' polynomials. What errors of states change
    the flow by is no pulse.
    """
    (time, *states), slopes = parts.expanded()
    data = [line(column, 0.0) for column in parts.data.T]
    flow = run.problem.kernel.over(EXPANDED).bind(parts.mode, data).flow(time, *states)
    found = np.zeros((3, len(parts), len(slopes)))
    for i, (f, slope) in enumerate(zip(flow, slopes, strict=True)):
        differs, allowed = f - slope, RESOLVED * f.error
        shown, drift = (np.where(parts.width < SEEN, a, 0.0) for a in (differs.magnitude, differs.mean))
        found[0, :, i] = np.maximum(f.unresolved + shown - allowed, 0.0)
        found[1, :, i] = np.copysign(np.maximum(np.abs(drift) - allowed, 0.0), drift)
        found[2, :, i] = np.maximum(f.unresolved - np.maximum(allowed - np.abs(drift), 0.0), 0.0)
    return found * (parts.width * parts.length)[:, None]


def _steep(run: RunView, steps: Parts) -> tuple[Parts, NDArray[np.bool_]]:
    """Parts of steps on which a derivative of the flow may have no bound."""

    def decides(parts: Parts) -> NDArray[np.bool_]:
        data = parts.bound_data
        slopes = run.problem.kernel.enclosing.jacobian(parts.mode, data)(parts.times, *parts.states())
        unbounded = np.zeros((len(parts), 1), dtype=bool)
        for slope in slopes:
            unbounded[:, 0] |= ~(np.isfinite(high(slope, len(parts))) & np.isfinite(low(slope, len(parts))))
        return unbounded

    return undecided(steps, decides, HALVINGS)
