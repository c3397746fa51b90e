# pyright: basic
"""Rules about names, modes and transitions as written: unused, unreachable, without effect, repeated, shadowed."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from typing import Any

import sympy as sp

from hsdsl.analysis.lint.finding import Finding, without_entry
from hsdsl.analysis.lint.source_expressions import Definition, observed_and_read
from hsdsl.analysis.lint.subject import EdgePart, Subject
from hsdsl.base.names import listed
from hsdsl.language.expression.parse import Name
from hsdsl.language.expression.scope import symbol
from hsdsl.language.source import Key, Mapping, Node, Scalar, children, is_empty

_SECTIONS = ("parameters", "inputs", "let", "outputs", "units", "reference")
_SECTIONS_OF_A_MODE = ("let", "domain", "outputs", "transitions")

_SIGNS: dict[Any, tuple[str, str]] = {  # of left less right, where the comparison holds and where not
    sp.Gt: ("is_positive", "is_nonpositive"),
    sp.Ge: ("is_nonnegative", "is_negative"),
    sp.Lt: ("is_negative", "is_nonnegative"),
    sp.Le: ("is_nonpositive", "is_positive"),
    sp.Eq: ("is_zero", "is_nonzero"),
    sp.Ne: ("is_nonzero", "is_zero"),
}


def identity_reset(subject: Subject) -> Iterator[Finding]:
    """Find resets of a state to itself."""
    for part, edge in subject.edges:
        values = edge.edge.values
        for name in edge.document.reset:
            if values[name] == symbol(name) and name in part.mode.states:
                fix = without_entry(subject.node(*edge.path, "reset"), str(name))
                yield Finding(name.place.span, f"the state '{name}' keeps its value anyway", "leave it out", fix=fix)


def missing_reset(subject: Subject) -> Iterator[Finding]:
    """Find transitions to their own mode that change nothing."""
    for part, edge in subject.edges:
        if edge.edge.target == part.mode.name and edge.edge.reset == tuple(map(symbol, part.mode.states)):
            message = f"this transition leads back to '{part.key}' and changes nothing, so it fires again at once"
            yield Finding(edge.target_span, message, "write what it does under `reset`")


def dead_end(subject: Subject) -> Iterator[Finding]:
    """Find modes that transitions enter and none leaves."""
    entered = {edge.edge.target for _, edge in subject.edges}
    for part in subject.modes:
        if part.mode.name in entered and not part.mode.edges and not part.mode.final:
            message = f"the mode '{part.key}' is entered and never left"
            yield Finding(part.key.place.span, message, "write `final: true`, or the transition that leads out")


def duplicate_transition(subject: Subject) -> Iterator[Finding]:
    """Find transitions that repeat another one of their mode."""
    first: dict[Any, EdgePart] = {}
    for part, item in subject.edges:
        edge = item.edge
        kind = (part.mode.name, edge.surface.residual, edge.condition, edge.target, edge.reset)
        earlier = first.setdefault(kind, item)
        if earlier is not item:
            line = earlier.document.when.place.span.line
            message = f"this transition is the same as the one of line {line}"
            yield Finding(item.document.when.place.span, message, "remove it, or change it")


def shadowed_transition(subject: Subject) -> Iterator[Finding]:
    """Find transitions that an earlier one on the same surface shadows."""
    for part in subject.modes:
        winners: dict[Any, EdgePart] = {}
        for item in sorted(part.edges, key=lambda item: (-item.edge.priority, item.index)):
            residual, condition = item.edge.surface.residual, item.edge.condition
            winner = winners.get((residual, None)) or winners.get((residual, condition))
            if winner is None:
                winners[residual, condition] = item
            elif (winner.edge.target, winner.edge.reset) != (item.edge.target, item.edge.reset):
                message = f"this transition never fires: '{winner.edge.name}' goes first on the same surface"
                hint = "put the stricter one first, or give the other one a condition"
                yield Finding(item.document.when.place.span, message, hint)


def constant_condition(subject: Subject) -> Iterator[Finding]:
    """Find conditions that are always true or always false."""
    for _, item in subject.edges:
        scalar = item.document.condition
        truth = None if scalar is None else _constant_truth(item.edge.condition)
        if scalar is not None and truth is not None:
            hint = "remove it" if truth else "remove the transition, or write when it is to fire"
            yield Finding(scalar.place.span, f"this condition is always {str(truth).lower()}", hint)


def _constant_truth(condition: Any) -> bool | None:
    truths = {relation: _truth(relation) for relation in condition.atoms(sp.core.relational.Relational)}
    left = condition.xreplace({relation: sp.true if t else sp.false for relation, t in truths.items() if t is not None})
    return bool(left) if left in (sp.true, sp.false) else None


def _truth(relation: Any) -> bool | None:
    """The truth of a comparison, where the sign of the difference is the same everywhere."""
    difference: Any = sp.expand(relation.lhs - relation.rhs)
    truth, contrary = (getattr(difference, sign) for sign in _SIGNS[type(relation)])
    return truth if contrary is None else not contrary


def empty_section(subject: Subject) -> Iterator[Finding]:
    yield from _empty(subject.root, _SECTIONS)
    for part in subject.modes:
        yield from _empty(subject.node("modes", str(part.key)), _SECTIONS_OF_A_MODE)
        for edge in part.edges:
            yield from _empty(subject.node(*edge.path), ("reset",))


def _empty(mapping: Node | None, keys: tuple[str, ...]) -> Iterator[Finding]:
    for key, value in mapping if isinstance(mapping, Mapping) else ():
        if key in keys and (is_empty(value) or not (isinstance(value, Scalar) or any(children(value)))):
            fix = without_entry(mapping, str(key))
            yield Finding(key.place.span, f"`{key}` is empty", "leave it out", fix=fix)


def after_the_end(subject: Subject) -> Iterator[Finding]:
    for part in subject.modes:
        if part.mode.final:
            things = [(item.document.when, "transition never fires") for item in part.edges]
            things += [(scalar, "wall is never met") for scalar in part.document.domain]
            for scalar, never in things:
                message = f"this {never}: a run ends on entering '{part.key}'"
                yield Finding(scalar.place.span, message, "remove it, or `final: true`")


_UNUSED = "remove it, or use it"
_SEPARATE = "give one of them another name"


def unused_name(subject: Subject, kind: str) -> Iterator[Finding]:
    """Find unused parameters, functions or inputs."""
    for name in getattr(subject.document, f"{kind}s"):
        if Definition(kind, None, str(name)) in subject.unused:
            yield Finding(name.place.span, f"nothing uses the {kind} '{name}'", _UNUSED)


def unused_let(subject: Subject) -> Iterator[Finding]:
    """Find unused `let` names of the model and of its modes."""
    for name in subject.document.let:
        if Definition("let", None, str(name)) in subject.unused:
            fix = without_entry(subject.node("let"), str(name))
            yield Finding(name.place.span, f"nothing uses the `let` name '{name}'", _UNUSED, fix=fix)
    for part in subject.modes:
        for name in part.document.let:
            if Definition("let", str(part.key), str(name)) in subject.unused:
                message = f"nothing in the mode '{part.key}' uses its `let` name '{name}'"
                fix = without_entry(subject.node("modes", str(part.key), "let"), str(name))
                yield Finding(name.place.span, message, _UNUSED, fix=fix)


def unused_state(subject: Subject) -> Iterator[Finding]:
    """Find states that no expression uses but their own flow and resets."""
    observed, read = observed_and_read(subject.system)
    unused = [key for name, key in subject.states.items() if observed and name not in read]
    if unused:
        one = len(unused) == 1
        message = f"nothing depends on the state{'s' * (not one)} {listed(unused)}"
        pronoun, shown = ("it", "an output with another name") if one else ("them", "outputs with other names")
        hint = f"remove {pronoun}, use {pronoun}, or show {pronoun}: {shown}"
        yield Finding(unused[0].place.span, message, hint)


def shadowed_name(subject: Subject) -> Iterator[Finding]:
    """Find `let` names of modes that hide one of the model."""
    top = {str(name): name for name in subject.document.let}
    for part in subject.modes:
        for name in part.document.let:
            if name in top:
                line = top[str(name)].place.span.line
                message = f"'{name}' hides the `let` name of line {line} in the mode '{part.key}'"
                yield Finding(name.place.span, message, _SEPARATE)


def unreachable_mode(subject: Subject) -> Iterator[Finding]:
    """Find modes without a path of transitions from where runs start."""
    for part in subject.modes:
        if part.mode.name not in subject.reachable:
            message = f"no transition leads from the initial mode to the mode '{part.key}'"
            yield Finding(part.key.place.span, message, "let a transition lead to it, or remove it")


def misnamed_output(subject: Subject) -> Iterator[Finding]:
    """Find outputs that differ from the parameter, input or `let` name of the same name."""
    trees = {(e.mode, e.name): e.tree for e in subject.expressions if e.role == "output"}
    for mode, name, taken in _outputs(subject):
        tree = trees[mode, name]
        if name in taken and not (isinstance(tree, Name) and tree.name == name):
            message = f"the output '{name}' differs from '{name}' in the expressions of this file"
            yield Finding(name.place.span, message, _SEPARATE)


def _outputs(subject: Subject) -> Iterator[tuple[str | None, Key, Collection[str]]]:
    """Each output with its mode, and the names that have a meaning there."""
    document = subject.document
    shared = {*document.parameters, *document.inputs, *document.let}
    everywhere = shared.union(*(part.document.let for part in subject.modes))
    yield from ((None, name, everywhere) for name in document.outputs)
    for part in subject.modes:
        known = shared.union(part.document.let)
        yield from ((str(part.key), name, known) for name in part.document.outputs)
