# pyright: basic, reportArgumentType=false
# pyright: basic, reportArgumentType=false, reportAttributeAccessIssue=false, reportOperatorIssue=false, reportReturnType=false
"""A system with the overrides of a run in it, as far as they change how one of its numbers depends on another."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import sympy as sp

from hsdsl.analysis.sensitivity.targets import Target
from hsdsl.base.errors import UsageError
from hsdsl.base.functions import replaced
from hsdsl.base.numbers.decimals import number_of
from hsdsl.language.elaborate import parameter_expression
from hsdsl.language.expression.scope import symbol
from hsdsl.language.system import HybridSystem, Initial, started
from hsdsl.mathematics.lower.straight import Gradient


class Overridden(NamedTuple):
    """A system with expressions of overrides in place; numbers are left to a run.

    ``parameters`` and ``initial`` are the overrides that a run still needs. A parameter in ``fixed`` and a state in
    ``placed`` has a number that depends on nothing.
    """

    system: HybridSystem
    parameters: dict[str, Any]
    initial: dict[str, Any]
    fixed: frozenset[str]
    placed: frozenset[str]

    @property
    def structure(self) -> tuple[Any, ...]:
        """What derivatives depend on besides the file."""
        derived = {p.name for p in self.system.parameters if p.value.free_symbols}
        values = tuple(p.value for p in self.system.parameters)
        return (
            tuple(sorted(self.fixed & derived)),
            tuple(sorted(self.placed)),
            values,
            self.system.initial,
            self.system.experiment,
        )


def is_expression(value: Any) -> bool:
    """Whether a value of an override is a text that may name parameters."""
    return isinstance(value, str) and number_of(value) is None


def overridden(
    system: HybridSystem, parameters: Mapping[str, Any], initial: Mapping[str, Any], experiment: Mapping[str, Any]
) -> Overridden:
    """Put overrides into a system; they are known to be good.

    ``experiment`` may have ``until`` and ``samples`` as they are given, None where the file's count.
    """
    names = [p.name for p in system.parameters]

    def read(value: Any, where: str, known: int) -> sp.Expr:
        return sp.sympify(parameter_expression(system, value, where, allowed=names[:known]))

    texts = {
        name: read(v, f"parameter {name}", names.index(name)) for name, v in parameters.items() if is_expression(v)
    }
    changed = tuple(replace(p, value=texts.get(p.name, p.value)) for p in system.parameters)
    start, placed = _start(system, initial, lambda v, where: read(v, where, len(names)))
    until, samples = experiment.get("until"), experiment.get("samples")
    if until is not None:
        until = read(until, "until", len(names)) if is_expression(until) else sp.S.Zero
        system = replace(system, experiment=replace(system.experiment, until=until))
    if samples is not None:
        own = replace(system.experiment, samples=_samples(samples, read, len(names)), every=None)
        system = replace(system, experiment=own)
    return Overridden(
        replace(system, parameters=changed, initial=start),
        {name: v for name, v in parameters.items() if name not in texts},
        {name: v for name, v in initial.items() if not is_expression(v)},
        frozenset(parameters.keys() - texts.keys()),
        placed,
    )


def _samples(given: Any, read: Any, known: int) -> Any:
    if isinstance(given, str) or not hasattr(given, "__iter__"):
        return sp.sympify(int(given))  # the times are shares of the run
    return tuple(read(t, "samples", known) if is_expression(t) else sp.S.Zero for t in given)


def _start(system: HybridSystem, initial: Mapping[str, Any], read: Any) -> tuple[Initial, frozenset[str]]:
    """Where a run starts; a state whose value is a number has 0 there, and is named."""
    mode = str(initial.get("mode", system.initial.mode))
    values: dict[str, Any] = dict(system.initial.in_order)
    placed = {name for name, value in initial.items() if name != "mode" and not is_expression(value)}
    for name, value in initial.items():
        if name != "mode":
            values[name] = sp.S.Zero if name in placed else read(value, f"initial.{name}")
    own = next(m for m in system.modes if m.name == mode).states or tuple(name for name, _ in system.initial.values)
    return started(mode, own, tuple(values.items())), frozenset(placed)


def parameter_slopes(given: Overridden, by: Sequence[Target]) -> dict[sp.Symbol, list[sp.Expr]]:
    """The derivatives of every parameter by each target, which replaces the expression of a derived one."""
    found: dict[sp.Symbol, list[sp.Expr]] = {}
    for parameter in given.system.parameters:
        moves = parameter.name not in given.fixed
        derived = through(parameter.value, found, len(by)) if moves else [sp.S.Zero] * len(by)
        itself = [t.name == parameter.name and not t.initial for t in by]
        found[symbol(parameter.name)] = [sp.S.One if own else slope for own, slope in zip(itself, derived, strict=True)]
    return found


def through(expression: sp.Expr, known: Mapping[sp.Symbol, list[sp.Expr]], count: int) -> list[sp.Expr]:
    """The derivatives of an expression of parameters by the targets."""
    (row,) = slopes([expression], list(known))
    return [sp.Add(*(slope * known[p][k] for p, slope in row.items())) for k in range(count)]


def time_slopes(given: Overridden, by: Sequence[Target]) -> tuple[list[sp.Expr], list[list[sp.Expr]]]:
    """The derivatives of ``until`` and of each sample time by the targets."""
    known, experiment = parameter_slopes(given, by), given.system.experiment
    until = through(experiment.until, known, len(by))
    if isinstance(experiment.samples, tuple):
        return until, [through(sp.sympify(t), known, len(by)) for t in experiment.samples]
    if experiment.every is not None and any(through(experiment.every, known, len(by))):
        names = ", ".join(target.name for target in by)
        raise UsageError(f"the time between the file's samples may not depend on {names}", "give samples as a number")
    if experiment.samples is None or not experiment.samples.is_Integer or not any(until):
        return until, []
    last = max(1, int(experiment.samples) - 1)
    return until, [[sp.Rational(i, last) * slope for slope in until] for i in range(last + 1)]


Slopes = dict[sp.Symbol, sp.Expr]


def slopes(expressions: Iterable[sp.Expr], arguments: Sequence[sp.Symbol]) -> list[Slopes]:
    """The derivatives of each expression by those arguments where they are not zero."""
    found = Gradient([sp.sympify(e) for e in expressions], arguments, letter="slope ", whole=True)
    meaning: dict[sp.Basic, sp.Basic] = {}
    done: dict[sp.Basic, sp.Basic] = {}
    for name, expr in found.statements:
        meaning[name] = replaced(expr, meaning, done)
    return [{a: replaced(slope, meaning, done) for a, slope in row.items()} for row in found.sparse]
