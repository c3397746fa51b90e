"""What lint finds in a system of parts: names that nothing uses, and modes that no instance can be in.

Each automaton is looked at in the whole file. Rules on the mathematics of modes are those of `lint.automata`.
"""

from __future__ import annotations

import re
from collections import abc
from collections.abc import Iterator

from hsdsl.analysis.lint.finding import Finding
from hsdsl.analysis.lint.subject import Subject
from hsdsl.base.graphs import closure
from hsdsl.language.schema.documents import AutomatonDocument, SystemDocument
from hsdsl.language.source import Key, Mapping, Node, Scalar, Sequence, children

CODES = ("HS401", "HS402", "HS403", "HS406")
_WORD = re.compile(r"[^\W\d]\w*")
_UNUSED = "remove it, or use it"
_UNKNOWN = "some rules do not look at systems of parts, and some only at automata that use nothing of others"


def findings_of_parts(subject: Subject, codes: abc.Sequence[str]) -> Iterator[tuple[str, Finding]]:
    """The code of each finding, and the finding; a note says which rules did not look."""
    document = subject.document
    assert isinstance(document, SystemDocument)
    used = {word for text in _texts(subject.root) for word in _WORD.findall(text)}
    found = [*_unused(document, used, "")]
    for name, kind in document.automata.items():
        if isinstance(kind, AutomatonDocument):
            found += [*_unused(kind, used, f" of '{name}'"), *_unreachable(document, name, kind)]
    yield from ((code, finding) for code, finding in found if code in codes)
    if any(code not in CODES for code in codes):
        yield "HS492", Finding(subject.root.place.span, _UNKNOWN)


def _texts(node: Node) -> Iterator[str]:
    """All values of a file, and the keys that name states of other instances."""
    if isinstance(node, Scalar):
        yield node.value
    if not isinstance(node, Mapping):
        for inner in children(node):
            yield from _texts(inner)
        return
    for key, inner in node:
        if "." in key:
            yield str(key)
        if not (
            key == "inputs" and isinstance(inner, Sequence)
        ):  # a list of names says what there is, and uses nothing
            yield from _texts(inner)


def _unused(document: SystemDocument | AutomatonDocument, used: set[str], where: str) -> Iterator[tuple[str, Finding]]:
    """Names of a file or of an automaton that nothing uses."""
    inner = document.modes.values() if isinstance(document, AutomatonDocument) else ()
    lets = [*document.let, *(key for mode in inner for key in mode.let)]
    for code, kind, names in (
        ("HS401", "parameter", document.parameters),
        ("HS402", "input", document.inputs),
        ("HS403", "`let` name", lets),
    ):
        for name in dict.fromkeys(names):
            if name not in used:
                yield code, Finding(name.place.span, f"nothing uses the {kind} '{name}'{where}", _UNUSED)


def _unreachable(document: SystemDocument, name: Key, kind: AutomatonDocument) -> Iterator[tuple[str, Finding]]:
    """Modes that no instance starts in and no transition leads to."""
    instances = [one for one in document.system.values() if one.automaton.value == name]
    if not instances:
        yield "HS406", Finding(name.place.span, f"no instance is of the automaton '{name}'", _UNUSED)
        return
    starts = {one.initial.mode.value for one in instances if one.initial and one.initial.mode}
    first = {str(mode) for mode in kind.modes if str(mode) in starts or len(kind.modes) == 1}
    leads = {str(key): [made.target or str(key) for made in mode.transitions] for key, mode in kind.modes.items()}
    entered = closure(first, leads.__getitem__)
    for key in kind.modes:
        if key not in entered:
            message = f"no instance of '{name}' can be in the mode '{key}'"
            yield "HS406", Finding(key.place.span, message, _UNUSED)
