"""Places in a file of SBML for faults in the model that it became."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace

from hsdsl.base.errors import Diagnostic, ModelError
from hsdsl.language.source.xml import Element

_KEY = re.compile(r"( *(?:- )?)\"?([A-Za-z_]\w*)\"?:(?: ([A-Za-z_]\w*)$)?")
_STARTS = "initialAssignment"
_FIRST = {
    "let": "assignmentRule",
    "outputs": "assignmentRule",
    "flow": "rateRule",
    "initial": _STARTS,
    "parameters": _STARTS,
}


def placed(error: ModelError, text: str, root: Element) -> ModelError:
    """The error with the elements that its lines in a model's text come from."""
    elements = list(_within(root))
    return ModelError([_placed(diagnostic, text.splitlines(), elements) for diagnostic in error.diagnostics])


def _placed(diagnostic: Diagnostic, lines: list[str], elements: list[Element]) -> Diagnostic:
    keys = [] if diagnostic.span is None else list(_above(lines, diagnostic.span.line - 1))
    names = [name for name in keys for name in (name, name.rstrip("_"), name.removeprefix("amount_of_"))]
    sections = [_FIRST[key] for key in keys if key in _FIRST]
    for name in names:
        own = [one for one in elements if name in map(one.attributes.get, ("id", "variable", "symbol"))]
        own.sort(key=lambda one: (one.tag not in sections, "id" not in one.attributes))
        if own:
            place = own[0].fault(diagnostic.code, f"{name}: {diagnostic.message}", diagnostic.hint)
            return replace(diagnostic, message=place.message, span=place.span, text=place.text, fix=())
    place = elements[0].fault(diagnostic.code, diagnostic.message)
    return replace(diagnostic, span=place.span, text=place.text, fix=())


def _above(lines: list[str], at: int) -> Iterator[str]:
    """The keys that a line is under, the innermost first; of an item of a list, its name."""
    depth = 10**6
    for line in reversed(lines[: at + 1]):
        found = _KEY.match(line)
        if not found:
            continue
        if found[2] == "name" and found[3] and len(found[1]) <= depth:
            yield found[3]
        if len(found[1]) < depth:
            depth = len(found[1])
            yield found[2]


def _within(element: Element) -> Iterator[Element]:
    yield element
    for child in element.children:
        yield from _within(child)
