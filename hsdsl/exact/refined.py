"""A reference for a model without a closed form: runs in many digits, refined until they agree.

The relaxed scheme is run in twenty-four digits or more with a relaxation far below the digits asked for, and again with
half the steps (a tolerance 32 times smaller, for a method of order 5) and a relaxation 32 times smaller. What the two
runs differ by, in transition times, in states at both sides of each transition and in between, is the error given with
the finer run. That is an estimate and no proof: it is an upper bound as long as the coarse run's error is at least
twice the fine one's. It is also the same loop as any run's, so it covers round-off, step and relaxation, and not
whether the model was lowered rightly: that takes an independent solution.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from math import floor, inf, log10
from typing import Any, Protocol

import numpy as np

from hsdsl.errors import UsageError
from hsdsl.execution import Arc, Array, Execution, Transition

FEWEST, MOST = 4, 14
ATTEMPTS = 4
FINER = 32
SAMPLES = 64  # in each arc, at which two runs are compared
ROUNDOFF = 2.0**-50  # of the largest value: rounding a run to float64, and evaluating it there
SOURCE = (
    "relaxed scheme in {precision} digits at tolerance {tolerance}, strips taken out; error: what half the steps change"
)


class Simulated(Protocol):
    """A model, as far as it is run here."""

    @property
    def simulate(self) -> Callable[..., Execution]: ...


def precise(model: Simulated, digits: int = 10, **asked: Any) -> Execution:
    """Run a model until halving its steps changes nothing in so many decimal digits.

    Parameters
    ----------
    model : Model
        Any model whose run gets to its end with finitely many transitions.
    digits : int
        How many digits behind the point are to be right, 4 to 14.
    **asked
        ``until``, ``parameters``, ``initial`` and ``max_transitions`` (1000 if not given), as for ``Model.simulate``.

    Returns
    -------
    Execution
        In float64 and without strips: transition times less the delays before them. ``settings["error"]`` is what
        halved steps changed at most, ``settings["digits"]`` the digits that this leaves.

    Raises
    ------
    UsageError
        The runs do not agree to so many digits, make other transitions, or do not get to their end.
    """
    if not FEWEST <= digits <= MOST:
        raise UsageError(f"a reference in float64 has {FEWEST} to {MOST} digits, not {digits}")
    precision, exponent = digits + 20, digits + 1
    asked = {"max_transitions": 1000, **asked}
    error = inf
    for _ in range(ATTEMPTS):
        coarse = _run(model, f"1e-{exponent}", f"1e-{exponent + 3}", precision, asked)
        fine = _run(model, f"1e-{exponent}/{FINER}", f"1e-{exponent + 3}/{FINER}", precision, asked)
        error = difference(coarse, fine)
        if error <= 10.0**-digits:
            return _reference(fine, error, SOURCE.format(precision=precision, tolerance=f"1e-{exponent}/{FINER}"))
        exponent += 4 if error == inf else min(4, 1 + digits + floor(log10(error)))
    raise UsageError(f"halved steps still change {error:.1e}: the run is not known to {digits} digits")


def _run(model: Simulated, tolerance: str, relaxation: str, precision: int, asked: dict[str, Any]) -> Execution:
    run = model.simulate(
        scheme="relaxed", method="auto", tolerance=tolerance, relaxation=relaxation, precision=precision, **asked
    )
    if not run.stop.complete or (run.transitions and run.transitions[-1].resumed is None):
        raise UsageError(f"a reference must get to its end, between transitions: {run.stop.message}")
    return without_strips(run)


def without_strips(run: Execution) -> Execution:
    """Take the strips out of a relaxed run: what comes after each is that much earlier."""
    rows: list[int] = []
    arcs: list[Arc] = []
    times = run.times.copy()
    delay = run.times[0] * 0
    for arc in run.arcs:
        if arc.kind == "strip":
            delay = delay + (run.times[arc.last] - run.times[arc.first])
            continue
        times[arc.first : arc.last + 1] -= delay
        if rows:
            times[arc.first] = times[rows[-1]]
        arcs.append(replace(arc, first=len(rows), last=len(rows) + arc.last - arc.first))
        rows.extend(range(arc.first, arc.last + 1))
    columns = {name: getattr(run, name)[rows] for name in ("values", "outputs", "depth", "coefficients")}
    end = times[rows[-1]]
    return replace(
        run,
        times=times[rows],
        arcs=tuple(arcs),
        transitions=tuple(_earlier(run.transitions)),
        final=replace(run.final, time=end),
        stop=replace(run.stop, time=end),
        **columns,
    )


def _earlier(transitions: tuple[Transition, ...]) -> Iterator[Transition]:
    delay = 0
    for transition in transitions:
        time = transition.time - delay
        yield replace(transition, time=time, resumed=time)
        delay = delay + (transition.resumed - transition.time)


def difference(a: Execution, b: Execution) -> float:
    """Return the largest difference in transition times, states at both sides of jumps, and states at equal times.

    Infinite where the executions make other transitions.
    """
    if [t.edge for t in a.transitions] != [t.edge for t in b.transitions] or len(a.arcs) != len(b.arcs):
        return inf
    worst = 0.0
    for one, other in zip(a.arcs, b.arcs, strict=True):
        for i, k in ((one.first, other.first), (one.last, other.last)):
            worst = max(worst, abs(float(a.times[i] - b.times[k])), _apart(a.values[i], b.values[k], len(one.states)))
        start = max(a.times[one.first], b.times[other.first])
        end = min(a.times[one.last], b.times[other.last])
        if end > start:
            inside = [start + (end - start) * k / (SAMPLES + 1) for k in range(1, SAMPLES + 1)]
            for name in one.states:
                worst = max(worst, _apart(a.sample(inside)[name], b.sample(inside)[name], SAMPLES))
    return worst


def _apart(a: Array, b: Array, count: int) -> float:
    return max((abs(float(x - y)) for x, y in zip(a[:count], b[:count], strict=True)), default=0.0)


def _reference(run: Execution, error: float, source: str) -> Execution:
    """Round a refined run to float64 and say what it rests on."""
    exact = run.output_function

    def outputs(mode: str, t: float, x: tuple[float, ...]) -> list[float]:
        assert exact is not None
        return [float(value) for value in exact(mode, t, x)]

    def rounded(state: dict[str, Any]) -> dict[str, Any]:
        return {name: float(value) for name, value in state.items()}

    error = max(error, ROUNDOFF * float(np.max(np.abs(np.nan_to_num(run.values.astype(float))))))
    return replace(
        run,
        engine="refined",
        scheme="exact",
        settings={
            "until": float(run.settings["until"]),
            "error": error,
            "digits": floor(-log10(error)),
            "source": source,
        },
        stop=replace(run.stop, time=float(run.stop.time)),
        transitions=tuple(
            replace(
                t, time=float(t.time), resumed=float(t.time), before=rounded(t.before), after=rounded(t.after or {})
            )
            for t in run.transitions
        ),
        final=replace(
            run.final, time=float(run.final.time), state=rounded(run.final.state), outputs=rounded(run.final.outputs)
        ),
        digits=None,
        output_function=outputs,
        **{name: getattr(run, name).astype(float) for name in ("times", "values", "outputs", "depth", "coefficients")},
    )
