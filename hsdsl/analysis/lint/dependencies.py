"""Dependence of names on names: definitions that nothing uses."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any, NamedTuple

from hsdsl.analysis.lint.source_expressions import SourceExpression
from hsdsl.base.graphs import closure
from hsdsl.language.schema import ModelDocument
from hsdsl.language.system import HybridSystem

_DEFINING = ("parameter", "function", "input", "let")


class Definition(NamedTuple):
    """The meaning of a name: a parameter, a function, an input, a state, or a `let` name of the model or of a mode."""

    kind: str
    mode: str | None
    name: str


class _Names:
    """The meaning of every name of a model."""

    def __init__(self, document: ModelDocument) -> None:
        states = dict.fromkeys(str(key) for mode in document.modes.values() for key in mode.flow or ())
        kinds: dict[str, Iterable[str]] = {"state": states, "input": document.inputs, "let": document.let}
        kinds |= {"parameter": document.parameters, "function": document.functions}
        self.top = {str(name): Definition(kind, None, str(name)) for kind, names in kinds.items() for name in names}
        self.own = {
            str(key): {str(name): Definition("let", str(key), str(name)) for name in mode.let}
            for key, mode in document.modes.items()
        }

    def used(self, expression: SourceExpression) -> Iterator[Definition]:
        """The definitions that an expression names."""
        everywhere = expression.role in ("output", "scene") and expression.mode is None  # every mode reads it
        inner = self.own.values() if everywhere else [self.own.get(expression.mode or "", {})]
        for name in expression.names:
            own = [table[name] for table in inner if name in table]
            if name in self.top and (everywhere or not own):
                own.append(self.top[name])
            yield from own


def unused(document: ModelDocument, expressions: Iterable[SourceExpression]) -> frozenset[Definition]:
    """The parameters, functions, inputs and `let` names that nothing depends on but, at most, other unused ones."""
    names = _Names(document)
    tables = (names.top, *names.own.values())
    uses: dict[Definition, set[Definition]] = {d: set() for t in tables for d in t.values() if d.kind in _DEFINING}
    roots: list[Definition] = []
    for expression in expressions:
        if expression.role in _DEFINING:
            uses[Definition(expression.role, expression.mode, str(expression.name))].update(names.used(expression))
        else:
            roots.extend(names.used(expression))
    return frozenset(uses) - closure(roots, lambda definition: uses.get(definition, ()))


def observed_and_read(system: HybridSystem) -> tuple[set[str], set[str]]:
    """The names that guards, conditions, walls, outputs and scenes use, over all modes together.

    Then those, and the names in expressions other than a state's own flow and resets.
    """
    observed = {name for expr in _observed(system) for name in _names(expr)}
    return observed, observed | {name for own, expr in _definitions(system) for name in _names(expr) if name != own}


def _names(expr: Any) -> Iterator[str]:
    """The names in an expression; none in a plain number."""
    return (symbol.name for symbol in getattr(expr, "free_symbols", ()))


def _observed(system: HybridSystem) -> Iterator[Any]:
    for mode in system.modes:
        yield from (surface.residual for surface in mode.walls)
        yield from (value for value in (*mode.outputs, *mode.scene) if value is not None)
        for edge in mode.edges:
            yield edge.surface.residual
            if edge.condition is not None:
                yield edge.condition


def _definitions(system: HybridSystem) -> Iterator[tuple[str, Any]]:
    """Names with the expressions that define them: flows, resets, initial values, parameters, samples of inputs."""
    for mode in system.modes:
        yield from zip(mode.states, mode.flow, strict=True)
        for edge in mode.edges:
            yield from edge.values.items()
    yield from system.initial.values
    yield from ((parameter.name, parameter.value) for parameter in system.parameters)
    for given in system.inputs:
        yield from ((given.name, value) for value in (*given.times, *given.values))
