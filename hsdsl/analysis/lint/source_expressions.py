"""The expressions of a model as written: their roles, trees, places, and the names that they depend on."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import chain
from typing import Any, Literal, NamedTuple

from hsdsl.base.errors import Span
from hsdsl.base.graphs import closure
from hsdsl.language.expression import Expected, parse
from hsdsl.language.expression.parse import Name, Tree, walk
from hsdsl.language.expression.scope import functions_called
from hsdsl.language.schema.documents import (
    AutomatonDocument,
    ExperimentDocument,
    InputFile,
    InputSamples,
    InstanceDocument,
    ModeDocument,
    ModelDocument,
    MultiplesDocument,
    ParameterEntry,
    RangeDocument,
    ReferenceDocument,
    SolveDocument,
    SystemDocument,
)
from hsdsl.language.source import Key, Scalar
from hsdsl.language.system import HybridSystem

Role = Literal[
    "parameter",  # the value, or a bound, of the parameter `name`
    "function",  # the function `name`, over its arguments
    "input",  # the input `name`, or one of its samples
    "let",  # the named subexpression `name`, of `mode` or of the whole model
    "equation",  # an equation of `solve`, of `mode` or of the whole model
    "flow",  # the derivative of the state `name` in `mode`
    "domain",  # a wall of `mode`
    "when",  # the surface of a transition
    "event",  # the condition of an event
    "delay",  # its delay
    "priority",  # its priority
    "if",  # its condition
    "reset",  # its new value of the state `name`
    "output",  # the output `name`, of `mode` or of the whole model
    "scene",  # a number of a shape
    "initial",  # the initial value of the state `name`
    "scale",  # the size of the state `name`
    "experiment",  # the setting `name`
    "reference",  # a number in `reference`: of the state, output or setting `name`, if of any
]
TIME = "t"
_WANTED: dict[Role, Expected] = {
    "domain": "inequality",
    "when": "inequality",
    "if": "condition",
    "event": "condition",
    "equation": "condition",
}


@dataclass(frozen=True)
class SourceExpression:
    """One expression of a file: what it is for, its text and place, and the mode it belongs to, if any.

    ``name`` is what it defines; empty for walls, surfaces and conditions. ``index`` says of `domain`, `when`, `event`,
    `if` and `reset` which wall or which transition of the mode it is. ``arguments`` are those of a function.
    ``unit_of`` is the name whose unit it has, where that is not its own.
    """

    role: Role
    scalar: Scalar
    name: str = ""
    mode: str | None = None
    index: int = -1
    arguments: tuple[str, ...] = ()
    unit_of: str | None = None

    @cached_property
    def tree(self) -> Tree:
        """The expression, every node of it with its range of characters."""
        text = self.scalar.value.lower() if self.scalar.kind == "boolean" else self.scalar.value
        return parse(text, _WANTED.get(self.role, "number"))

    @cached_property
    def names(self) -> frozenset[str]:
        """Every name in it, and every function that it calls; arguments aside."""
        named = (node.name for node in walk(self.tree) if isinstance(node, Name))
        return frozenset((*named, *functions_called(self.tree))) - frozenset(self.arguments)

    def span(self, node: Tree | None = None) -> Span:
        """The place of the expression, or of one node of its tree."""
        if node is None:
            return self.scalar.place.span
        return self.scalar.span(node.start, node.end)


def written(document: ModelDocument) -> Iterator[SourceExpression]:
    """Every expression of a model, in the order of the language's sections."""
    yield from _of_parameters(document)
    for name, function in document.functions.items():
        yield SourceExpression("function", function.expression, name, arguments=tuple(map(str, function.of)))
    for name, entry in document.inputs.items():
        if isinstance(entry, InputSamples):
            yield from _each("input", entry.times, name, TIME)
            yield from _each("input", entry.values, name)
        elif not isinstance(entry, InputFile):
            yield SourceExpression("input", entry, name)
    for name, scalar in document.let.items():
        yield SourceExpression("let", scalar, name)
    yield from _of_solve(document.solve, None)
    for name, mode in document.modes.items():
        yield from _of_mode(str(name), mode)
    for name, scalar in document.outputs.items():
        yield SourceExpression("output", scalar, name)
    for shape in document.scene:
        yield from _each("scene", (*chain.from_iterable(shape.points), *shape.sizes), "")
    start = document.initial  # None in a system of parts
    for name, given in (start.__pydantic_extra__ if start else {}).items():  # pyright: ignore[reportUnnecessaryComparison]
        yield from _each("initial", (given.min, given.max) if isinstance(given, RangeDocument) else (given,), name)
    for name, part in document.system.items() if isinstance(document, SystemDocument) else ():
        yield from _of_instance(name, part)
    yield from _of_experiment(document.experiment)
    for reference in document.reference:
        yield from _of_reference(reference)


