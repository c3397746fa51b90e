"""What a run has written, as an execution."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from functools import cache, partial
from typing import TYPE_CHECKING, Any

import numpy as np

from hsdsl.base.defaults import DEFAULTS
from hsdsl.base.numbers.arithmetic import Number
from hsdsl.engine.execution import Arc, Execution, Point, Stop, Transition, Verdict
from hsdsl.engine.runtime.kernel import Sampler
from hsdsl.engine.simulate.columns import Columns
from hsdsl.engine.simulate.compiled import CompiledRun
from hsdsl.engine.simulate.output_buffers import arcs_of, last_arc, transitions_of
from hsdsl.engine.simulate.problem import Problem
from hsdsl.engine.simulate.settings import Settings
from hsdsl.engine.simulate.stops import LEFT_OUT, TWO_STEP, Diagnostics, warnings_of

if TYPE_CHECKING:
    from hsdsl.engine.simulate.run import Run

COLUMNS = ("times", "values", "outputs", "depth", "coefficients")


def from_recorder(known: dict[str, Any], run: Run, stop: Stop, seconds: dict[str, float]) -> Execution:
    """Make the execution of what the Python loop has recorded."""
    columns, transitions = run.recorder.columns(), tuple(run.recorder.transitions)
    execution = Execution.deferred(
        {"verdict": _verdict},
        known,
        stop=stop,
        seconds=seconds,
        assessment=partial(_assessment, run, lambda: run.diagnostics),
        noted=partial(_noted, run, run.diagnostics),
        settings=described(run.settings, run.program.left_out),
        transitions=transitions,
        final=_final(columns["arcs"][-1], columns, run.program.outputs, run.tails.states(run.program.modes)),
        **columns,
    )
    execution.check()
    return execution


def written(known: dict[str, Any], run: CompiledRun, stop: Stop, seconds: dict[str, float]) -> Execution:
    """Make the execution of what the compiled loop has written, ``known`` being what all such runs have in common.

    Arrays and objects are made on first use: for a short run they would take longer than the run.
    """
    plan, columns, fields = run.plan, run.columns, known.copy()
    assert columns is not None
    layouts = plan.layouts
    of_arcs, states = (None, layouts.kinds[0]) if layouts.one else layouts.found(columns["arc"]["mode"])
    fields["stop"], fields["seconds"], fields["compiled"], fields["states"] = stop, seconds, run, states
    fields["assessment"] = partial(_assessment_of, run)
    fields["sampler"] = Sampler(plan.sampled, columns, layouts.kinds, of_arcs)
    return Execution.of_fields(fields)


def _assessment_of(
    under_way: CompiledRun, execution: Execution, finer: Execution | None, followed: bool = False
) -> Verdict:
    if finer is None and not followed:
        return _of_compiled()(under_way, execution)
    return _assessment(under_way.plan.problem, lambda: under_way.diagnostics, execution, finer, followed)


@cache
def _of_compiled() -> Callable[..., Verdict]:
    from hsdsl.engine.simulate.verdict import assess_compiled  # not every run needs one

    return assess_compiled


def _column(name: str) -> Callable[[Execution], Any]:
    return lambda execution: _columns(execution)[name]


def _of(execution: Execution) -> CompiledRun:
    assert isinstance(execution.compiled, CompiledRun)
    return execution.compiled


def _columns(execution: Execution) -> Columns:
    columns = _of(execution).columns
    assert columns is not None
    return columns


def _settings(execution: Execution) -> dict[str, Any]:
    problem = _of(execution).plan.problem
    return described(problem.settings, problem.program.left_out)


def _transitions(execution: Execution) -> Sequence[Transition]:
    return transitions_of(_columns(execution), _of(execution).plan.problem.program)


def _arcs(execution: Execution) -> tuple[Arc, ...]:
    plan = _of(execution).plan
    arcs = tuple(arcs_of(_columns(execution), plan.problem.program, plan.layouts))
    execution.__dict__["arcs"] = arcs
    execution.check()
    return arcs


def _last_arc(execution: Execution) -> Arc:
    plan = _of(execution).plan
    return last_arc(_columns(execution), plan.problem.program, plan.layouts)


def _verdict(execution: Execution) -> Verdict:
    assert execution.assessment is not None
    began = time.perf_counter()
    verdict = execution.assessment(execution, None)
    execution.seconds["verdict"] = time.perf_counter() - began
    return verdict


_LATER: dict[str, Callable[[Execution], Any]] = {
    **{name: _column(name) for name in COLUMNS},
    "settings": _settings,
    "transitions": _transitions,
    "arcs": _arcs,
    "final": lambda execution: _final(
        _last_arc(execution), _columns(execution), execution.output_names, _of(execution).waits
    ),
    "verdict": _verdict,
}


# of compiled runs: with room for what each has of its own, so that no copy of it grows
_COMPILED = {"_later": _LATER} | dict.fromkeys(("stop", "seconds", "compiled", "states", "assessment", "sampler"))


def about(problem: Problem, compiled: bool) -> dict[str, Any]:
    """Return what all runs of a problem have in common."""
    program, settings = problem.program, problem.settings
    return (_COMPILED if compiled else {}) | {
        "model": program.path,
        "digest": program.digest,
        "engine": "c" if compiled else "python",
        "scheme": settings.scheme,
        "method": settings.method.name if settings.method else "two-step",
        "output_names": program.outputs,
        "title": program.title,
        "digits": problem.arithmetic.digits,
        "overrides": dict(settings.overrides),
        "output_function": problem.output_values,
    }


def _native(value: Any) -> Number:
    """Return a column's number as Python's own (NumPy has its own float)."""
    return float(value) if isinstance(value, np.float64) else value


def _final(
    last: Arc, columns: Columns | Mapping[str, Any], outputs: tuple[str, ...], waits: Mapping[str, Number]
) -> Point:
    row, width = last.last, len(last.states)
    return Point(
        time=_native(columns["times"][row]),
        mode=last.mode,
        jump=last.jump,
        kind=last.kind,
        state={**{s: _native(v) for s, v in zip(last.states, columns["values"][row][:width], strict=True)}, **waits},
        outputs={name: _native(v) for name, v in zip(outputs, columns["outputs"][row], strict=True)},
    )


def described(settings: Settings, left_out: tuple[str, ...] = ()) -> dict[str, Any]:
    """Return the settings that governed the run, by the names of the model file, and what was left out of it."""
    samples = settings.samples if isinstance(settings.samples, int | None) else list(settings.samples)
    size = {"step": settings.step} if settings.tolerance is None else {"tolerance": settings.tolerance}
    return {
        "until": settings.until,
        **size,
        **({"relaxation": settings.relaxation} if settings.method else {}),
        "max_transitions": settings.max_transitions,
        **({"completion": settings.completion} if settings.completion != DEFAULTS["completion"] else {}),
        **({"scale": dict(settings.scale)} if settings.scale else {}),
        **({} if samples is None else {"samples": samples}),
        **({} if settings.method_chosen is None else {"method_chosen": settings.method_chosen}),
        **({"left_out": {"states": list(left_out), "reason": LEFT_OUT}} if left_out else {}),
    }


def _noted(problem: Problem, diagnostics: Diagnostics, execution: Execution) -> str:
    from hsdsl.engine.simulate.verdict import RunView, noted  # of ensembles by the Python loop

    return noted(RunView(problem, execution), diagnostics)


def _assessment(
    problem: Problem,
    notes: Callable[[], Diagnostics],
    execution: Execution,
    finer: Execution | None,
    followed: bool = False,
) -> Verdict:
    if problem.settings.one_stop is not None:
        return Verdict("unknown", TWO_STEP, warnings_of((), problem.program))
    from hsdsl.engine.simulate.verdict import RunView, assess  # not every run needs one

    return assess(RunView(problem, execution, finer, followed=followed), notes())
