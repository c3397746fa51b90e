"""Hints for values that are of another kind than their key asks for: names, mappings and lists of other tools."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from itertools import pairwise
from typing import Any, cast

from hsdsl.base.names import closest, is_identifier, plain_sign, shown, told_apart
from hsdsl.language.diagnosis import TABLES
from hsdsl.language.source.nodes import Key, Scalar, is_empty

_LONGEST = 1000  # of texts that are looked at for a better form
_TARGET = r"([^\W\d]\w*)(?:'|\+|\(t\))?|d([^\W\d]\w*)/dt|der\(\s*([^\W\d]\w*)\s*\)"
_ASSIGNMENT = re.compile(rf"\s*(?:{_TARGET})\s*:?=\s*([^=].*)")
_BEGINNING = re.compile(rf"(?:^|(?<=\s))(?:{_TARGET})\s*:?=(?!=)")
_REINIT = re.compile(r"reinit\(\s*([^\W\d]\w*)(?:\s*,\s*(.+)\))?")
_DERIVATIVE = re.compile(r"([^\W\d]\w*)(?:'|\(t\)|\.)|d([^\W\d]\w*)/dt|(?:der|diff|d)\(([^\W\d]\w*)(?:, *t)?\)(?:/dt)?")
_SECOND = re.compile(r"([^\W\d]\w*)(?:''|\.\.)|d2([^\W\d]\w*)/dt2|der\(der\(([^\W\d]\w*)\)\)")
_WORDS = re.compile(r"([^\W\d]\w*) +(-?[\w.]+)")
_AND = re.compile(r"\s+and\s+|\s*(?:,|&&)\s*")


def input_keys_meant(keys: Iterable[str]) -> set[str]:
    """The keys of an input that its keys were probably meant to be."""
    fields, names = ("file", "column", "times", "values"), TABLES["keys"]["file"].split()
    meant = {closest(key, (*fields, *names)) if key not in fields else key for key in keys}
    return {"file" if key in names else key for key in meant if key}


def hint_for(expected: str, value: Any) -> str | None:
    """The hint for a value that is not what was expected."""
    if expected in _KINDS:
        return _KINDS[expected](value)
    return in_brackets(value) if isinstance(value, list) else None


def assigned(text: str) -> tuple[str, str] | None:
    """The name and the value of ``x = 1``, ``x := 1``, ``x' = 1``, ``der(x) = 1`` or ``reinit(x, 1)``."""
    short = len(text) < _LONGEST
    match = (_ASSIGNMENT.fullmatch(text) or _REINIT.fullmatch(text)) if short else None
    if not match:
        return None
    *names, value = match.groups()
    return next(name for name in names if name), (value or "").strip()


def _assignments(text: str) -> list[tuple[str, str]]:
    """The names and values of several such lines, which YAML joins; empty for one, or where a line is none."""
    starts = [match.start() for match in _BEGINNING.finditer(text[:_LONGEST])]
    found = [assigned(text[a:b].strip()) for a, b in pairwise([*starts, len(text)])]
    return [line for line in found if line] if len(found) > 1 and all(found) and not text[: starts[0]].strip() else []


def undifferentiated(key: str) -> str | None:
    """The state that ``x'``, ``dx/dt`` or ``der(x)`` is the derivative of, also the second."""
    match = (_DERIVATIVE.fullmatch(key) or _SECOND.fullmatch(key)) if len(key) < _LONGEST else None
    return next(part for part in match.groups() if part) if match else None


def as_name(key: str) -> str:
    """The hint for a key that cannot be a name."""
    equation = assigned(key)
    if equation:
        return _entry(*equation)
    state = undifferentiated(key)
    if state and _SECOND.fullmatch(key):
        return f"write two states: {state}: d{state}, and d{state}: with the second derivative"
    if state:
        return f"write {state}: its value is the derivative of the state"
    if ":" in key:
        return "write a space after the colon"
    words = re.sub(r"[-. ]", "_", key)
    return f"write {words}" if is_identifier(words) else "names have letters, digits and _, no digit first"


def _entry(name: str, value: str) -> str:
    return f"write {name}: {shown(value) or '...'}"


