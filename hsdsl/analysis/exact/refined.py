"""References for models without a stored one: runs in many digits, refined until they agree.

The relaxed scheme runs in twenty-four digits or more with a relaxation far below the requested digits, and again with
half the steps (a tolerance 32 times smaller, for a method of order 5) and a relaxation 32 times smaller. The difference
of the two runs in transition times and states is the stated error of the finer one. It is an estimate: an upper bound
as long as the coarse run's error is at least twice the fine one's. Both runs share the loop and the lowered model, so
errors of lowering stay hidden: those need an independent solution.
"""

from __future__ import annotations

from dataclasses import replace
from math import floor, inf, log10
from typing import Any

import numpy as np

from hsdsl.base.errors import UsageError
from hsdsl.engine.execution import Arc, Array, Execution, Transition, Verdict

FEWEST, MOST = 4, 14
ATTEMPTS = 4
FINER = 32
SAMPLES = 64  # in each arc, at which two runs are compared
ROUNDOFF = 2.0**-50  # of the largest value: rounding a run to float64, and evaluating it there
SOURCE = (
    "relaxed scheme in {precision} digits at tolerance {tolerance}, strips taken out; error: what half the steps change"
)


def precise(model: Any, digits: int = 10, **options: Any) -> Execution:
    """Run a model until halving its steps changes nothing in so many decimal digits.

    Parameters
    ----------
    model : Model
        Any model whose run gets to its end with finitely many transitions.
    digits : int
        Right digits after the point, 4 to 14.
    **options
        ``until``, ``parameters``, ``initial`` and ``max_transitions`` (1000 if not given), as for ``Model.simulate``.

    Returns
    -------
    Execution
        In float64 and without strips: transition times less the delays before them. ``settings["error"]`` is the
        largest change by halved steps, ``settings["digits"]`` the digits that this leaves.

    Raises UsageError: the runs do not agree to so many digits, make other transitions, or do not get to their end.
    """
    if not FEWEST <= digits <= MOST:
        raise UsageError(f"a reference in float64 has {FEWEST} to {MOST} digits, not {digits}")
    exponent, error = digits + 1, inf
    options = {"max_transitions": 1000, "precision": digits + 20, **options}
    for _ in range(ATTEMPTS):
        coarse, fine = (_run(model, exponent, finer, options) for finer in ("", f"/{FINER}"))
        assert coarse.assessment is not None
        verdict = coarse.assessment(coarse, fine)
        coarse, fine = without_strips(coarse, verdict), without_strips(fine, verdict)
        error = difference(coarse, fine)
        if error <= 10.0**-digits:
            return _rounded(fine, error, SOURCE.format(precision=digits + 20, tolerance=f"1e-{exponent}/{FINER}"))
        exponent += 4 if error == inf else min(4, 1 + digits + floor(log10(error)))
    raise UsageError(f"halved steps still change {error:.1e}: the run is not known to {digits} digits")


def _run(model: Any, exponent: int, finer: str, options: dict[str, Any]) -> Execution:
    sizes = {"tolerance": f"1e-{exponent}{finer}", "relaxation": f"1e-{exponent + 3}{finer}"}
    run = model.simulate(scheme="relaxed", method="auto", **sizes, **options)
    if not run.stop.complete or (run.transitions and run.transitions[-1].resumed is None):
        raise UsageError(f"a reference must get to its end, between transitions: {run.stop.message}")
    return run


def without_strips(run: Execution, verdict: Verdict) -> Execution:
    """Take the strips out of a relaxed run with this verdict: all after a strip is earlier by its duration."""
    rows: list[int] = []
    arcs: list[Arc] = []
    transitions: list[Transition] = []
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
    delay = 0
    for transition in run.transitions:
        time = transition.time - delay
        transitions.append(replace(transition, time=time, resumed=time))
        delay = delay + (transition.resumed - transition.time)
    columns = {name: getattr(run, name)[rows] for name in ("values", "outputs", "depth", "coefficients")}
    end = times[rows[-1]]
    ends = {"final": replace(run.final, time=end), "stop": replace(run.stop, time=end), "verdict": verdict}
    return replace(run, times=times[rows], arcs=tuple(arcs), transitions=tuple(transitions), **ends, **columns)


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


def _rounded(run: Execution, error: float, source: str) -> Execution:
    """Round a refined run to float64, with its error and its source."""
    exact = run.output_function

    def outputs(mode: str, t: float, x: tuple[float, ...]) -> list[float]:
        assert exact is not None
        return [float(value) for value in exact(mode, t, x)]

    def floats(named: dict[str, Any] | None) -> dict[str, float]:
        return {name: float(value) for name, value in (named or {}).items()}

    error = max(error, ROUNDOFF * float(np.max(np.abs(np.nan_to_num(run.values.astype(float))))))
    final, until = run.final, float(run.settings["until"])
    transitions = (
        replace(t, time=float(t.time), resumed=float(t.time), before=floats(t.before), after=floats(t.after))
        for t in run.transitions
    )
    return replace(
        run,
        engine="refined",
        scheme="exact",
        settings={"until": until, "error": error, "digits": floor(-log10(error)), "source": source},
        stop=replace(run.stop, time=float(run.stop.time)),
        transitions=tuple(transitions),
        final=replace(final, time=float(final.time), state=floats(final.state), outputs=floats(final.outputs)),
        digits=None,
        output_function=outputs,
        **{name: getattr(run, name).astype(float) for name in ("times", "values", "outputs", "depth", "coefficients")},
    )
