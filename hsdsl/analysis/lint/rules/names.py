"""Rules about names: unused ones, modes that are not reachable, and names that mislead."""

from __future__ import annotations

import unicodedata
from collections.abc import Callable, Collection, Iterator

from hsdsl.analysis.lint.dependencies import Definition
from hsdsl.analysis.lint.edits import without_entry
from hsdsl.analysis.lint.finding import Finding
from hsdsl.analysis.lint.subject import Subject
from hsdsl.base.names import in_latin, listed
from hsdsl.language.expression.parse import Name
from hsdsl.language.expression.scope import RESERVED
from hsdsl.language.source import Key

_UNUSED = "remove it, or use it"
_RENAME = "call it something else"
_SEPARATE = "give one of them another name"
_ELSEWHERE = {  # names of functions and constants in other languages
    "ln": "the logarithm",
    "arcsin": "the inverse sine",
    "arccos": "the inverse cosine",
    "arctan": "the inverse tangent",
    "sgn": "the sign",
    "pow": "a power",
    "inf": "infinity",
    "nan": "a missing number",
    "π": "pi",
}


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
    influence = subject.influence
    unused = [key for name, key in subject.states.items() if influence.observed and name not in influence.read]
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


def confusable_names(subject: Subject) -> Iterator[Finding]:
    """Find names that look alike, once for all that are taken for the same one."""
    alike: dict[str, dict[str, Key]] = {}
    for name in _names(subject):
        alike.setdefault(_appearance(name), {}).setdefault(str(name), name)
    for first, *others in (list(names.values()) for names in alike.values() if len(names) > 1):
        taken = "is easily" if len(others) == 1 else "are easily"
        names = f"the name{'s' * (len(others) > 1)} {listed(others)}"
        yield Finding(others[0].place.span, f"{names} {taken} taken for '{first}'", _RENAME)


def _appearance(name: str) -> str:
    """Reduce a name to its letters, alike ones as one; single letters keep their case."""
    latin = in_latin(unicodedata.normalize("NFKC", name))
    return latin if len(latin) == 1 else latin.replace("_", "").casefold()


def misleading_name(subject: Subject) -> Iterator[Finding]:
    """Find names that look like a function or a constant."""
    for name in _names(subject):
        lowered = name.lower()
        if len(name) > 1 and lowered in RESERVED:
            yield Finding(name.place.span, f"'{name}' looks like `{lowered}` of the language", _RENAME)
        elif lowered in _ELSEWHERE:
            yield Finding(name.place.span, f"'{name}' looks like {_ELSEWHERE[lowered]}", _RENAME)


def _names(subject: Subject) -> Iterator[Key]:
    document = subject.document
    yield from (*document.parameters, *document.inputs, *document.let, *document.outputs)
    for part in subject.modes:
        yield from (*(part.document.flow or ()), *part.document.let, *part.document.outputs)


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
