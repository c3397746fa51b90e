"""Sensitivities of a model's executions: the augmented system of a call, prepared and run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any

from hsdsl.analysis.sensitivity.result import Sensitivity, Setting
from hsdsl.analysis.sensitivity.targets import ERROR, SPAN, UNIT, Target, listed, targets
from hsdsl.base.defaults import DEFAULT_TOLERANCE
from hsdsl.base.errors import UsageError
from hsdsl.base.names import INITIAL
from hsdsl.base.numbers.arithmetic import Number
from hsdsl.base.numbers.roundoff import ROUNDOFF_UNITS
from hsdsl.base.parts import present
from hsdsl.engine.execution import Execution
from hsdsl.engine.integrators import FALLBACK, METHODS
from hsdsl.engine.preparation import automatic
from hsdsl.engine.preparation.experiment import initial_layout, initial_state, start_of_parts
from hsdsl.engine.preparation.options import check_arguments, overrides_of
from hsdsl.engine.preparation.pipeline import Pipeline
from hsdsl.engine.preparation.values import Values, arithmetic_of
from hsdsl.engine.preparation.visible import visible_run
from hsdsl.engine.simulate.verdict.errors import SAFE
from hsdsl.interface.model.call_cache import CallCache, call_key
from hsdsl.mathematics.program import Program

if TYPE_CHECKING:
    from hsdsl.analysis.sensitivity.overrides import Overridden

FINEST = 1e-13  # the tolerance of methods of high order, to which it costs little
SERIES, FINE = "taylor", "dop853"  # these methods; the latter where `auto` is the method of kinked flows
REFUSED = ("step", "scheme")
LOCATED_ALONE = (*REFUSED, "samples", "precision")  # refused by what takes derivatives of many runs


class Differentiator:
    """Augmented systems of one model, and runs of them that are ready."""

    def __init__(self, pipeline: Pipeline) -> None:
        self.pipeline = pipeline
        self._augmented: dict[Any, Pipeline] = {}
        self._prepared: CallCache[_Ready] = CallCache(16)

    def sensitivity(
        self, wrt: str | Sequence[str], arguments: Mapping[str, Any], firsts: Sequence[str] = ()
    ) -> Sensitivity:
        """The sensitivities of a run of `Model.simulate` with these arguments.

        In ties an edge in ``firsts`` goes first.
        """
        wrt = listed(wrt)
        firsts = tuple(map(str, firsts))
        key = call_key(*wrt, None, *firsts, None, *arguments, None, *arguments.values())
        ready = self._prepared.find(key)
        if ready is not None:
            run = ready.setting.augmented.simulate()
        else:
            check_arguments(arguments, "a sensitivity", REFUSED)
            ready, run = self._run(self._ready(wrt, arguments, firsts))
        if not ready.entries and (run.stop.reason == "not_finite" or run.enters_beyond):
            ready, run = self._run(self._prepare(replace(ready, entries=True)))
        self._prepared.keep(key, ready)
        return Sensitivity(
            ready.labels, run, ready.setting, firsts, lambda first: self.sensitivity(wrt, arguments, first)
        )

    def of_run(self, arguments: Mapping[str, Any], wrt: str | Sequence[str]) -> Sensitivity:
        """The sensitivities of a run that was made with these arguments, of any scheme and with any steps."""
        kept = {name: value for name, value in arguments.items() if name not in ("step", "scheme", "outputs")}
        method = METHODS.get(str(kept.get("method")))
        if method is not None and not method.adaptive:
            del kept["method"]
        return self.sensitivity(wrt, kept)

    def _ready(self, wrt: Sequence[str], arguments: Mapping[str, Any], firsts: tuple[str, ...]) -> _Ready:
        from hsdsl.analysis.sensitivity.overrides import overridden, parameter_slopes, time_slopes

        call = located_arguments(self.pipeline, arguments)
        plain = self.pipeline.prepare(call)
        parameters = overrides_of(call, "parameters", self.pipeline.program)
        initial = start_of_parts(self.pipeline.program, overrides_of(call, "initial", self.pipeline.program))
        values = self.pipeline.values(arithmetic_of(call.get("precision")), parameters)
        states, parts = initial_layout(values, initial)[1], values.program.parts
        own = present(parts, {part.name: part.start + 1 for part in parts} | dict(initial))
        by = targets(wrt, self.pipeline.program, [name for name in states if not parts or name in own])
        given: dict[str, Any] = dict(call.get("settings") or {})
        experiment = {k: given.get(k) if call.get(k) is None else call[k] for k in ("until", "samples")}
        change = overridden(self.pipeline.system, parameters, initial, experiment)
        until, samples = time_slopes(change, by)
        times = [dict(zip((t.label for t in by), row, strict=True)) for row in _numbers([until, *samples], values)]
        rows = _numbers(list(parameter_slopes(change, by).values()), values)
        moving = {target.label: tuple(row[k] for row in rows) for k, target in enumerate(by)}
        shown, outputs = partial(visible_run, prepared=plain), self.pipeline.program.outputs
        setting = Setting(plain, plain, outputs, times[0], times[1:], moving, shown)
        return self._prepare(_Ready(by, change, call, setting, firsts, exact=arguments.get("tolerance") is not None))

    def _run(self, ready: _Ready) -> tuple[_Ready, Execution]:
        """Run the augmented system; by the method for stiff modes where it comes to a stiff stretch."""
        run, stiff = ready.setting.augmented.judged()
        if run is not None:
            return ready, run
        plain = ready.setting.plain.by_stiff_method(stiff)
        ready = self._prepare(replace(ready, setting=replace(ready.setting, plain=plain)))
        return ready, ready.setting.augmented.simulate()

    def _prepare(self, ready: _Ready) -> _Ready:
        """Prepare the run of the augmented system with the numbers and the method of the plain one."""
        settings, arithmetic = ready.setting.plain.settings, ready.setting.plain.arithmetic
        allowed = tolerance = settings.tolerance
        assert settings.method is not None and allowed is not None and tolerance is not None
        method = settings.method.name
        if method == FALLBACK and settings.method_chosen is not None and arithmetic.digits is None:
            method = FINE
        if method in (SERIES, FINE) and not ready.exact:
            tolerance = max(min(tolerance, FINEST), 4 * arithmetic.unit)
        numbers: dict[str, Number] = {
            UNIT: arithmetic.unit,
            SPAN: settings.until,
            ERROR: ROUNDOFF_UNITS * arithmetic.unit + SAFE * allowed,
        }
        initial = ready.change.initial
        modes = {part.name: part.modes for part in self.pipeline.program.parts if part.name in initial}
        given = {f"{name}.mode": own[int(initial[name]) - 1] for name, own in modes.items()}
        arguments = {
            "until": settings.until,
            "scheme": "located",
            "method": method,
            "tolerance": tolerance,
            "relaxation": settings.relaxation,
            "scale": dict(settings.scale),
            "max_transitions": settings.max_transitions,
            "completion": "none",  # derivatives end where the run leaves the theorem
            "parameters": ready.change.parameters | numbers,
            "initial": given | {name: value for name, value in initial.items() if name not in modes},
            "engine": ready.call.get("engine") or "auto",
            "precision": ready.call.get("precision"),
        }
        prepared = self._written(ready, method).prepare(arguments)
        judged = replace(prepared, judge=automatic.judge_of(prepared, ready.setting.plain))
        return replace(ready, setting=replace(ready.setting, augmented=judged))

    def _written(self, ready: _Ready, method: str) -> Pipeline:
        """The augmented system for runs by a method."""
        implicit = METHODS[method].implicit
        key = (ready.by, ready.entries, ready.firsts, implicit, ready.change.structure)
        if key not in self._augmented:
            from hsdsl.analysis.sensitivity.augment import augmented, preferring

            texts = (*(t.label for t in ready.by), str(ready.entries), str(implicit), *ready.firsts, repr(key[-1]))
            self._augmented[key] = self.pipeline.derived(
                ("derivatives", *texts),
                lambda: preferring(augmented(ready.change, ready.by, ready.entries, implicit), ready.firsts),
            )
        return self._augmented[key]


@dataclass(frozen=True)
class _Ready:
    """A sensitivity as far as the arguments of its call decide it; ``exact`` says that they give the tolerance."""

    by: tuple[Target, ...]
    change: Overridden
    call: dict[str, Any]
    setting: Setting
    firsts: tuple[str, ...]
    exact: bool
    entries: bool = False

    @cached_property
    def labels(self) -> tuple[str, ...]:
        """What it is by."""
        return tuple(t.label for t in self.by)


def start_by(
    wrt: str | Sequence[str] | None, arguments: Mapping[str, Any], values: Values
) -> tuple[tuple[Target, ...], dict[str, float]]:
    """What to vary, all initial states unless given, and the number of each in a run, by its label."""
    program = values.program
    _, states, x = initial_state(values, overrides_of(arguments, "initial", program))
    known = dict(zip(program.parameters, values.parameters, strict=True))
    known |= {f"{INITIAL}{name}": value for name, value in zip(states, x, strict=True)}
    by = targets([f"{INITIAL}{name}" for name in states] if wrt is None else wrt, program, states)
    return by, {target.label: float(known[target.label]) for target in by}


def varied(
    arguments: Mapping[str, Any], by: Sequence[Target], numbers: Mapping[str, float], program: Program
) -> dict[str, Any]:
    """The arguments of a run with these numbers for what varies, by labels."""
    groups = {group: overrides_of(arguments, group, program) for group in ("parameters", "initial")}
    for target in by:
        groups["initial" if target.initial else "parameters"][target.name] = numbers[target.label]
    return {**arguments, **groups}


def located_arguments(pipeline: Pipeline, arguments: Mapping[str, Any]) -> dict[str, Any]:
    """The arguments of a located run with a tolerance: what a file or `--set` says of steps is for other runs."""
    call = {name: value for name, value in arguments.items() if value is not None} | {"scheme": "located"}
    given: Mapping[str, Any] = arguments.get("settings") or {}
    settings = {name: value for name, value in given.items() if name not in ("step", "scheme")}
    call["settings"] = settings
    method = METHODS.get(str(call.get("method")))
    if method is not None and not method.adaptive:
        adaptive = ", ".join(name for name, each in METHODS.items() if each.adaptive)
        sentence = f"expected a method that keeps a tolerance, got '{method.name}' with fixed steps"
        raise UsageError(sentence, f"known here: auto, {adaptive}")
    if "tolerance" not in call and pipeline.resolve(settings, {"scheme": "located"}).size == "step":
        call["tolerance"] = DEFAULT_TOLERANCE
    return call


def _numbers(rows: Sequence[Sequence[Any]], values: Values) -> list[list[Number]]:
    """Expressions of parameters as numbers."""
    expressions = {f"slope_{i}_{k}": e for i, row in enumerate(rows) for k, e in enumerate(row)}
    if all(e.is_Integer for e in expressions.values()):
        numbers = {name: values.kernel.arithmetic.zero + int(e) for name, e in expressions.items()}
    else:
        numbers = values.evaluate(expressions)
    return [[numbers[f"slope_{i}_{k}"] for k in range(len(row))] for i, row in enumerate(rows)]
