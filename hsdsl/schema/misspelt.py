"""States misspelt in a flow: told once there, and taken for the name that the mode's other expressions use."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator

from hsdsl.errors import Findings
from hsdsl.expression.scope import RESERVED
from hsdsl.names import closest, is_identifier, shown
from hsdsl.schema.habits import each, under
from hsdsl.source import Key, Mapping, Node, Scalar, Sequence

_WORD = re.compile(r"[^\W\d]\w*")
_FOR_PEOPLE = ("title", "source", "units")
_OF_STATES = ("modes", "initial", "experiment", "outputs", "units", "reference", "flow", "transitions", "reset")


def respell(root: Node, findings: Findings) -> None:
    """Rename states that stand nowhere but in one flow, where another name stands for them everywhere else."""
    modes = under(root, "modes")
    if not isinstance(root, Mapping) or not isinstance(modes, Mapping):
        return
    counts = Counter(word for key, part in root if key not in _FOR_PEOPLE for word in _words(part))
    known = {*RESERVED, *_defined(root)}
    given = _given(root, modes)
    for name, mode in modes:
        flow = under(mode, "flow")
        alone = [key for key in _keys(flow) if counts[str(key)] == 1 and is_identifier(key)]
        if alone and isinstance(flow, Mapping):
            used = dict.fromkeys((*given.get(str(name), ()), *(word for part in _read(mode) for word in _words(part))))
            here = known.union(map(str, _keys(flow)), _defined(mode))
            unknown = [word for word in used if counts[word] > 1 and word not in here]
            _rename(flow, alone, unknown, str(name), findings)


def _rename(flow: Mapping, alone: list[Key], unknown: list[str], mode: str, findings: Findings) -> None:
    for key in alone:
        meant = closest(key, unknown)
        if meant is None:
            continue
        unknown.remove(meant)
        message = f"the flow of '{shown(mode)}' says '{shown(key)}', and the rest of the model '{shown(meant)}'"
        findings.add(key.place.diagnostic("HS111", message, f"did you mean '{shown(meant)}'?"))
        renamed = ((Key.at(meant, k.place) if k == key else k, value) for k, value in list(flow))
        entries = {str(k): (k, value) for k, value in renamed}
        flow.entries.clear()
        flow.entries.update(entries)


def _defined(node: Node) -> Iterator[str]:
    """What the sections of a model or a mode define, whatever they are called there."""
    for section, part in node if isinstance(node, Mapping) else ():
        if section not in _OF_STATES:
            yield from map(str, _keys(part))


def _given(root: Mapping, modes: Mapping) -> dict[str, list[str]]:
    """The states of each mode that `initial` and resets give a value to."""
    initial = under(root, "initial")
    start = under(initial, "mode")
    found: dict[str, list[str]] = {}
    if isinstance(start, Scalar):
        found[start.value] = [str(key) for key in _keys(initial) if key != "mode"]
    for _, mode in modes:
        for transition in each(under(mode, "transitions")):
            target = under(transition, "to")
            if isinstance(target, Scalar):
                found.setdefault(target.value, []).extend(map(str, _keys(under(transition, "reset"))))
    return found


def _read(mode: Node) -> Iterator[Node]:
    """The parts of a mode whose expressions are read in it: names of transitions and targets are none of them."""
    for section in ("flow", "domain", "let", "outputs"):
        yield from each(under(mode, section))
    for transition in each(under(mode, "transitions")):
        parts = (under(transition, "when"), under(transition, "if"), *each(under(transition, "reset")))
        yield from (part for part in parts if part is not None)


def _words(node: Node) -> Iterator[str]:
    """The words of every key and value."""
    waiting = [node]
    while waiting:
        part = waiting.pop()
        if isinstance(part, Mapping):
            for key, value in part:
                yield str(key)
                waiting.append(value)
        elif isinstance(part, Sequence):
            waiting.extend(part.items)
        else:
            yield from _WORD.findall(part.value)


def _keys(node: Node | None) -> list[Key]:
    return [key for key, _ in node] if isinstance(node, Mapping) else []
