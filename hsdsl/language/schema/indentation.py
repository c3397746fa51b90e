"""Keys indented too little, at the level of the section they belong to: reported once, and moved into it."""

from __future__ import annotations

from collections.abc import Iterable

from hsdsl.base.errors import Findings
from hsdsl.base.names import closest, shown
from hsdsl.language.schema.documents import keys_of
from hsdsl.language.schema.suggestions import named_elsewhere
from hsdsl.language.source import Key, Mapping, Node, Scalar, Sequence, child, is_empty, keys

_OF_MAPPINGS = ("parameters", "inputs", "experiment")
_REQUIRED = frozenset(("modes", "initial", "experiment", "when", "to"))
_SECTIONS = ("parameters", "functions", "inputs", "let", "outputs", "units", "initial", "experiment", "flow", "reset")
_MODEL, _MODE = frozenset(keys_of()), frozenset(keys_of("modes", "*"))
_TRANSITION = frozenset(keys_of("modes", "*", "transitions", "*"))


def correct_indentation(root: Node, findings: Findings) -> None:
    """Move such keys where they belong; the faults go to ``findings``."""
    if not isinstance(root, Mapping):
        return
    _below_empty(root, _MODEL, findings)
    modes = child(root, "modes")
    if not isinstance(modes, Mapping):
        return
    _among_modes(modes, findings)
    if modes.entries:
        key, last = list(modes)[-1]
        _behind(root, "modes", last, _MODE - _MODEL, f"in the mode '{shown(key)}'", findings)
    for _, mode in modes:
        if isinstance(mode, Mapping):
            _in_mode(mode, findings)


def _in_mode(mode: Mapping, findings: Findings) -> None:
    _below_empty(mode, _MODE, findings)
    transitions = child(mode, "transitions")
    items = transitions.items if isinstance(transitions, Sequence) else ()
    if items:
        _behind(mode, "transitions", items[-1], _TRANSITION - _MODE, "in the transition above", findings)
    for item in items:
        if isinstance(item, Mapping):
            _below_empty(item, _TRANSITION, findings)


def _below_empty(parent: Mapping, fields: frozenset[str], findings: Findings) -> None:
    """Take unknown keys after an empty section for those of the section."""
    section, below = "", dict[str, list[Key]]()
    for key, value in parent:
        if key in fields:
            section = str(key) if key in _SECTIONS and is_empty(value) else ""
        elif section and (isinstance(value, Scalar) or section in _OF_MAPPINGS) and not _misnamed(key, parent, fields):
            below.setdefault(section, []).append(key)
    for section, strays in below.items():
        inner = Mapping({}, parent.entries[section][0].place)
        parent.entries[section] = (parent.entries[section][0], inner)
        message = f"`{shown(strays[0])}` is at the level of `{section}`, which is empty"
        _move(parent, strays, inner, message, f"under `{section}`", findings)


def _misnamed(key: str, parent: Mapping, fields: frozenset[str]) -> bool:
    """Whether a key is rather a field of the mapping by another name: another tool's, or a required one misspelt."""
    lacking = _REQUIRED & fields - set(parent.entries)
    return named_elsewhere(key, fields) or closest(key, lacking) is not None


def _among_modes(modes: Mapping, findings: Findings) -> None:
    """Take ``transitions`` among the modes for that of the mode above."""
    above: Key | None = None
    strays: dict[str, list[Key]] = {}
    for key, value in modes:
        if above is not None and key in _MODE and not _may_be_mode(value):
            strays.setdefault(str(above), []).append(key)
        else:
            above = key
    for name, moved in strays.items():
        key, mode = modes.entries[name]
        if is_empty(mode):
            mode = Mapping({}, key.place)
            modes.entries[name] = (key, mode)
        if isinstance(mode, Mapping) and not any(key in mode.entries for key in moved):
            message = f"`{moved[0]}` is among the modes, as if it were one"
            _move(modes, moved, mode, message, f"in the mode '{shown(name)}'", findings)


def _behind(parent: Mapping, section: str, last: Node, fields: frozenset[str], where: str, findings: Findings) -> None:
    """Take the keys right after a section that its last part can have for those of that part."""
    after = keys(parent)[list(parent.entries).index(section) + 1 :]
    strays = [key for key in after if key in fields]
    if not strays or strays != after[: len(strays)] or not isinstance(last, Mapping):
        return
    if not any(key in last.entries for key in strays):
        _move(parent, strays, last, f"`{strays[0]}` is at the level of `{section}`", where, findings)


def _move(
    parent: Mapping, strays: Iterable[Key], target: Mapping, message: str, where: str, findings: Findings
) -> None:
    first, *more = strays
    hint = f"indent {'it' if not more else 'these lines'}, so that {'they are' if more else 'it is'} {where}"
    findings.add(first.place.diagnostic("HS201", message, hint))
    for key in (first, *more):
        target.entries[str(key)] = parent.entries.pop(str(key))


def _may_be_mode(value: Node) -> bool:
    """Whether a value could be that of a mode: empty, or with a key that modes have."""
    if isinstance(value, Mapping):
        return not value.entries or not _MODE.isdisjoint(value.entries)
    return is_empty(value)
