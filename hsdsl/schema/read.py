"""Nodes to documents. What pydantic finds wrong is said in our words, at the place in the file."""

from __future__ import annotations

from typing import Any

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from hsdsl.errors import Diagnostic, Findings, Span
from hsdsl.names import closest, shown
from hsdsl.schema.documents import SHAPES, Model
from hsdsl.schema.leaves import described, undifferentiated
from hsdsl.schema.repair import repair
from hsdsl.source import Mapping, Node, Place, Scalar, Sequence

_Location = tuple[int | str, ...]
_MOST_REPAIRS = 8
_MEANT = {
    "guard": "when",
    "trigger": "when",
    "target": "to",
    "goto": "to",
    "jump": "reset",
    "assign": "reset",
    "update": "reset",
    "invariant": "domain",
    "walls": "domain",
    "ode": "flow",
    "dynamics": "flow",
    "edges": "transitions",
    "jumps": "transitions",
    "locations": "modes",
    "where": "let",
    "constants": "parameters",
    "horizon": "until",
    "end": "until",
    "dt": "step",
    "h": "step",
    "epsilon": "relaxation",
    "eps": "relaxation",
    "tol": "tolerance",
    "integrator": "method",
    "simulation": "experiment",
    "name": "title",
    "description": "about",
}
_ADD = {
    "hsdsl": "begin the file with hsdsl: 1",
    "modes": "write modes: and under it each mode's name with its flow",
    "flow": "write flow: and under it each state with its derivative",
    "initial": "write initial: {mode: ..., x: ...}, a value for each state of that mode",
    "experiment": "write experiment: {until: 10}, the time at which a run ends",
    "until": "write until: and the time at which a run ends",
    "when": "write when: and the inequality at which the transition fires, such as x >= 1",
    "to": "write to: and the mode that is entered",
    "value": "write value: and the parameter's number or expression",
    "times": "write times: [0, 1, 2], or file: and the name of a CSV file",
    "values": "write values: and one value for each of the times",
    "file": "write file: and the name of a CSV file",
    "time": "write time: and when that is",
}
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


def read(root: Node, findings: Findings) -> Model:
    """The document that a YAML file holds.

    Faults go to ``findings``. What is beside the point of a fault is still read: a misspelt key is taken for the one
    meant, a wrong value for one that nothing more is to be said about.

    Raises
    ------
    ModelError
        When too little is left to be called a model.
    """
    for _ in range(_MOST_REPAIRS):
        try:
            return Model.model_validate(_plain(root))
        except ValidationError as error:
            details = error.errors(include_url=False)
        misspelt = {(*fault["loc"][:-1], _meant(fault)) for fault in details}
        diagnostics = [_diagnostic(root, f) for f in details if f["type"] != "missing" or f["loc"] not in misspelt]
        for diagnostic in diagnostics:
            findings.add(diagnostic)
        repaired = [repair(root, _names(fault["loc"]), fault["type"], _meant(fault)) for fault in reversed(details)]
        if not all(repaired):
            break
    findings.raise_if_any()
    raise AssertionError


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
            return place.diagnostic(code, context["message"], context.get("hint"))
        case _:
            return _find(root, location).diagnostic("HS204", "this value is not possible here")


def _fields(location: _Location) -> list[str]:
    shape = SHAPES[_pattern(location[:-1])]
    return [field.alias or name for name, field in shape.model_fields.items()]


def _meant(fault: ErrorDetails) -> str | None:
    """The key that an unknown one was probably meant to be."""
    location = fault["loc"]
    if fault["type"] == "HS205" and location[-1] == "[key]":
        return undifferentiated(str(location[-2]))
    if fault["type"] != "extra_forbidden":
        return None
    key, fields = str(location[-1]), _fields(location)
    meant = _MEANT.get(key)
    return meant if meant in fields else closest(key, fields)


def _unknown(root: Node, location: _Location) -> Diagnostic:
    pattern, key, fields = _pattern(location[:-1]), str(location[-1]), _fields(location)
    meant = _MEANT.get(key)
    if ":" in key:
        hint = "write a space after the colon"
    elif key == "<<":
        hint = "mappings are not merged in YAML 1.2"
    elif meant in fields:
        hint = f"did you mean '{meant}'?"
    else:
        best = closest(key, fields)
        hint = f"did you mean '{best}'?" if best else "keys here: " + ", ".join(fields)
    message = f"unknown key '{shown(key)}' in {_PLACE[_trimmed(pattern)]}"
    return _find(root, location, key=True).diagnostic("HS201", message, hint)


def _missing(root: Node, location: _Location) -> Diagnostic:
    place = _find(root, location[:-1], key=True)
    where = _PLACE[_trimmed(_pattern(location[:-1]))]
    message = f"the key '{location[-1]}' is missing in {where}"
    span = place.span
    if not _names(location[:-1]):
        span = Span(span.path, 1, 1)
    elif place.start[1] != place.end[1] or isinstance(_names(location[:-1])[-1], int):
        span = Span(span.path, span.line, span.column)
    return place.text.diagnostic("HS202", message, span, _to_add(root, location))


def _to_add(root: Node, location: _Location) -> str:
    """What to write where a key is missing."""
    key = str(location[-1])
    if key != "mode":
        return _ADD[key]
    modes = root.entries["modes"][1] if isinstance(root, Mapping) and "modes" in root.entries else root
    names = [str(name) for name, _ in modes] if isinstance(modes, Mapping) else []
    return f"write mode: {names[0]}" if len(names) == 1 else "write mode: and the mode that a run starts in"


def _names(location: _Location) -> _Location:
    return tuple(step for step in location if isinstance(step, int) or not step.startswith(("<", "function-")))


def _trimmed(pattern: tuple[str, ...]) -> tuple[str, ...]:
    return tuple(step for step in pattern if not step.startswith("<"))


def _pattern(location: _Location) -> tuple[str, ...]:
    """The kind of place: the key of :data:`SHAPES`."""
    for pattern in SHAPES:
        if _fits(pattern, location):
            return pattern
    return _trimmed_match(location)


def _trimmed_match(location: _Location) -> tuple[str, ...]:
    names = _names(location)
    return next((pattern for pattern in SHAPES if _fits(_trimmed(pattern), names)), ())


def _fits(pattern: tuple[str, ...], location: _Location) -> bool:
    return len(pattern) == len(location) and all(p in ("*", step) for p, step in zip(pattern, location, strict=True))


def _find(root: Node, location: _Location, key: bool = False) -> Place:
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
