"""Nodes to documents: pydantic's faults in the language's words, at their places in the file."""

from __future__ import annotations

import re
from typing import Any

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from hsdsl.base.errors import Diagnostic, Findings, Span
from hsdsl.base.names import shown
from hsdsl.language.schema.documents import SHAPES, ModelDocument, SystemDocument, keys_of
from hsdsl.language.schema.fields import described
from hsdsl.language.schema.idioms import translate_idioms
from hsdsl.language.schema.indentation import correct_indentation
from hsdsl.language.schema.recovery import recover
from hsdsl.language.schema.shapes import KINDS
from hsdsl.language.schema.spelling import correct_spelling
from hsdsl.language.schema.suggestions import (
    key_meant,
    missing_key_hint,
    part_of_transition,
    path_meant,
    unknown_key_hint,
)
from hsdsl.language.schema.value_suggestions import assigned, undifferentiated
from hsdsl.language.source import Mapping, Node, NodePath, Scalar, Sequence, SourceRange, child, descend, keys

_MOST_READINGS = 8
_MARKUP = "`hsdsl import` makes one of a file of SBML or SpaceEx"
_TAGS = "|".join(("expression", "mapping", "list", "samples", "file", *KINDS))  # of a union; no key in the file
_TAG = re.compile(rf"<(?:{_TAGS})>|function-\w+\[.*")


def read(root: Node, findings: Findings) -> ModelDocument:
    """The document of a YAML file.

    Faults go to ``findings``. The rest of the file is still read: a misspelt key is taken for the one meant, a wrong
    value for one that nothing more is reported of.

    Raises ModelError: when too little is left to be called a model.
    """
    correct_indentation(root, findings)
    translate_idioms(root, findings)
    correct_spelling(root, findings)
    whole = SystemDocument if {"system", "automata"} & set(map(str, keys(root))) else ModelDocument
    faulty: set[NodePath] = set()  # values that are reported, and left out since
    for _ in range(_MOST_READINGS):
        try:
            return whole.model_validate(_plain(root))
        except ValidationError as error:
            faults = _without_values_of_wrong_keys(error.errors(include_url=False))
        meant = [_key_meant(root, fault) for fault in faults]
        targets = [_target(root, fault, key) for fault, key in zip(faults, meant, strict=True)]
        for fault in faults:
            if fault["type"] != "missing" or not (
                fault["loc"] in targets
                or _untagged(fault["loc"][:-1]) in faulty
                or _is_part(root, fault["loc"])
                or _is_of_event(root, fault["loc"])
            ):
                findings.add(_diagnostic(root, fault))
        faulty |= {_untagged(fault["loc"]) for fault in faults if fault["type"] == "HS203"}
        recovered = [
            recover(root, _untagged(fault["loc"]), fault["type"], key, target if key is None else ())
            for fault, key, target in reversed(list(zip(faults, meant, targets, strict=True)))
        ]
        if not all(recovered):
            break
    findings.raise_if_any()
    raise AssertionError


def _without_values_of_wrong_keys(faults: list[ErrorDetails]) -> list[ErrorDetails]:
    """The faults without those of values whose key is at fault: ``{v = 1}`` lacks no value."""
    wrong = {_untagged(fault["loc"][:-1]) for fault in faults if fault["loc"][-1:] == ("[key]",)}
    return [fault for fault in faults if fault["type"] != "HS121" or _untagged(fault["loc"]) not in wrong]


def _plain(node: Node) -> Any:
    if isinstance(node, Mapping):
        return {key: _plain(value) for key, value in node}
    return [_plain(item) for item in node.items] if isinstance(node, Sequence) else node


def _key_meant(root: Node, fault: ErrorDetails) -> str | None:
    """The key that an unknown one was probably meant to be."""
    path = fault["loc"]
    if fault["type"] == "HS205" and path[-1] == "[key]":
        equation = assigned(str(path[-2]))
        return equation[0] if equation else undifferentiated(str(path[-2]))
    if fault["type"] != "extra_forbidden":
        return None
    return key_meant(str(path[-1]), keys_of(*_pattern(path[:-1])), descend(root, _untagged(path[:-1])))


def _target(root: Node, fault: ErrorDetails, meant: str | None) -> NodePath:
    """The path that a fault's key is taken for: with another name, or in another mapping."""
    path = fault["loc"]
    if fault["type"] != "extra_forbidden" or meant is not None:
        return (*path[:-1], meant or "")
    return path_meant(root, str(path[-1]), descend(root, _untagged(path)))


def _is_part(root: Node, path: NodePath) -> bool:
    """Whether a missing key is reported already: a dash too many makes two transitions of one."""
    match path:
        case ("modes", mode, "transitions", int(index), key):
            items = descend(root, ("modes", mode, "transitions"))
            part = part_of_transition(items, index)
            own = keys(items.items[index]) if isinstance(items, Sequence) else ()
            return part == 0 or (part > 0 and key == "to" and "when" not in own)
        case _:
            return False


