"""The expressions of a model as they are written: what each is for, its tree, and the place of every part of it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import chain
from typing import Literal

from hsdsl.base.errors import Span
from hsdsl.language.expression import Expected, parse
from hsdsl.language.expression.parse import Name, Tree, walk
from hsdsl.language.expression.scope import functions_called
from hsdsl.language.schema.documents import (
    AutomatonDocument,
    ExperimentDocument,
    InitialDocument,
    InputFile,
    InputSamples,
    InstanceDocument,
    ModeDocument,
    ModelDocument,
    MultiplesDocument,
    ParameterEntry,
    PartInitialDocument,
    ReferenceDocument,
    SolveDocument,
    SystemDocument,
)
from hsdsl.language.source import Key, Scalar

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
    for name, scalar in _starts(document.initial).items():
        yield SourceExpression("initial", scalar, name)
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
        ("initial", _starts(part.initial)),
    )
    for role, given in tables:
        for key, scalar in given.items():
            yield SourceExpression(role, scalar, f"{name}.{key}")


def _starts(initial: InitialDocument | PartInitialDocument | None) -> Mapping[Key, Scalar]:
    return {} if initial is None else initial.__pydantic_extra__


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
