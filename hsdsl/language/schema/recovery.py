"""Nodes without the faults that were reported, so that the rest of the file is checked in the same reading."""

from __future__ import annotations

from hsdsl.language.schema.value_suggestions import assigned
from hsdsl.language.source import Key, Mapping, Node, NodePath, Scalar, Sequence, SourceRange, absent, descend, is_empty

_LISTS_OF_MAPPINGS = (("transitions",), ("states",), ("reference",), ("scene",))
_CONTAINERS = ("parameters", "functions", "inputs", "let", "modes", "outputs", "flow", "initial", "experiment")
_LISTS_OF_NAMES = ("of", "unknowns")
_OF_AN_INPUT = ("times", "values", "file")  # an input that lacks one is dropped as a whole
_INDISPENSABLE = ("modes", "initial", "experiment")


def recover(root: Node, path: NodePath, fault: str, meant: str | None, target: NodePath = ()) -> bool:
    """Take one fault out of the nodes, in place; False where nothing sensible would be left.

    ``path`` leads from the root to the fault; ``"[key]"`` after a key means the key itself. ``fault`` is pydantic's own
    type of error, or the code of one of ours. An unknown key is taken for the key ``meant``, or moved to the path
    ``target``, where these are known.
    """
    if not path:
        return False
    last, parent = path[-1], descend(root, path[:-1])
    if last == "[key]":
        above, key = descend(root, path[:-2]), str(path[-2])
        return _split_equation(above, key) or _renamed(above, key, meant) or _dropped(root, path[:-1])
    match fault:
        case "extra_forbidden":
            return _renamed(parent, str(last), meant) or _moved(root, parent, str(last), target) or _dropped(root, path)
        case "missing" if last in _OF_AN_INPUT:
            return _replaced(descend(root, path[:-2]), path[-2], None)
        case "missing":
            return _filled(parent, str(last))
        case "HS206":
            return _replaced(parent, last, "1")
        case "HS203" if isinstance(last, int) and path[-2:-1] in _LISTS_OF_MAPPINGS and isinstance(parent, Sequence):
            object.__setattr__(parent, "items", parent.items[:last] + parent.items[last + 1 :])
            return True
        case "HS203" if last in _LISTS_OF_NAMES and isinstance(parent, Mapping):
            return _listed(parent, str(last))
        case "HS121" | "HS203" | "HS205" if last not in _CONTAINERS and path[-2:-1] != ("modes",):
            return _replaced(parent, last, None)
        case "HS204":
            return _dropped(root, path)
        case _:
            return False


def _renamed(parent: Node | None, key: str, meant: str | None) -> bool:
    if not isinstance(parent, Mapping) or key not in parent.entries or meant is None or meant in parent.entries:
        return False
    parent.rename(key, meant)
    return True


def _split_equation(parent: Node | None, key: str) -> bool:
    """Take the key ``x = 1``, which has no value, for the key x with the value 1."""
    equation = assigned(key)
    if not isinstance(parent, Mapping) or key not in parent.entries or not equation or equation[0] in parent.entries:
        return False
    name, text = equation
    place, value = parent.entries[key][0].place, parent.entries[key][1]
    if is_empty(value):
        value = _after_equals(place, key, text) if text else absent(place)
    parent.rename(key, name, value)
    return True


def _after_equals(place: SourceRange, key: str, text: str) -> Scalar:
    """The last part of a key, as a value with its place, where the file has the key in just this form."""
    first, line, column = place.start
    at = key.rfind(text)
    begin, end = first + at, first + at + len(text)
    if place.text.content[begin:end] != text:
        return Scalar(text, True, place)
    own = SourceRange(place.text, (begin, line, column + at), (end, line, column + at + len(text)))
    return Scalar(text, True, own)


def _moved(root: Node, parent: Node | None, key: str, target: NodePath) -> bool:
    above = descend(root, target[:-1]) if target else None
    if above is not None and is_empty(above) and isinstance(root, Mapping):
        name = str(target[0])
        above = Mapping({}, above.place)
        root.entries[name] = (root.entries[name][0], above)
    if not (isinstance(above, Mapping) and isinstance(parent, Mapping) and key in parent.entries):
        return False
    if key in above.entries:
        return False
    above.entries[key] = parent.entries.pop(key)
    return True


def _dropped(root: Node, path: NodePath) -> bool:
    parent = descend(root, path[:-1])
    return isinstance(parent, Mapping) and parent.entries.pop(str(path[-1]), None) is not None


def _filled(parent: Node | None, key: str) -> bool:
    if not isinstance(parent, Mapping) or key in _INDISPENSABLE:
        return False
    if key not in parent.entries:  # else it was misspelt, and is renamed by now
        value = Scalar("1", True, parent.place) if key == "hsdsl" else absent(parent.place)
        parent.entries[key] = (Key.at(key, parent.place), value)
    return True


def _listed(parent: Mapping, key: str) -> bool:
    """Take ``of: x, y`` for ``of: [x, y]``."""
    name, value = parent.entries[key]
    names = value.value.replace(",", " ").split() if isinstance(value, Scalar) else []
    parent.entries[key] = (name, Sequence(tuple(Scalar(each, True, value.place) for each in names), value.place))
    return bool(names)


def _replaced(parent: Node | None, step: int | str, text: str | None) -> bool:
    def substitute(place: SourceRange) -> Scalar:
        return absent(place) if text is None else Scalar(text, True, place)

    if isinstance(parent, Mapping) and step in parent.entries:
        key, value = parent.entries[str(step)]
        parent.entries[str(step)] = (key, substitute(value.place))
        return True
    if isinstance(parent, Sequence) and isinstance(step, int):
        items = list(parent.items)
        items[step] = substitute(items[step].place)
        object.__setattr__(parent, "items", tuple(items))
        return True
    return False
