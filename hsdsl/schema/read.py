"""Nodes to documents. What pydantic finds wrong is said in our words, at the place in the file."""

from __future__ import annotations

import re
from typing import Any

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from hsdsl.errors import Diagnostic, Findings, Span
from hsdsl.names import shown
from hsdsl.schema.documents import SHAPES, ModelDocument
from hsdsl.schema.fields import described
from hsdsl.schema.forms import assigned, undifferentiated
from hsdsl.schema.habits import reread
from hsdsl.schema.indents import reindent
from hsdsl.schema.misspelt import respell
from hsdsl.schema.recovery import descend, repair
from hsdsl.schema.suggestions import Location, advice, key_meant, moves_to, to_add, torn
from hsdsl.source import Mapping, Node, Scalar, Sequence, SourceRange

_MOST_REPAIRS = 8
_TAG = re.compile(r"<(?:expression|mapping|list|samples|file)>|function-\w+\[.*")  # of a union; no key in the file
_PLACE: dict[tuple[str, ...], str] = {
    (): "a model",
    ("parameters", "*"): "a parameter",
    ("inputs", "*"): "an input",
    ("modes", "*"): "a mode",
    ("modes", "*", "transitions", "*"): "a transition",
    ("initial",): "`initial`",
    ("experiment",): "`experiment`",
    ("reference", "*"): "a reference",
    ("reference", "*", "transitions", "*"): "a transition of a reference",
    ("reference", "*", "states", "*"): "a state of a reference",
}


def read(root: Node, findings: Findings) -> ModelDocument:
    """The document that a YAML file holds.

    Faults go to ``findings``. What is beside the point of a fault is still read: a misspelt key is taken for the one
    meant, a wrong value for one that nothing more is to be said about.

    Raises
    ------
    ModelError
        When too little is left to be called a model.
    """
    reindent(root, findings)
    reread(root, findings)
    respell(root, findings)
    for _ in range(_MOST_REPAIRS):
        try:
            return ModelDocument.model_validate(_plain(root))
        except ValidationError as error:
            details = _first(error.errors(include_url=False))
        meant = [_meant(root, fault) for fault in details]
        taken = [_taken_for(root, fault, key) for fault, key in zip(details, meant, strict=True)]
        filled = set(taken)
        for fault in details:
            if not (fault["type"] == "missing" and (fault["loc"] in filled or _said(root, fault))):
                findings.add(_diagnostic(root, fault))
        faults = reversed(list(zip(details, meant, taken, strict=True)))
        repaired = [
            repair(root, _names(fault["loc"]), fault["type"], key, place if key is None else ())
            for fault, key, place in faults
        ]
        if not all(repaired):
            break
    findings.raise_if_any()
    raise AssertionError


def _first(details: list[ErrorDetails]) -> list[ErrorDetails]:
    """The faults without those of values whose key is at fault: ``{v = 1}`` lacks no value."""
    keys = {_names(fault["loc"][:-1]) for fault in details if fault["loc"][-1:] == ("[key]",)}
    return [fault for fault in details if fault["type"] != "HS121" or _names(fault["loc"]) not in keys]


def _plain(node: Node) -> Any:
    if isinstance(node, Mapping):
        return {key: _plain(value) for key, value in node}
    if isinstance(node, Sequence):
        return [_plain(item) for item in node.items]
    return node


def _diagnostic(root: Node, details: ErrorDetails) -> Diagnostic:
    location = details["loc"]
    match details["type"]:
        case "extra_forbidden":
            return _unknown(root, location)
        case "missing":
            return _missing(root, location)
        case code if code.startswith("HS"):
            context = details.get("ctx", {})
            place = _find(root, location)
            if not location:
                hint = "a model begins with hsdsl: 1; is this file one?"
                return place.diagnostic(code, f"a model is wanted here, not {described(_plain(root))}", hint)
            message, hint, last = context["message"], context.get("hint"), _names(location)[-1]
            if code == "HS121" and isinstance(last, str):
                message, hint = f"'{shown(last)}' has no value", f"write {shown(last)}: and {hint}"
            return place.diagnostic(code, message, hint)
        case _:
            return _find(root, location).diagnostic("HS204", "this value is not possible here")


def _fields(location: Location) -> list[str]:
    shape = SHAPES[_pattern(location[:-1])]
    return [field.alias or name for name, field in shape.model_fields.items()]


