"""Habits of other tools that only the document as a whole shows; each is told once, and taken for what was meant."""

from __future__ import annotations

import re
from collections.abc import Iterator

from hsdsl.errors import Findings
from hsdsl.names import is_identifier, shown
from hsdsl.source import Key, Mapping, Node, Scalar, Sequence

_NESTED = ("state", "states", "values", "x0", "variables", "continuous")
_LONGEST = 100  # names that are looked at
_SURFACES = ("when", "guard", "event", "trigger", "on", "condition")  # what other tools call it
_COMPARED = re.compile("[<>=]")
_DIRECTIONS = {
    "<=": ("-1", "-1.0", "falling", "fall", "down", "negative", "decreasing"),
    ">=": ("1", "+1", "1.0", "rising", "rise", "up", "positive", "increasing"),
}
_NAMED_AFTER = re.compile(r"d_?(\w+?)(?:_?dt)?|(\w+?)_?dot|(\w+)_(?:prime|p|d)")


def reread(root: Node, findings: Findings) -> None:
    """Change the nodes where such a habit shows; the faults go to ``findings``."""
    initial, modes = under(root, "initial"), under(root, "modes")
    for mode in each(modes):
        for transition in each(under(mode, "transitions")):
            if isinstance(transition, Mapping) and "direction" in transition.entries:
                _undirect(transition, findings)
    if not (isinstance(initial, Mapping) and isinstance(modes, Mapping)):
        return
    named = initial.entries["mode"][1] if "mode" in initial.entries else None
    first = under(modes, named.value) if isinstance(named, Scalar) else None
    flow = under(first, "flow")
    _lift(initial, flow, findings)
    known, set_somewhere = {str(key) for key in initial.entries}, _reset_somewhere(modes)
    for mode in each(modes):
        states = under(mode, "flow")
        if isinstance(states, Mapping):
            _undo_dots(states, known, set_somewhere, findings)


def under(node: Node | None, key: str) -> Node | None:
    """The value of a key, where there is one."""
    return node.entries[key][1] if isinstance(node, Mapping) and key in node.entries else None


def each(node: Node | None) -> Iterator[Node]:
    """The values of a mapping, the items of a list."""
    if isinstance(node, Mapping):
        yield from (value for _, value in node)
    elif isinstance(node, Sequence):
        yield from node.items


def _lift(initial: Mapping, flow: Node | None, findings: Findings) -> None:
    """Take ``initial: {mode: A, state: {x: 1}}`` for ``initial: {mode: A, x: 1}``."""
    states = [str(key) for key, _ in flow] if isinstance(flow, Mapping) else []
    for name in _NESTED:
        value = under(initial, name)
        if name in states or not isinstance(value, (Mapping, Sequence)):
            continue
        key, _ = initial.entries.pop(name)
        entries = list(value) if isinstance(value, Mapping) else _paired(states, value)
        said = ", ".join(f"{state}: {v.value if isinstance(v, Scalar) else '...'}" for state, v in entries)
        hint = f"write the values beside `mode`: {shown(said or 'x: 0')}"
        findings.add(key.place.diagnostic("HS201", f"unknown key '{name}' in `initial`", hint))
        for state, part in entries:
            initial.entries.setdefault(str(state), (state, part))


def _paired(states: list[str], values: Sequence) -> list[tuple[Key, Node]]:
    if len(states) != len(values.items):
        return []
    return [(Key.at(state, value.place), value) for state, value in zip(states, values.items, strict=True)]


def _undo_dots(flow: Mapping, known: set[str], set_somewhere: set[str], findings: Findings) -> None:
    """Take the keys ``xdot``, ``dx`` and ``dxdt`` of a flow for ``x``, where the start is given as ``x``."""
    for key, value in list(flow):
        found = _NAMED_AFTER.fullmatch(key) if len(key) < _LONGEST else None
        names = [name for name in found.groups() if name] if found else []
        if not names or key in known or key in set_somewhere:
            continue
        name = names[0]
        if name in known and name not in flow.entries and name != "mode" and is_identifier(name):
            message = f"the flow says '{shown(key)}', and `initial` says '{shown(name)}'"
            hint = f"write {shown(name)}: what stands under a state's name is its derivative"
            findings.add(key.place.diagnostic("HS205", message, hint))
            del flow.entries[str(key)]
            flow.entries[name] = (Key.at(name, key.place), value)


def _undirect(transition: Mapping, findings: Findings) -> None:
    """Take ``direction: -1`` for what the sign of the inequality says; a bare expression becomes that inequality."""
    key, value = transition.entries.pop("direction")
    word = value.value.strip().lower() if isinstance(value, Scalar) else ""
    signs = [sign for sign, words in _DIRECTIONS.items() if word in words]
    written = next((k for k in _SURFACES if isinstance(under(transition, k), Scalar)), None)
    surface = under(transition, written) if written else None
    hint = "leave it out: `x <= 0` fires where x falls through 0, `x >= 0` where it rises"
    if written and isinstance(surface, Scalar) and not _COMPARED.search(surface.value):
        text = surface.value.strip()
        both = "and a second transition with >= for where it rises"
        more = f"which fires where {shown(text, 30)} {'falls' if signs == ['<='] else 'rises'}" if signs else both
        hint = f"leave it out, and write when: {shown(text, 30)} {(signs or ['<='])[0]} 0, {more}"
        inequality = Scalar(f"{text} {(signs or ['<='])[0]} 0", surface.plain, surface.place)
        transition.entries[written] = (transition.entries[written][0], inequality)
    findings.add(key.place.diagnostic("HS201", "unknown key 'direction' in a transition", hint))


def _reset_somewhere(modes: Mapping) -> set[str]:
    """The states that some transition sets."""
    found: set[str] = set()
    for mode in each(modes):
        for transition in each(under(mode, "transitions")):
            reset = under(transition, "reset")
            found |= {str(key) for key, _ in reset} if isinstance(reset, Mapping) else set()
    return found
