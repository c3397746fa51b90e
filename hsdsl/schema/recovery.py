"""Faults taken out of the nodes once reported, so that the rest of the file is checked in the same reading."""

from __future__ import annotations

from hsdsl.schema.forms import assigned
from hsdsl.schema.suggestions import Location
from hsdsl.source import Key, Mapping, Node, Scalar, Sequence, SourceRange, absent

_LISTS_OF_MAPPINGS = (("transitions",), ("states",), ("reference",))
_WITH_ITS_ENTRY = ("times", "values", "file")
_NOT_WITHOUT = ("modes", "initial", "experiment")


def repair(root: Node, location: Location, fault: str, meant: str | None, belongs: Location = ()) -> bool:
    """Take one fault out of the nodes, in place; False where nothing sensible would be left.

    Parameters
    ----------
    root : Node
        The document.
    location : tuple
        Keys and indices down to the fault; ``"[key]"`` behind a key means the key itself.
    fault : str
        pydantic's own type of error, or the code of one of ours.
    meant : str or None
        For an unknown key, the one to take it for.
    belongs : tuple
        For a key in the wrong place, where to take it to stand; empty where that is not known.
    """
    if not location:
        return False
    if location[-1] == "[key]":
        above = descend(root, location[:-2])
        key = str(location[-2])
        return _equated(above, key) or _renamed(above, key, meant) or _drop(root, location[:-1])
    parent = descend(root, location[:-1])
    match fault:
        case "extra_forbidden":
            key = str(location[-1])
            return _renamed(parent, key, meant) or _moved(root, parent, key, belongs) or _drop(root, location)
        case "missing" if location[-1] in _WITH_ITS_ENTRY:
            return _replaced(descend(root, location[:-2]), location[-2], None)
        case "missing":
            return _filled(parent, str(location[-1]))
        case "HS206":
            return _replaced(parent, location[-1], "1")
        case "HS203" if isinstance(location[-1], int) and location[-2:-1] in _LISTS_OF_MAPPINGS:
            return _removed(parent, location[-1])
        case "HS121" | "HS203" | "HS205" if not _holds_more(location):
            return _replaced(parent, location[-1], None)
        case "HS204":
            return _drop(root, location)
        case _:
            return False


def _holds_more(location: Location) -> bool:
    """Whether a mapping or a list belongs there, whose names others may use."""
    containers = ("parameters", "inputs", "let", "modes", "outputs", "flow", "initial", "experiment")
    return location[-1] in containers or location[-2:-1] == ("modes",)


def descend(root: Node, location: Location) -> Node | None:
    """What stands at the end of a way of keys and indices, if anything."""
    node: Node | None = root
    for step in location:
        if isinstance(node, Mapping) and step in node.entries:
            node = node.entries[str(step)][1]
        elif isinstance(node, Sequence) and isinstance(step, int) and step < len(node.items):
            node = node.items[step]
        elif not (step == 0 and isinstance(node, Mapping)):  # a single reference is a list of one
            return None
    return node


def _renamed(parent: Node | None, key: str, meant: str | None) -> bool:
    if not isinstance(parent, Mapping) or key not in parent.entries or meant is None or meant in parent.entries:
        return False
    found, value = parent.entries.pop(key)
    parent.entries[meant] = (Key.at(meant, found.place), value)
    return True


def _equated(parent: Node | None, key: str) -> bool:
    """Take the key ``x = 1``, which has no value, for the key x with the value 1."""
    equation = assigned(key)
    if (
        not isinstance(parent, Mapping)
        or key not in parent.entries
        or equation is None
        or equation[0] in parent.entries
    ):
        return False
    found, value = parent.entries.pop(key)
    name, text = equation
    if isinstance(value, Scalar) and value.kind == "null":
        value = _behind(found.place, key, text) if text else absent(found.place)
    parent.entries[name] = (Key.at(name, found.place), value)
    return True


def _behind(place: SourceRange, key: str, text: str) -> Scalar:
    """The last part of a key that stands in the file as it is read, as a value with its place."""
    first, line, column = place.start
    at = key.rfind(text)
    begin = (first + at, line, column + at)
    written = place.text.content[begin[0] : begin[0] + len(text)] == text
    return Scalar(text, True, SourceRange(place.text, begin, (begin[0] + len(text), line, begin[2] + len(text)))
                  if written else place)  # fmt: skip


def _moved(root: Node, parent: Node | None, key: str, belongs: Location) -> bool:
    above = descend(root, belongs[:-1]) if belongs else None
    if isinstance(above, Scalar) and above.kind == "null" and isinstance(root, Mapping):
        name = str(belongs[0])
        above = Mapping({}, above.place)
        root.entries[name] = (root.entries[name][0], above)
    if not (isinstance(above, Mapping) and isinstance(parent, Mapping) and key in parent.entries):
        return False
    if key in above.entries:
        return False
    above.entries[key] = parent.entries.pop(key)
    return True


def _drop(root: Node, location: Location) -> bool:
    parent = descend(root, location[:-1])
    if isinstance(parent, Mapping):
        return parent.entries.pop(str(location[-1]), None) is not None
    return False


def _removed(parent: Node | None, step: int) -> bool:
    if not isinstance(parent, Sequence):
        return False
    object.__setattr__(parent, "items", parent.items[:step] + parent.items[step + 1 :])
    return True


def _filled(parent: Node | None, key: str) -> bool:
    if isinstance(parent, Scalar) or parent is None or key in _NOT_WITHOUT:
        return False
    if not isinstance(parent, Mapping):
        return False
    if key in parent.entries:  # misspelt, and renamed by now
        return True
    value = Scalar("1", True, parent.place) if key == "hsdsl" else absent(parent.place)
    parent.entries[key] = (Key.at(key, parent.place), value)
    return True


def _replaced(parent: Node | None, step: int | str, text: str | None) -> bool:
    if isinstance(parent, Mapping) and step in parent.entries:
        key, value = parent.entries[str(step)]
        parent.entries[str(step)] = (key, _standing_in(value.place, text))
        return True
    if isinstance(parent, Sequence) and isinstance(step, int):
        items = list(parent.items)
        items[step] = _standing_in(items[step].place, text)
        object.__setattr__(parent, "items", tuple(items))
        return True
    return False


def _standing_in(place: SourceRange, text: str | None) -> Scalar:
    return absent(place) if text is None else Scalar(text, True, place)
