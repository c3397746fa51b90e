"""Dependence of names on names: definitions that nothing uses, and states that influence nothing."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

from hsdsl.analysis.lint.source_expressions import SourceExpression
from hsdsl.base.graphs import closure
from hsdsl.language.schema.documents import ModelDocument
from hsdsl.language.system import HybridSystem

_DEFINING = ("parameter", "function", "input", "let")
_SETTINGS = ("until", "step", "tolerance", "relaxation", "max_transitions", "every")


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


@dataclass(frozen=True)
class Influence:
    """Names of states, parameters and sampled inputs, over all modes together.

    ``observed`` are in guards, conditions, walls, outputs and scenes. ``needed`` can change the value of such a name,
    or a setting of the experiment. ``read`` are in expressions other than a state's own flow and resets.
    """

    observed: frozenset[str]
    needed: frozenset[str]
    read: frozenset[str]


def influence(system: HybridSystem) -> Influence:
    """Trace influence backwards from what a run shows, by the symbols in the expressions of a system."""
    defining: dict[str, set[str]] = {}
    for name, expr in _definitions(system):
        defining.setdefault(name, set()).update(_names(expr))
    observed = {name for expr in _observed(system) for name in _names(expr)}
    read = observed | {name for own, names in defining.items() for name in names if name != own}
    settings = (name for expr in _settings(system) for name in _names(expr))
    needed = closure((*observed, *settings), lambda name: defining.get(name, ()))
    return Influence(frozenset(observed), frozenset(needed), frozenset(read))


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


def _settings(system: HybridSystem) -> list[Any]:
    samples = system.experiment.samples
    values = [getattr(system.experiment, name) for name in _SETTINGS]
    values += [size for _, size in system.experiment.scale]
    values += samples if isinstance(samples, tuple) else [samples]
    return [value for value in values if value is not None]