def written_of_automaton(automaton: AutomatonDocument) -> Iterator[SourceExpression]:
    """Every expression of an automaton."""
    yield from _of_parameters(automaton)
    for name, scalar in automaton.let.items():
        yield SourceExpression("let", scalar, name)
    for name, mode in automaton.modes.items():
        yield from _of_mode(str(name), mode)
    for name, scalar in automaton.outputs.items():
        yield SourceExpression("output", scalar, name)


def _of_parameters(document: ModelDocument | AutomatonDocument) -> Iterator[SourceExpression]:
    for name, entry in document.parameters.items():
        values = (entry.value, entry.min, entry.max) if isinstance(entry, ParameterEntry) else (entry,)
        yield from _each("parameter", values, name)


def _of_instance(name: str, part: InstanceDocument) -> Iterator[SourceExpression]:
    tables: tuple[tuple[Role, Mapping[Key, Scalar]], ...] = (
        ("parameter", part.parameters),
        ("input", part.inputs),
        ("initial", part.initial.__pydantic_extra__ if part.initial else {}),
    )
    for role, given in tables:
        for key, scalar in given.items():
            yield SourceExpression(role, scalar, f"{name}.{key}")


def _of_experiment(experiment: ExperimentDocument) -> Iterator[SourceExpression]:
    for name in ("until", "step"):
        yield from _each("experiment", (getattr(experiment, name),), name, TIME)
    for name in ("tolerance", "relaxation", "max_transitions"):
        yield from _each("experiment", (getattr(experiment, name),), name)
    for name, scalar in experiment.scale.items():
        yield SourceExpression("scale", scalar, name)
    samples = experiment.samples
    if isinstance(samples, list):
        yield from _each("experiment", samples, "samples", TIME)
    elif isinstance(samples, MultiplesDocument):
        yield from _each("experiment", (samples.every,), "every", TIME)
    else:
        yield from _each("experiment", (samples,), "samples")


def _each(
    role: Role, scalars: Iterable[Scalar | None], name: str, unit_of: str | None = None
) -> Iterator[SourceExpression]:
    return (SourceExpression(role, scalar, name, unit_of=unit_of) for scalar in scalars if scalar is not None)


def _of_mode(name: str, mode: ModeDocument) -> Iterator[SourceExpression]:
    for key, scalar in mode.let.items():
        yield SourceExpression("let", scalar, key, name)
    yield from _of_solve(mode.solve, name)
    for key, scalar in (mode.flow or {}).items():
        yield SourceExpression("flow", scalar, key, name)
    for index, scalar in enumerate(mode.domain):
        yield SourceExpression("domain", scalar, "", name, index)
    for index, transition in enumerate(mode.transitions):
        surface = transition.when if transition.event is None else None  # none where it listens to another one
        conditions: tuple[tuple[Role, Scalar | None], ...] = (("when", surface), ("event", transition.event))
        for role, scalar in conditions:
            if scalar is not None:
                yield SourceExpression(role, scalar, "", name, index)
        if transition.delay is not None:
            yield SourceExpression("delay", transition.delay, "", name, index, unit_of=TIME)
        if isinstance(transition.priority, Scalar):
            yield SourceExpression("priority", transition.priority, "", name, index)
        if transition.condition is not None:
            yield SourceExpression("if", transition.condition, "", name, index)
        for key, scalar in transition.reset.items():
            yield SourceExpression("reset", scalar, key, name, index)
    for key, scalar in mode.outputs.items():
        yield SourceExpression("output", scalar, key, name)


def _of_solve(solve: SolveDocument | None, mode: str | None) -> Iterator[SourceExpression]:
    equations = solve.equations if solve is not None else ()
    yield from (SourceExpression("equation", scalar, "", mode, index) for index, scalar in enumerate(equations))


def _of_reference(reference: ReferenceDocument) -> Iterator[SourceExpression]:
    words = ("initial.mode", "experiment.scheme", "experiment.method")
    settings = {key: scalar for key, scalar in reference.settings.items() if key not in words}
    yield from _of_states(settings)
    yield from _each("reference", (reference.trust,), "")
    for event in reference.transitions:
        yield from _each("reference", (event if isinstance(event, Scalar) else event.time,), "", TIME)
        if not isinstance(event, Scalar):
            yield from _of_states(event.before)
            yield from _of_states(event.after)
    for state in reference.states:
        yield from _each("reference", (state.time,), "", TIME)
        yield from _of_states(state.__pydantic_extra__)


def _of_states(values: Mapping[Key, Scalar]) -> Iterator[SourceExpression]:
    return (SourceExpression("reference", value, str(key).removeprefix("initial.")) for key, value in values.items())


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
