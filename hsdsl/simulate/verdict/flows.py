"""The flow along steps: does it vary where no step looked, jump, or have no bound on its slope?

A step's polynomial knows the flow at a few points. The flow is enclosed on parts of the step and held against the
polynomial's own derivative: what sticks out is a pulse that was not seen, unless it is the enclosure's own width, which
halves with the part.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hsdsl.enclosures import as_range
from hsdsl.program import ModeProgram
from hsdsl.simulate.stops import show
from hsdsl.simulate.verdict.agreement import ROUNDOFF_UNITS
from hsdsl.simulate.verdict.finding import Finding
from hsdsl.simulate.verdict.run_view import RunView, visited
from hsdsl.simulate.verdict.steps import Parts, high, low, steps_of, undecided

HALVINGS = 14
RESOLVED = 8  # an enclosure's own width has fallen by so much after three halvings
Array = NDArray[np.float64]


def flows(run: RunView) -> tuple[list[Finding], list[str]]:
    """Look at the flow of every mode along all steps in it."""
    jumping = [mode for mode in visited(run) if mode.jumps] if run.doubts("flow change") else []
    found = [_jumping(jumping)] if jumping else []
    if run.errors is None:
        return found, []
    for steps in steps_of(run, doubtful="changing"):
        with np.errstate(all="ignore"):
            found += _named(run, "a change of the flow", "may not have been seen", *_unseen(run, steps))
            if run.problem.program.modes[steps.mode].steep:
                found += _named(run, "the slope of the flow", "has no bound", *_steep(run, steps))
    return found, []


def _jumping(modes: Sequence[ModeProgram]) -> Finding:
    names = ", ".join(mode.name for mode in modes)
    where = f"the flow of mode {names} jumps where sign or floor does, or atan2 on its cut"
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
    below, above = steps.slopes()
    enough = np.maximum(_beyond(run, steps), above - below) / RESOLVED
    names = run.problem.program.modes[steps.mode].states
    digits = ROUNDOFF_UNITS * float(run.arithmetic.unit) * np.array([run.sizes.get(name, 0.0) for name in names])

    def decides(parts: Parts) -> NDArray[np.bool_]:
        beyond = _beyond(run, parts)
        effect = beyond * (parts.width * parts.length)[:, None]
        return ~((beyond <= enough[number[parts.row]]) | (effect <= np.maximum(parts.error, digits)))

    return undecided(steps, decides, HALVINGS)


def _beyond(run: RunView, parts: Parts) -> Array:
    """How far the enclosed flow lies beyond the derivatives of the polynomials; shape (N, n)."""
    n, (below, above) = len(parts), parts.slopes()
    flow = [as_range(f) for f in parts.bound(run).flow(parts.times, *parts.states())]
    sides = [np.maximum(high(f, n) - above[:, i], below[:, i] - low(f, n)) for i, f in enumerate(flow)]
    return np.stack(sides, axis=1) if sides else np.zeros((n, 0))


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
