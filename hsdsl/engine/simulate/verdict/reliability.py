"""From when on a run cannot be relied on: where a finer run parts from it, or an error outgrows its state."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from hsdsl.base.numbers.enclosures import Range, as_range
from hsdsl.engine.simulate.moving import ERROR_UNITS
from hsdsl.engine.simulate.stops import show
from hsdsl.engine.simulate.verdict.agreement import SAFE
from hsdsl.engine.simulate.verdict.finding import Finding
from hsdsl.engine.simulate.verdict.run_view import RunView
from hsdsl.engine.simulate.verdict.steps import steps_of

PLACES = 64  # of a run where the round-off of its flow is bounded
ROUNDOFF_ROUNDS = 3  # from a flow's round-off to what that moves, and what that moves in turn


def reliability(run: RunView) -> Iterator[Finding]:
    """From when on the run and its finer repetition differ in more than digits; sets ``run.reliable_until``."""
    if unreliable := _unreliable(run):
        run.reliable_until, why = unreliable
        yield Finding("reliability", "unknown", f"the run is unreliable from t = {show(run.reliable_until)} on: {why}")


def _unreliable(run: RunView) -> tuple[float, str] | None:
    """From when on the run is unreliable, and why; None where it is not.

    Round-off of the flow excuses an error only where no transition follows from it.
    """
    if run.errors is None or run.screen is not None:
        return None  # there is a screen only where both runs agree
    found: list[tuple[float, str]] = []
    if run.errors.parted is not None:
        found.append((run.errors.parted, "from there a finer run makes other transitions"))
    grown, columns = run.errors.unreliable, run.errors.columns
    floor = _roundoff(run) if grown and not found else {}
    for name, time in grown.items():
        if run.errors.by_row[-1, columns[name]] > SAFE * floor.get(name, 0.0):
            found.append((time, f"the error of {name} exceeds a tenth of its size"))
    return min(found, default=None)


def _roundoff(run: RunView) -> dict[str, float]:
    """What round-off in the flow alone may move each state by over the run.

    A state that stays near zero by cancellation has no digit right, and nothing is wrong with it.
    """
    span, unit = float(run.times[-1] - run.times[0]), ERROR_UNITS * float(run.arithmetic.unit)
    ends = list(steps_of(run, PLACES))
    moved: dict[str, float] = {}
    for _ in range(ROUNDOFF_ROUNDS):
        found = dict(moved)
        for steps in ends:
            names = run.problem.program.modes[steps.mode].states
            t, *x = steps.ends()[0]
            sizes = [np.abs(t.low), *(np.abs(a.low) for a in x)]
            wide = [unit * size + moved.get(name, 0.0) for name, size in zip(("", *names), sizes, strict=True)]
            box = [Range(a.low - e, a.high + e) for a, e in zip((t, *x), wide, strict=True)]
            for name, f in zip(names, map(as_range, steps.bound(run).flow(*box)), strict=True):
                found[name] = max(found.get(name, 0.0), span * float(np.max(f.high - f.low)))
        moved = found
    return moved
