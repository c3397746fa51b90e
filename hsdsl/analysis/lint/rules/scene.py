"""Rules about what a scene does not need: idle states and parameters, repeated modes, walls and settings."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from hsdsl.analysis.lint.dependencies import Definition
from hsdsl.analysis.lint.edits import without_entry, without_item
from hsdsl.analysis.lint.finding import Finding
from hsdsl.analysis.lint.subject import Subject
from hsdsl.base.defaults import DEFAULT_TOLERANCE, DEFAULTS
from hsdsl.language.expression.scope import symbol
from hsdsl.language.source import Mapping, Node
from hsdsl.language.system import Mode

_NUMBERS = {key: DEFAULTS[key] for key in ("relaxation", "max_transitions")} | {"tolerance": DEFAULT_TOLERANCE}


def idle_state(subject: Subject) -> Iterator[Finding]:
    """Find states that are used and influence nothing."""
    influence = subject.influence
    for name, key in subject.states.items() if influence.observed else ():
        if name in influence.read and name not in influence.needed:
            message = f"the state '{name}' influences no guard, condition, wall or output"
            yield Finding(key.place.span, message, "remove it, or give it a purpose under `outputs`, by another name")


def idle_parameter(subject: Subject) -> Iterator[Finding]:
    """Find parameters that are used and influence nothing."""
    influence = subject.influence
    if not influence.observed:
        return
    in_references = {name for e in subject.expressions if e.role == "reference" for name in e.names}
    for name in subject.document.parameters:
        unused = Definition("parameter", None, str(name)) in subject.unused
        if not unused and str(name) not in influence.needed | in_references:
            message = f"the parameter '{name}' influences no guard, condition, wall or output"
            yield Finding(name.place.span, message, "remove it with the states it is for, or show them under `outputs`")


def constant_state(subject: Subject) -> Iterator[Finding]:
    """Find states that no flow and no reset changes."""
    changing: set[Any] = set()
    for mode in subject.system.modes:
        changing.update(state for state, rate in mode.vector_field.items() if rate != 0)
        changing.update(state for edge in mode.edges for state in edge.changes)
    for name, key in subject.states.items():
        if symbol(name) not in changing:
            yield Finding(key.place.span, f"the state '{name}' never changes", "make it a parameter")


def twin_modes(subject: Subject) -> Iterator[Finding]:
    """Find modes that behave like another one."""
    first: dict[Any, str] = {}
    for part in subject.modes:
        if not part.mode.final and part.mode.states:
            twin = first.setdefault(_behaviour(part.mode), part.mode.name)
            if twin != part.mode.name:
                message = f"the mode '{part.key}' does the same as '{twin}'"
                yield Finding(part.key.place.span, message, f"let its transitions lead to '{twin}', and remove it")


def _behaviour(mode: Mode) -> Any:
    edges = tuple(
        (e.surface.residual, e.condition, None if e.target == mode.name else e.target, e.reset, e.priority)
        for e in mode.edges
    )
    return (mode.states, mode.flow, tuple(wall.residual for wall in mode.walls), edges, mode.outputs, mode.scene)


def repeated_default(subject: Subject) -> Iterator[Finding]:
    """Find settings with the value that they have by default."""
    for name, entry in subject.document.inputs.items():
        if getattr(entry, "hold", None) == "zero":
            yield from _repeated(subject.node("inputs", str(name)), "hold")
    for part in subject.modes:
        if not part.mode.final:
            yield from _repeated(subject.node("modes", str(part.key)), "final")
        for item in part.edges:
            if item.edge.priority == 0:
                yield from _repeated(subject.node(*item.path), "priority")
    experiment = subject.system.experiment
    for key, default in _NUMBERS.items():
        value = getattr(experiment, key)
        if key == "relaxation" and not subject.setting("until") >= 1:  # then the default is smaller
            continue
        if value is not None and value.is_Rational and value.p * default.denominator == value.q * default.numerator:
            yield from _repeated(subject.node("experiment"), key)
    if experiment.method == DEFAULTS["method"]:
        yield from _repeated(subject.node("experiment"), "method")


def _repeated(mapping: Node | None, name: str) -> Iterator[Finding]:
    if isinstance(mapping, Mapping) and name in mapping.entries:
        key, _ = mapping.entries[name]
        yield Finding(key.place.span, f"`{name}` is this anyway", "leave it out", fix=without_entry(mapping, name))


def repeated_wall(subject: Subject) -> Iterator[Finding]:
    """Find walls on the surface of a transition without `if`."""
    for part in subject.modes:
        guards = {edge.surface.residual: edge.name for edge in part.mode.edges if edge.condition is None}
        for index, wall in enumerate(part.mode.walls):
            if wall.residual in guards:
                message = f"the guard of '{guards[wall.residual]}' bounds the domain here already"
                fix = without_item(subject.node("modes", str(part.key), "domain"), index)
                yield Finding(part.document.domain[index].place.span, message, "leave the wall out", fix=fix)


def after_the_end(subject: Subject) -> Iterator[Finding]:
    """Find transitions and walls of final modes."""
    for part in subject.modes:
        if part.mode.final:
            things = [(item.document.when, "transition never fires") for item in part.edges]
            things += [(scalar, "wall is never met") for scalar in part.document.domain]
            for scalar, never in things:
                message = f"this {never}: a run ends on entering '{part.key}'"
                yield Finding(scalar.place.span, message, "remove it, or `final: true`")
