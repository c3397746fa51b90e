# pyright: basic
"""What can influence what is seen of a model: its guards, conditions, walls and outputs."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from hsdsl.source import Key
from hsdsl.system import HybridSystem

if TYPE_CHECKING:
    from hsdsl.lint.subject import Subject


@dataclass(frozen=True)
class Influence:
    """Names of states, parameters and sampled inputs, over all modes together.

    Attributes
    ----------
    roots : frozenset of str
        What stands in a guard, condition, wall or output.
    needed : frozenset of str
        What can change the value of a root, or a setting of the experiment.
    read : frozenset of str
        What stands in an expression other than a state's own flow and resets.
    """

    roots: frozenset[str]
    needed: frozenset[str]
    read: frozenset[str]


def influence(system: HybridSystem) -> Influence:
    """What influences what, from the symbols in the expressions of a system."""
    defining: dict[str, set[str]] = {}
    for name, expr in _definitions(system):
        defining.setdefault(name, set()).update(_names(expr))
    roots = {name for expr in _seen(system) for name in _names(expr)}
    read = roots | {name for own, names in defining.items() for name in names if name != own}
    needed: set[str] = set()
    waiting = [*roots, *(name for expr in _settings(system) for name in _names(expr))]
    while waiting:
        name = waiting.pop()
        if name not in needed:
            needed.add(name)
            waiting.extend(defining.get(name, ()))
    return Influence(frozenset(roots), frozenset(needed), frozenset(read))


def first_places(subject: Subject) -> dict[str, Key]:
    """Every state with its first place in the file."""
    found: dict[str, Key] = {}
    for part in subject.modes:
        for key in part.document.flow or ():
            found.setdefault(str(key), key)
    return found


def _names(expr: Any) -> Iterator[str]:
    return (symbol.name for symbol in expr.free_symbols)


def _seen(system: HybridSystem) -> Iterator[Any]:
    for mode in system.modes:
        yield from (surface.residual for surface in mode.walls)
        yield from (output for output in mode.outputs if output is not None)
        for edge in mode.edges:
            yield edge.surface.residual
            if edge.condition is not None:
                yield edge.condition


def _definitions(system: HybridSystem) -> Iterator[tuple[str, Any]]:
    """What the value of a name is made of: the flows and resets of a state, the value of a parameter."""
    for mode in system.modes:
        yield from zip(mode.states, mode.flow, strict=True)
        for edge in mode.edges:
            yield from zip(edge.target_states, edge.reset, strict=True)
    yield from system.initial.values
    yield from ((parameter.name, parameter.value) for parameter in system.parameters)
    for given in system.inputs:
        yield from ((given.name, value) for value in (*given.times, *given.values) if hasattr(value, "free_symbols"))


def _settings(system: HybridSystem) -> Iterable[Any]:
    experiment = system.experiment
    values = [
        experiment.until,
        experiment.step,
        experiment.tolerance,
        experiment.relaxation,
        experiment.max_transitions,
    ]
    samples = experiment.samples
    values += [size for _, size in experiment.scale]
    values += samples if isinstance(samples, tuple) else [samples]
    return [value for value in values if value is not None]
