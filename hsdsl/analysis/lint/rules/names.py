"""Rules about names: unused ones, modes that are not reachable, and names that mislead."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator

from hsdsl.analysis.lint.dependencies import Definition, observed_and_read
from hsdsl.analysis.lint.edits import without_entry
from hsdsl.analysis.lint.finding import Finding
from hsdsl.analysis.lint.subject import Subject
from hsdsl.base.names import listed
from hsdsl.language.expression.syntax import Name
from hsdsl.language.source import Key

_UNUSED = "remove it, or use it"
_SEPARATE = "give one of them another name"


def unused_name(kind: str) -> Callable[[Subject], Iterator[Finding]]:
    """Make the rule that finds unused parameters, functions or inputs."""

    def check(subject: Subject) -> Iterator[Finding]:
        for name in getattr(subject.document, f"{kind}s"):
            if Definition(kind, None, str(name)) in subject.unused:
                yield Finding(name.place.span, f"nothing uses the {kind} '{name}'", _UNUSED)

    return check


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
        pronoun, purpose = ("it", "a purpose") if one else ("them", "purposes")
        hint = f"remove {pronoun}, use {pronoun}, or give {pronoun} {purpose} under `outputs`, by another name"
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
            message = f"the output '{name}' is something else than '{name}' in the expressions of this file"
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