def _as_mapping(value: Any) -> str:
    """The hint for what should have been names with values."""
    match value:
        case Scalar(value=text) if lines := _assignments(text):
            return f"write one `name: value` on each line: {'; '.join(': '.join(line) for line in lines)}"
        case Scalar(value=text) if equation := assigned(text):
            name, text = equation
            return _entry(name, text) if _on_its_own_line(value) else f"write {{{name}: {shown(text)}}}"
        case Scalar(value=text) if strange := next((sign for sign in text if plain_sign(sign) == ":"), None):
            return f"write `:` and a space, for {told_apart(strange)}"
        case Scalar(value=text) if words := _WORDS.fullmatch(text):
            return _entry(words[1], words[2]) if _on_its_own_line(value) else f"write {{{words[1]}: {words[2]}}}"
        case Scalar(value=text) if ":" in text:
            return "a key is followed by a colon and a space"
        case [{"name": Scalar(value=name)}, *_]:
            return f"write names as keys, without dashes: `{shown(name)}:`"
        case [first, *_] if not _after_a_dash(first):
            return _braces(cast(list[Any], value)) or "write braces and names: {name: value, ...}"
        case list():
            return "leave the dashes out: `name: value`, one on each line"
        case _:
            return "write {name: value}"


def _as_list(value: Any) -> str:
    """The hint for what should have been a list."""
    match value:
        case Scalar(value=text):
            parts = [text.strip()] if "(" in text else _AND.split(text.strip())
            return f"write [{shown(', '.join(parts))}]"
        case {**entries} if interval := _intervals(cast(dict[str, Any], entries)):
            return f"write each inequality as an item: [{interval}]"
        case {**entries} if entries and all(isinstance(inner, dict) for inner in entries.values()):  # pyright: ignore[reportUnknownVariableType]
            name = shown(str(next(iter(cast(dict[str, Any], entries)))))
            return f"begin each item with a dash, and give its name in it: - name: {name}"
        case dict():
            return "begin each item with a dash and a blank: `- `"
        case _:
            return "write it as [..., ...]"


def in_brackets(value: Any) -> str | None:
    """The hint for one expression in braces or brackets that YAML took for its own."""
    match value:
        case [Scalar() as only]:
            return f"write it without brackets: {shown(only.value)}"
        case {**entries} if len(entries) == 1 and all(is_empty(inner) for inner in entries.values()):  # pyright: ignore[reportUnknownVariableType]
            return f"write it without braces: {shown(next(iter(entries)))}"
        case {"value": Scalar(value=number)}:
            return f"write {shown(number)} alone: units belong under `units`"
        case dict():
            return "quote the expression, if it is one"
        case _:
            return None


def _intervals(entries: dict[str, Any]) -> str | None:
    """``{x: [0, 1]}`` as inequalities."""
    texts: list[str] = []
    for name, bounds in entries.items():
        match bounds:
            case [Scalar(value=low), Scalar(value=high)]:
                texts.append(f"{shown(name)} >= {shown(low)}, {shown(name)} <= {shown(high)}")
            case _:
                return None
    return ", ".join(texts)


def _braces(items: list[Any]) -> str | None:
    """The items of a list in brackets, each ``v: 1`` or ``v = 1``, as one mapping in braces."""
    texts: list[str] = []
    for item in items:
        match item:
            case {**entries} if all(isinstance(inner, Scalar) for inner in entries.values()):  # pyright: ignore[reportUnknownVariableType]
                texts += [f"{key}: {inner.value}" for key, inner in cast(dict[str, Scalar], entries).items()]
            case Scalar(value=text) if equation := assigned(text):
                texts.append(": ".join(equation))
            case _:
                return None
    return f"write {{{shown(', '.join(texts))}}}"


def _on_its_own_line(scalar: Scalar) -> bool:
    return not _before(scalar).strip()


def _after_a_dash(item: Any) -> bool:
    """Whether an item of a list follows a dash, and is not in brackets."""
    first = next(iter(cast(dict[Any, Any], item)), None) if isinstance(item, dict) else item
    return not isinstance(first, (Scalar, Key)) or _before(first).rstrip().endswith("-")


def _before(part: Scalar | Key) -> str:
    _, line, column = part.place.start
    return part.place.text.lines[line][:column]


def _as_condition(value: Any) -> str:
    parts = [part.value for part in value if isinstance(part, Scalar)]
    return in_brackets(value) or f"join conditions: {shown(' and '.join(parts))}"


def _as_flag(value: Any) -> str | None:
    if not isinstance(value, Scalar):
        return in_brackets(value) if isinstance(value, list) else None
    words = {"yes": "true", "on": "true", "y": "true", "no": "false", "off": "false", "n": "false"}
    meant = words.get(value.value.lower())
    return f"write {meant}" if meant else None


_UNDER_IF = "under `when`, put the rest under `if`; under `domain`, make each an item"
_KINDS: dict[str, Callable[[Any], str | None]] = {
    "a mapping (name: value)": _as_mapping,
    "a list": _as_list,
    "an expression": lambda value: in_brackets(value) or "write every component as a name of its own",
    "a condition": _as_condition,
    "one inequality": lambda value: in_brackets(value) or _UNDER_IF,
    "true or false": _as_flag,
}
