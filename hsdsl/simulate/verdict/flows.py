"""The flow along steps: does it vary where no step looked, jump, or have no bound on its slope?

A step's polynomial knows the flow at a few points. The flow is enclosed on parts of the step and held against the
polynomial's own derivative: what sticks out is a pulse that was not seen, unless it is small against what the step
shows, or the enclosure's own width, which halves with the part.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hsdsl.arithmetic import NOTHING
from hsdsl.bernstein import halving
from hsdsl.enclosures import Range, hull
from hsdsl.program import ModeProgram
from hsdsl.simulate.stops import show
from hsdsl.simulate.verdict.agreement import ROUNDOFF_UNITS
from hsdsl.simulate.verdict.finding import Finding
from hsdsl.simulate.verdict.run_view import RunView, visited
from hsdsl.simulate.verdict.steps import Parts, high, low, steps_of, undecided

HALVINGS = 14
RESOLVED = 8  # the flow is as it seems where it varies by so much more, or may move a state by at most so many errors
SHORT = 2.0**-10  # of a step: a piece that shows how fast enclosures of the flow widen
Array = NDArray[np.float64]


def flows(run: RunView) -> tuple[list[Finding], list[str]]:
    """Look at the flow of every mode along all steps in it."""
    jumping = [mode for mode in visited(run) if mode.jumps] if run.doubts("flow change") else []
    found = [_jumping(jumping)] if jumping else []
    if run.errors is None:
        return found, []
    for steps in steps_of(run, doubtful="changing"):
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
    """Parts of steps on which the flow may be what the step's polynomial does not show."""
    number = np.zeros(int(steps.row.max(initial=0)) + 1, dtype=int)
    number[steps.row] = np.arange(len(steps))
    enough = _shown(run, steps) / RESOLVED
    names = run.problem.program.modes[steps.mode].states
    digits = ROUNDOFF_UNITS * float(run.arithmetic.unit) * np.array([run.sizes.get(name, 0.0) for name in names])

    def decides(parts: Parts) -> NDArray[np.bool_]:
        beyond = _beyond(run, parts)
        effect = beyond * parts.length[:, None]  # of all parts of a step together
        error = np.maximum(np.maximum(parts.error, digits), NOTHING)
        return ~((beyond <= enough[number[parts.row]]) | (effect <= RESOLVED * error))

    return undecided(steps, decides, HALVINGS)


def _shown(run: RunView, steps: Parts) -> Array:
    """How much steps show of the flow; shape (N, n).

    What varies is the derivative of the polynomial, or terms of the flow: those of an enclosure do not cancel, and it
    widens with a piece. The median of three places leaves out a pulse at one. Neither counts for more than what the
    flow may be along the whole step.
    """
    below, above = steps.slopes()
    least, most = _enclosed(run, steps, steps.times, steps.states())
    return np.minimum(np.maximum(above - below, np.median(_widening(run, steps), axis=0)), most - least)


def _widening(run: RunView, steps: Parts) -> list[Array]:
    """How much wider the flow's enclosures of short pieces become by the step's length; shape (N, n), three places."""
    whole, degree = steps.bernstein, steps.bernstein.shape[2] - 1
    half = whole @ halving(degree)[0]
    ends = [(0.0, whole[..., 0], whole[..., 1] - whole[..., 0]), (1.0, whole[..., -1], whole[..., -1] - whole[..., -2])]
    found = list[Array]()
    for share, middle, slope in (*ends, (0.5, half[..., -1], 2 * (half[..., -1] - half[..., -2]))):
        time, short = steps.time + share * steps.length, SHORT * steps.length
        wide = degree * SHORT * np.abs(slope)
        states = hull(middle - wide / 2, middle + wide / 2)
        least, most = _enclosed(run, steps, Range(time - short / 2, time + short / 2), states)
        found.append(np.where(np.isfinite(most - least), (most - least) / SHORT, 0.0))
    return found


def _beyond(run: RunView, parts: Parts) -> Array:
    """How far the enclosed flow and the derivatives of the polynomials lie beyond each other; shape (N, n)."""
    below, above = parts.slopes()
    least, most = _enclosed(run, parts, parts.times, parts.states())
    return np.maximum(np.abs(most - above), np.abs(below - least))


def _enclosed(run: RunView, parts: Parts, times: Range, states: Sequence[Range]) -> tuple[Array, Array]:
    """The least and the largest the flow may be; shape (N, n) each."""
    flow, n = parts.bound(run).flow(times, *states), len(parts)
    if not flow:
        return np.zeros((n, 0)), np.zeros((n, 0))
    return np.stack([low(f, n) for f in flow], axis=1), np.stack([high(f, n) for f in flow], axis=1)


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
