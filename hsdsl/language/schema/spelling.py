"""States misspelt in a flow: each is reported once, and taken for the name in the mode's other expressions."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator

from hsdsl.base.errors import Findings
from hsdsl.base.names import closest, is_identifier, shown
from hsdsl.language.expression.scope import RESERVED
from hsdsl.language.source import Key, Mapping, Node, Scalar, child, children, keys

_WORD = re.compile(r"[^\W\d]\w*")
_FOR_PEOPLE = ("title", "source", "units", "assumptions")
_OF_STATES = (
    *("modes", "initial", "experiment", "outputs", "scene", "units", "reference"),
    *("flow", "transitions", "reset"),
)


def correct_spelling(root: Node, findings: Findings) -> None:
    """Rename states that occur in one flow alone, where the rest of the model has another name for them."""
    modes = child(root, "modes")
    if not isinstance(root, Mapping) or not isinstance(modes, Mapping):
        return
    counts = Counter(word for key, part in root if key not in _FOR_PEOPLE for word in _words(part))
    known = {*RESERVED, *_defined(root)}
    given = _given(root, modes)
    for name, mode in modes:
        flow = child(mode, "flow")
        alone = [key for key in keys(flow) if counts[str(key)] == 1 and is_identifier(key)]
        if alone and isinstance(flow, Mapping):
            words = (word for part in _expressions(mode) for word in _words(part))
            used = dict.fromkeys((*given.get(str(name), ()), *words))
            here = known.union(map(str, keys(flow)), _defined(mode))
            unknown = [word for word in used if counts[word] > 1 and word not in here]
            _rename(flow, alone, unknown, str(name), findings)


def _rename(flow: Mapping, alone: list[Key], unknown: list[str], mode: str, findings: Findings) -> None:
    for key in alone:
        meant = closest(key, unknown)
        if meant is not None:
            unknown.remove(meant)
            message = f"the flow of '{shown(mode)}' says '{shown(key)}', and the rest of the model '{shown(meant)}'"
            findings.add(key.place.diagnostic("HS111", message, f"did you mean '{shown(meant)}'?"))
            flow.rename(str(key), meant)


def _defined(node: Node) -> Iterator[str]:
    """The names that the sections of a model or a mode define, other than states."""
    for section, part in node if isinstance(node, Mapping) else ():
        if section not in _OF_STATES:
            yield from map(str, keys(part))


def _given(root: Mapping, modes: Mapping) -> dict[str, list[str]]:
    """The states of each mode that `initial` and resets give a value to."""
    initial = child(root, "initial")
    start = child(initial, "mode")
    states: dict[str, list[str]] = {}
    if isinstance(start, Scalar):
        states[start.value] = [str(key) for key in keys(initial) if key != "mode"]
    for mode in children(modes):
        for transition in children(child(mode, "transitions")):
            target = child(transition, "to")
            if isinstance(target, Scalar):
                states.setdefault(target.value, []).extend(map(str, keys(child(transition, "reset"))))
    return states


def _expressions(mode: Node) -> Iterator[Node]:
    """The expressions of a mode: names of transitions and targets are none of them."""
    for section in ("flow", "domain", "let", "outputs"):
        yield from children(child(mode, section))
    for transition in children(child(mode, "transitions")):
        parts = (child(transition, "when"), child(transition, "if"), *children(child(transition, "reset")))
        yield from (part for part in parts if part is not None)


def _words(node: Node) -> Iterator[str]:
    """The words of every key and value."""
    waiting = [node]
    while waiting:
        part = waiting.pop()
        if isinstance(part, Scalar):
            yield from _WORD.findall(part.value)
        yield from map(str, keys(part))
        waiting.extend(children(part))
