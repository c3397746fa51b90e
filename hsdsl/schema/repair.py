"""Faults taken out of the nodes once reported, so that the rest of the file is checked in the same reading."""

from __future__ import annotations

from hsdsl.source import Key, Mapping, Node, Place, Scalar, Sequence, absent

_Location = tuple[int | str, ...]
_LISTS_OF_MAPPINGS = (("transitions",), ("states",), ("reference",))
_WITH_ITS_ENTRY = ("times", "values", "file")
_NOT_WITHOUT = ("modes", "initial", "experiment")


def repair(root: Node, location: _Location, fault: str, meant: str | None) -> bool:
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
    """
    if not location:
        return False
    if location[-1] == "[key]":
        above = _descend(root, location[:-2])
        return _renamed(above, str(location[-2]), meant) or _drop(root, location[:-1])
    parent = _descend(root, location[:-1])
    match fault:
        case "extra_forbidden":
            return _renamed(parent, str(location[-1]), meant) or _drop(root, location)
        case "missing" if location[-1] in _WITH_ITS_ENTRY:
            return _replaced(_descend(root, location[:-2]), location[-2], None)
        case "missing":
            return _filled(parent, str(location[-1]))
        case "HS206":
            return _replaced(parent, location[-1], "1")
        case "HS203" if isinstance(location[-1], int) and location[-2:-1] in _LISTS_OF_MAPPINGS:
            return _removed(parent, location[-1])
        case "HS203" | "HS205" if not _holds_more(location):
            return _replaced(parent, location[-1], None)
        case "HS204":
            return _drop(root, location)
        case _:
            return False


def _holds_more(location: _Location) -> bool:
    """Whether a mapping or a list belongs there, whose names others may use."""
    containers = ("parameters", "inputs", "let", "modes", "outputs", "flow", "initial", "experiment")
    return location[-1] in containers or location[-2:-1] == ("modes",)


def _descend(root: Node, location: _Location) -> Node | None:
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
    if not isinstance(parent, Mapping) or meant is None or meant in parent.entries:
        return False
    found, value = parent.entries.pop(key)
    parent.entries[meant] = (Key.at(meant, found.place), value)
    return True


def _drop(root: Node, location: _Location) -> bool:
    parent = _descend(root, location[:-1])
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


def _standing_in(place: Place, text: str | None) -> Scalar:
    return absent(place) if text is None else Scalar(text, True, place)