def _meant(root: Node, fault: ErrorDetails) -> str | None:
    """The key that an unknown one was probably meant to be."""
    location = fault["loc"]
    if fault["type"] == "HS205" and location[-1] == "[key]":
        key = str(location[-2])
        equation = assigned(key)
        return equation[0] if equation else undifferentiated(key)
    if fault["type"] != "extra_forbidden":
        return None
    parent = descend(root, _names(location[:-1]))
    return key_meant(str(location[-1]), _fields(location), parent)


def _taken_for(root: Node, fault: ErrorDetails, meant: str | None) -> Location:
    """Where a fault's key is taken to stand: under another name, or in another place."""
    location = fault["loc"]
    if fault["type"] != "extra_forbidden" or meant is not None:
        return (*location[:-1], meant or "")
    return moves_to(root, str(location[-1]), descend(root, _names(location))) or ()


def _said(root: Node, fault: ErrorDetails) -> bool:
    """Whether a missing key is said already: a dash too many makes two transitions of one."""
    match fault["loc"]:
        case ("modes", mode, "transitions", int(index), key) if fault["type"] == "missing":
            above = descend(root, ("modes", mode, "transitions"))
            part = torn(above, index)
            return part == 0 or (part > 0 and key == "to" and not _has(above, index, "when"))
        case _:
            return False


def _has(sequence: Node | None, index: int, key: str) -> bool:
    item = sequence.items[index] if isinstance(sequence, Sequence) else None
    return isinstance(item, Mapping) and key in item.entries


def _unknown(root: Node, location: Location) -> Diagnostic:
    key, fields = str(location[-1]), _fields(location)
    parent = descend(root, _names(location[:-1]))
    meant = key_meant(key, fields, parent)
    message = f"unknown key '{shown(key)}' in {_PLACE[_trimmed(_pattern(location[:-1]))]}"
    hint = advice(key, meant, fields, descend(root, _names(location)))
    return _find(root, location, key=True).diagnostic("HS201", message, hint)


def _missing(root: Node, location: Location) -> Diagnostic:
    place = _find(root, location[:-1], key=True)
    where = _PLACE[_trimmed(_pattern(location[:-1]))]
    message = f"the key '{location[-1]}' is missing in {where}"
    span = place.span
    if not _names(location[:-1]):
        span = Span(span.path, 1, 1)
    elif place.start[1] != place.end[1] or isinstance(_names(location[:-1])[-1], int):
        span = Span(span.path, span.line, span.column)
    parent = descend(root, _names(location[:-1]))
    hint = to_add(root, str(location[-1]), parent)
    match location:
        case ("modes", mode, "transitions", int(index), _):
            part = torn(descend(root, ("modes", mode, "transitions")), index)
            hint = "remove the dash here, which begins another transition" if part > 0 else hint
        case _:
            pass
    return place.text.diagnostic("HS202", message, span, hint)


def _names(location: Location) -> Location:
    return tuple(step for step in location if isinstance(step, int) or not _TAG.fullmatch(step))


def _trimmed(pattern: tuple[str, ...]) -> tuple[str, ...]:
    return tuple(step for step in pattern if not step.startswith("<"))


def _pattern(location: Location) -> tuple[str, ...]:
    """The kind of place: the key of :data:`SHAPES`."""
    for pattern in SHAPES:
        if _fits(pattern, location):
            return pattern
    return _trimmed_match(location)


def _trimmed_match(location: Location) -> tuple[str, ...]:
    names = _names(location)
    return next((pattern for pattern in SHAPES if _fits(_trimmed(pattern), names)), ())


def _fits(pattern: tuple[str, ...], location: Location) -> bool:
    return len(pattern) == len(location) and all(p in ("*", step) for p, step in zip(pattern, location, strict=True))


def _find(root: Node, location: Location, key: bool = False) -> SourceRange:
    """The place of a value, or of its key; of the nearest thing above it that exists."""
    node, place = root, root.place
    for number, step in enumerate(location):
        last = number == len(location) - 1
        if isinstance(node, Mapping) and step in node.entries:
            found, value = node.entries[str(step)]
            wants_key = key and not any(_names(location[number + 1 :]))
            asks_for_name = location[number + 1 : number + 2] == ("[key]",)
            node, place = value, found.place if wants_key or asks_for_name else value.place
            if isinstance(value, Scalar) and value.kind == "null" and value.value == "":
                place = found.place
        elif isinstance(node, Sequence) and isinstance(step, int) and step < len(node.items):
            node = node.items[step]
            place = node.place
        elif last and isinstance(step, str) and isinstance(node, Mapping):
            break
    return place