def _is_of_event(root: Node, path: NodePath) -> bool:
    """Whether a missing key is not needed, by a key that is `event` or was meant to be."""
    parent, fields = descend(root, _untagged(path[:-1])), keys_of(*_pattern(path[:-1]))
    if path[-1] not in ("when", "to") or "event" not in fields:
        return False
    return any(
        key == "event" or (key not in fields and key_meant(key, fields, parent) == "event") for key in keys(parent)
    )


def _diagnostic(root: Node, fault: ErrorDetails) -> Diagnostic:
    path, code = fault["loc"], fault["type"]
    if code == "extra_forbidden":
        return _unknown_key(root, path)
    if code == "missing":
        return _missing_key(root, path)
    place = _find(root, path)
    if not code.startswith("HS"):
        return place.diagnostic("HS204", "this value is not possible here")
    if not path:
        text = _plain(root)
        other = isinstance(text, Scalar) and text.value.lstrip().startswith("<")
        hint = f"a model begins with hsdsl: 1; {_MARKUP if other else 'is this file one?'}"
        return place.diagnostic(code, f"expected a model, got {described(_plain(root))}", hint)
    context = fault.get("ctx", {})
    message, hint, last = context["message"], context.get("hint"), _untagged(path)[-1]
    if code == "HS205" and isinstance(last, int) and isinstance(name := descend(root, _untagged(path)), Scalar):
        bare = name.value.strip("'\"")  # of a list, where nothing has a derivative
        hint = f"write {shown(bare)}, with quotes on both sides or on none" if bare != name.value else hint
    if code == "HS121" and isinstance(last, str):
        message, hint = f"'{shown(last)}' has no value", f"write {shown(last)}: and {hint}"
    if code == "HS203" and (each := _by_modes(root, _untagged(path))):
        hint = each
    return place.diagnostic(code, message, hint)


def _by_modes(root: Node, path: NodePath) -> str | None:
    """The hint for a value of the whole file that is given mode by mode."""
    value, modes = descend(root, path), keys(child(root, "modes"))
    if len(path) != 2 or path[0] not in ("outputs", "let") or not keys(value) or not {*keys(value)} <= {*modes}:
        return None
    return f"give it in each mode, as {path[0]}: {{{shown(str(path[1]))}: ...}} below {shown(keys(value)[0])}"


def _unknown_key(root: Node, path: NodePath) -> Diagnostic:
    key, fields = str(path[-1]), keys_of(*_pattern(path[:-1]))
    meant = key_meant(key, fields, descend(root, _untagged(path[:-1])))
    message = f"unknown key '{shown(key)}' in {SHAPES[_pattern(path[:-1])][1]}"
    hint = unknown_key_hint(key, meant, fields, descend(root, _untagged(path)))
    return _find(root, path, key=True).diagnostic("HS201", message, hint)


def _missing_key(root: Node, path: NodePath) -> Diagnostic:
    above = _untagged(path[:-1])
    place = _find(root, path[:-1], key=True)
    span = place.span
    if not above:
        span = Span(span.path, 1, 1)
    elif place.start[1] != place.end[1] or isinstance(above[-1], int):
        span = Span(span.path, span.line, span.column)
    hint = missing_key_hint(root, str(path[-1]), descend(root, above))
    match path:
        case ("modes", mode, "transitions", int(index), _):
            if part_of_transition(descend(root, ("modes", mode, "transitions")), index) > 0:
                hint = "remove the dash here, which begins another transition"
        case _:
            pass
    message = f"the key '{path[-1]}' is missing in {SHAPES[_pattern(path[:-1])][1]}"
    return place.text.diagnostic("HS202", message, span, hint)


def _untagged(path: NodePath) -> NodePath:
    return tuple(step for step in path if isinstance(step, int) or not _TAG.fullmatch(step))


def _pattern(path: NodePath) -> tuple[str, ...]:
    """The kind of mapping at a path: a key of :data:`SHAPES`."""
    names = _untagged(path)
    exact = (pattern for pattern in SHAPES if _fits(pattern, path))
    return next(exact, None) or next((pattern for pattern in SHAPES if _fits(_untagged(pattern), names)), ())


def _fits(pattern: NodePath, path: NodePath) -> bool:
    return len(pattern) == len(path) and all(p in ("*", step) for p, step in zip(pattern, path, strict=True))


def _find(root: Node, path: NodePath, key: bool = False) -> SourceRange:
    """The place of a value, or of its key; of the nearest node above it that exists."""
    node, place = root, root.place
    for number, step in enumerate(path):
        if isinstance(node, Mapping) and step in node.entries:
            name, value = node.entries[str(step)]
            rest = path[number + 1 :]
            by_key = (key and not any(_untagged(rest))) or rest[:1] == ("[key]",) or _is_left_out(value)
            node, place = value, name.place if by_key else value.place
        elif isinstance(node, Sequence) and isinstance(step, int) and step < len(node.items):
            node = node.items[step]
            place = node.place
    return place


def _is_left_out(value: Node) -> bool:
    return isinstance(value, Scalar) and value.kind == "null" and value.value == ""
