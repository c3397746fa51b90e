"""Keys that stand too far left, beside the section they belong to: told once, and taken to stand in it."""

from __future__ import annotations

from collections.abc import Iterable

from hsdsl.errors import Findings
from hsdsl.names import closest, shown
from hsdsl.schema.documents import SHAPES
from hsdsl.schema.habits import under
from hsdsl.schema.suggestions import named_elsewhere
from hsdsl.source import Key, Mapping, Node, Scalar, Sequence

_OF_MAPPINGS = ("parameters", "inputs", "experiment")
_REQUIRED = frozenset(("modes", "initial", "experiment", "when", "to"))
_SECTIONS = ("parameters", "inputs", "let", "outputs", "units", "initial", "experiment", "flow", "reset")


def _fields(*pattern: str) -> frozenset[str]:
    return frozenset(field.alias or name for name, field in SHAPES[pattern].model_fields.items())


_MODEL, _MODE = _fields(), _fields("modes", "*")
_TRANSITION = _fields("modes", "*", "transitions", "*")


def reindent(root: Node, findings: Findings) -> None:
    """Move such keys where they belong; the faults go to ``findings``."""
    if not isinstance(root, Mapping):
        return
    _below_empty(root, _MODEL, findings)
    modes = under(root, "modes")
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
    transitions = under(mode, "transitions")
    items = transitions.items if isinstance(transitions, Sequence) else ()
    if items:
        _behind(mode, "transitions", items[-1], _TRANSITION - _MODE, "in the transition above", findings)
    for item in items:
        if isinstance(item, Mapping):
            _below_empty(item, _TRANSITION, findings)


def _below_empty(parent: Mapping, fields: frozenset[str], findings: Findings) -> None:
    """Take the keys behind an empty section that the mapping does not have for those of the section."""
    section, below = "", dict[str, list[Key]]()
    for key, value in parent:
        if key in fields:
            section = str(key) if key in _SECTIONS and _empty(value) else ""
        elif section and _fits(section, value) and not _misnamed(key, parent, fields):
            below.setdefault(section, []).append(key)
    for section, keys in below.items():
        inner = Mapping({}, parent.entries[section][0].place)
        parent.entries[section] = (parent.entries[section][0], inner)
        message = f"`{shown(keys[0])}` stands beside `{section}`, and nothing stands under `{section}`"
        _moved(parent, keys, inner, message, f"under `{section}`", findings)


def _fits(section: str, value: Node) -> bool:
    return isinstance(value, Scalar) or section in _OF_MAPPINGS


def _misnamed(key: str, parent: Mapping, fields: frozenset[str]) -> bool:
    """Whether a key is rather a field of the mapping by another name: another tool's, or a required one misspelt."""
    lacking = _REQUIRED & fields - set(parent.entries)
    return named_elsewhere(key, fields) or closest(key, lacking) is not None


def _among_modes(modes: Mapping, findings: Findings) -> None:
    """Take ``transitions`` beside the modes for that of the mode above."""
    above: Key | None = None
    strays: dict[str, list[Key]] = {}
    for key, value in modes:
        if above is not None and key in _MODE and not _may_be_mode(value):
            strays.setdefault(str(above), []).append(key)
        else:
            above = key
    for name, keys in strays.items():
        found, mode = modes.entries[name]
        if _empty(mode):
            mode = Mapping({}, found.place)
            modes.entries[name] = (found, mode)
        if isinstance(mode, Mapping) and not any(key in mode.entries for key in keys):
            message = f"`{keys[0]}` stands among the modes, as if it were one"
            _moved(modes, keys, mode, message, f"in the mode '{shown(name)}'", findings)


def _behind(parent: Mapping, section: str, last: Node, fields: frozenset[str], where: str, findings: Findings) -> None:
    """Take the keys right behind a section that its last part can have for those of that part."""
    keys = list(parent.entries)
    behind = [parent.entries[key][0] for key in keys[keys.index(section) + 1 :]]
    strays = [key for key in behind if key in fields]
    if not strays or strays != behind[: len(strays)] or not isinstance(last, Mapping):
        return
    if not any(key in last.entries for key in strays):
        _moved(parent, strays, last, f"`{strays[0]}` stands beside `{section}`", where, findings)


def _moved(parent: Mapping, keys: Iterable[Key], target: Mapping, message: str, where: str, findings: Findings) -> None:
    first, *more = keys
    hint = f"indent {'it' if not more else 'these lines'}, to stand {where}"
    findings.add(first.place.diagnostic("HS201", message, hint))
    for key in (first, *more):
        target.entries[str(key)] = parent.entries.pop(str(key))


def _empty(value: Node) -> bool:
    return isinstance(value, Scalar) and value.kind == "null"


def _may_be_mode(value: Node) -> bool:
    """Whether a value could be that of a mode: empty, or with a key that modes have."""
    if isinstance(value, Mapping):
        return not value.entries or not _MODE.isdisjoint(value.entries)
    return _empty(value)
