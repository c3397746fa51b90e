"""Faults of a document in the language's words: what each key was probably meant to be, and what is missing.

`reread` takes each fault out of the nodes when it is reported, and reads on: a misspelt key is taken for the one
meant, a wrong value for one that nothing more is reported of.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from hsdsl.base.errors import Diagnostic, Findings, ModelError, Span
from hsdsl.base.names import closest, shown
from hsdsl.language.diagnosis import OTHER_NAMES, TABLES
from hsdsl.language.diagnosis.corrections import correct, rename_states
from hsdsl.language.diagnosis.values import assigned, undifferentiated
from hsdsl.language.diagnosis.yaml_text import Faults
from hsdsl.language.files import ModelFiles
from hsdsl.language.schema import kind_of, read
from hsdsl.language.schema.documents import KINDS, SHAPES, ModelDocument, keys_of, plain
from hsdsl.language.schema.fields import described
from hsdsl.language.source.compose import Unread, compose
from hsdsl.language.source.nodes import (
    Key,
    Mapping,
    Node,
    NodePath,
    Scalar,
    Sequence,
    SourceRange,
    Text,
    absent,
    child,
    descend,
    is_bare,
    is_empty,
    keys,
)

_MOST_READINGS = 8
_MARKUP = "`hsdsl import` makes one of a file of SBML or SpaceEx"
_TAGS = "|".join(("expression", "mapping", "list", "samples", "file", *KINDS))  # of a union; no key in the file
_TAG = re.compile(rf"<(?:{_TAGS})>|function-\w+\[.*")
_MODE = ("modes", "*")
_MOST_PARTS = 6  # a transition has so many keys
_HOMES: dict[tuple[str, ...], str] = {
    _MODE: "in a mode",
    (*_MODE, "transitions", "*"): "in a transition of a mode",
    ("experiment",): "under `experiment`",
}
_LISTS_OF_MAPPINGS = {"transitions", "states", "reference", "scene"}
_CONTAINERS = ("parameters", "functions", "inputs", "let", "modes", "outputs", "flow", "initial", "experiment")
_LISTS_OF_NAMES = ("of", "unknowns")
_OF_AN_INPUT = ("times", "values", "file")  # an input that lacks one is dropped as a whole
_INDISPENSABLE = ("modes", "initial", "experiment")


def reread(
    files: ModelFiles, findings: Findings, failure: Unread | ModelError
) -> tuple[Text, Node, dict[str, bytes], ModelDocument]:
    """Read a model again where a stage has failed: faults go to ``findings``, the rest is read as it was meant.

    Raises ModelError: when too little is left to be called a model; the failure, where the document has no fault.
    """
    text, root, data = compose(files, Faults(findings))
    try:
        document = read(root)
    except Unread:
        return text, root, data, _recovered(root, findings)
    elaborated = isinstance(failure, ModelError)
    if (elaborated or findings.diagnostics) and rename_states(root, findings):
        document = read(root)
    elif elaborated:
        raise failure
    return text, root, data, document


def _recovered(root: Node, findings: Findings) -> ModelDocument:
    """The document of nodes that have faults."""
    kind = kind_of(root)
    correct(root, findings)
    faulty: set[NodePath] = set()  # values that are reported, and left out since
    for _ in range(_MOST_READINGS):
        try:
            return kind.model_validate(plain(root))
        except ValidationError as error:
            faults = [_Fault(root, details) for details in error.errors(include_url=False)]
        wrong = {fault.plain[:-1] for fault in faults if fault.path[-1:] == ("[key]",)}
        faults = [fault for fault in faults if fault.code != "HS121" or fault.plain not in wrong]  # as of `{v = 1}`
        targets = {fault.target for fault in faults}
        for fault in faults:
            if fault.plain not in faulty and (
                fault.code != "missing"
                or not (fault.path in targets or fault.plain[:-1] in faulty or fault.is_of_part or fault.is_of_event)
            ):
                findings.add(fault.diagnostic())
        faulty |= {fault.plain for fault in faults if fault.code == "HS203"}
        if not all([fault.taken_out() for fault in reversed(faults)]):
            break
    findings.raise_if_any()
    raise AssertionError


class _Fault:
    """A fault that pydantic finds: its type or our code, and the path to it; ``plain`` is the path in the nodes.

    An unknown key is taken for the key ``meant``, or moved to the path ``target``, where these are known.
    """

    def __init__(self, root: Node, details: ErrorDetails) -> None:
        self.root, self.code, self.path, self.context = root, details["type"], details["loc"], details.get("ctx", {})
        self.plain = _untagged(self.path)
        self.parent = descend(root, self.plain[:-1])
        self.pattern = _pattern(self.path[:-1])
        self.meant: str | None = None
        self.target: NodePath = ()
        last = str(self.path[-1]) if self.path else ""
        if self.code == "HS205" and last == "[key]":
            equation = assigned(str(self.path[-2]))
            self.meant = equation[0] if equation else undifferentiated(str(self.path[-2]))
        if self.code == "extra_forbidden":
            self.meant = key_meant(last, keys_of(*self.pattern), self.parent)
        if self.code == "extra_forbidden" and self.meant is None:
            self.target = self._home_in_file(last)
        else:
            self.target = (*self.path[:-1], self.meant or "")

    def _home_in_file(self, key: str) -> NodePath:
        """The path that a key in the wrong place belongs to, if there is one and it is free; else an empty one."""
        pattern = ("modes",) if _is_a_mode(descend(self.root, self.plain)) else _home(key)
        if not isinstance(self.root, Mapping) or pattern not in (("modes",), ("experiment",)):
            return ()
        above = child(self.root, pattern[0])
        free = is_empty(above) or (isinstance(above, Mapping) and key not in above.entries)
        return (*pattern, key) if above is not None and free else ()

    @property
    def is_of_part(self) -> bool:
        """Whether a missing key is reported already: a dash too many makes two transitions of one."""
        part, own = self._part()
        return part == 0 or (part > 0 and self.path[-1] == "to" and "when" not in own)

    def _part(self) -> tuple[int, Collection[str]]:
        """Which part of a transition, from 0, an item is whose key is missing, and its keys; -1 where it is whole."""
        match self.path:
            case ("modes", mode, "transitions", int(index), _):
                items = descend(self.root, ("modes", mode, "transitions"))
                own = keys(items.items[index]) if isinstance(items, Sequence) else ()
                return _part_of_transition(items, index), own
            case _:
                return -1, ()

    @property
    def is_of_event(self) -> bool:
        """Whether a missing key is not needed, by a key that is `event` or was meant to be."""
        fields = keys_of(*self.pattern)
        if self.path[-1] not in ("when", "to") or "event" not in fields:
            return False
        return any(
            key == "event" or (key not in fields and key_meant(key, fields, self.parent) == "event")
            for key in keys(self.parent)
        )

    def diagnostic(self) -> Diagnostic:
        """The fault in the language's words, at its place."""
        path, code = self.path, self.code
        if code == "extra_forbidden":
            key, fields = str(path[-1]), keys_of(*self.pattern)
            message = f"unknown key '{shown(key)}' in {SHAPES[self.pattern][1]}"
            hint = _unknown_key_hint(key, self.meant, fields, descend(self.root, self.plain))
            return _find(self.root, path, key=True).diagnostic("HS201", message, hint)
        if code == "missing":
            return self._missing()
        place = _find(self.root, path)
        if not code.startswith("HS"):
            return place.diagnostic("HS204", "this value is not possible here")
        if not path:
            other = isinstance(self.root, Scalar) and self.root.value.lstrip().startswith("<")
            hint = f"a model begins with hsdsl: 1; {_MARKUP if other else 'is this file one?'}"
            return place.diagnostic(code, f"expected a model, got {described(plain(self.root))}", hint)
        message, hint, last = self.context["message"], self.context.get("hint"), self.plain[-1]
        if code == "HS205" and isinstance(last, int) and isinstance(name := descend(self.root, self.plain), Scalar):
            bare = name.value.strip("'\"")  # of a list, where nothing has a derivative
            hint = f"write {shown(bare)}, with quotes on both sides or on none" if bare != name.value else hint
        if code == "HS121" and isinstance(last, str):
            message, hint = f"'{shown(last)}' has no value", f"write {shown(last)}: and {hint}"
        return place.diagnostic(code, message, (self._by_modes() if code == "HS203" else None) or hint)

    def _by_modes(self) -> str | None:
        """The hint for a value of the whole file that is given mode by mode."""
        path, value, modes = self.plain, descend(self.root, self.plain), keys(child(self.root, "modes"))
        if len(path) != 2 or path[0] not in ("outputs", "let") or not keys(value) or not {*keys(value)} <= {*modes}:
            return None
        return f"give it in each mode, as {path[0]}: {{{shown(str(path[1]))}: ...}} below {shown(keys(value)[0])}"

    def _missing(self) -> Diagnostic:
        above, key = self.plain[:-1], str(self.path[-1])
        place = _find(self.root, self.path[:-1], key=True)
        span = place.span
        if not above:
            span = Span(span.path, 1, 1)
        elif place.start[1] != place.end[1] or isinstance(above[-1], int):
            span = Span(span.path, span.line, span.column)
        hint = TABLES["missing"].get(key)
        if self._part()[0] > 0:
            hint = "remove the dash here, which begins another transition"
        elif key == "when" and "if" in keys(self.parent):
            hint = "write when: and the inequality at which it fires; `if` only says which part of it counts"
        elif key == "mode":
            modes = child(self.root, "modes")
            names = keys(self.root if modes is None else modes)
            hint = f"write mode: {names[0]}" if len(names) == 1 else "write mode: and the mode that a run starts in"
        message = f"the key '{key}' is missing in {SHAPES[self.pattern][1]}"
        return place.text.diagnostic("HS202", message, span, hint)

    def taken_out(self) -> bool:
        """Take the fault out of the nodes, in place; False where nothing sensible would be left."""
        path, parent = self.plain, descend(self.root, self.plain[:-1])
        if not path:
            return False
        last = path[-1]
        if last == "[key]":
            above, key = descend(self.root, path[:-2]), str(path[-2])
            return _split_equation(above, key) or _renamed(above, key, self.meant) or _dropped(above, key)
        match self.code:
            case "extra_forbidden":
                target = self.target if self.meant is None else ()
                return (
                    _renamed(parent, str(last), self.meant)
                    or _moved(self.root, parent, str(last), target)
                    or _dropped(parent, str(last))
                )
            case "missing" | "HS203" if last in _OF_AN_INPUT:
                return _replaced(descend(self.root, path[:-2]), path[-2], None)
            case "missing":
                return _filled(parent, str(last))
            case "HS206":
                return _replaced(parent, last, "1")
            case "HS203" if (
                isinstance(last, int) and isinstance(parent, Sequence) and {*path[-2:-1]} & _LISTS_OF_MAPPINGS
            ):
                object.__setattr__(parent, "items", parent.items[:last] + parent.items[last + 1 :])
                return True
            case "HS203" if last in _LISTS_OF_NAMES and isinstance(parent, Mapping):
                return _listed(parent, str(last))
            case "HS121" | "HS203" | "HS205" if last not in _CONTAINERS and path[-2:-1] != ("modes",):
                return _replaced(parent, last, None)
            case "HS204":
                return _dropped(parent, str(last))
            case _:
                return False


def key_meant(key: str, fields: Iterable[str], parent: Node | None) -> str | None:
    """The field that an unknown key was probably meant to be: by its name in other tools, or by its spelling."""
    fields, present = list(fields), keys(parent)
    named = [field for field in OTHER_NAMES.get(key, ()) if field in fields and field not in present]
    if named:
        return named[0]
    elsewhere = _not_needed(key, fields) if key not in fields else None
    elsewhere = elsewhere or _home(key) or _is_a_mode(child(parent, key))
    return None if elsewhere else closest(key, fields)


def _not_needed(key: str, fields: Iterable[str]) -> str | None:
    """What to write in the place of a key that no mapping has, or not the one of these fields."""
    return TABLES["not_needed"].get(key) or (TABLES["of_models"].get(key) if "hsdsl" in fields else None)


def _unknown_key_hint(key: str, meant: str | None, fields: Iterable[str], value: Node | None) -> str:
    if ":" in key:
        return "write a space after the colon"
    if meant is not None:
        return f"did you mean '{meant}'?"
    if instead := _not_needed(key, fields):
        return instead
    if _is_a_mode(value):
        return f"a mode belongs under `modes`: indent '{key}' like the others"
    home = _home(key)
    return f"`{key}` belongs {_HOMES[home]}" if home else "keys here: " + ", ".join(fields)


def _home(key: str) -> tuple[str, ...] | None:
    """The kind of mapping that has a key of this name; of the model's own keys none."""
    return next((pattern for pattern in _HOMES if key in keys_of(*pattern)), None)


def _is_a_mode(value: Node | None) -> bool:
    """Whether a mapping looks like a mode."""
    return not {"flow", "transitions"}.isdisjoint(keys(value))


def _part_of_transition(transitions: Node | None, index: int) -> int:
    """Which part, from 0, of a transition that dashes too many make several items of an item of ``transitions`` is.

    It is -1 where the item is whole, or where its missing keys are nowhere near.
    """
    items = transitions.items if isinstance(transitions, Sequence) else ()
    near = {n: set(keys(items[n])) for n in range(max(0, index - _MOST_PARTS), min(len(items), index + _MOST_PARTS))}
    present = near.get(index, set[Key]())
    ends = [index, index]
    for side, step in ((0, -1), (1, 1)):
        while near.get(ends[side] + step) and not near[ends[side] + step] & present:
            ends[side] += step
            present = present | near[ends[side]]
    first, last = ends
    needed = {"when", "to"}
    parts = first < last and needed <= present and all(needed - near[n] for n in range(first + 1, last + 1))
    return index - first if parts and near[index] else -1


def _untagged(path: NodePath) -> NodePath:
    return tuple(step for step in path if isinstance(step, int) or not _TAG.fullmatch(step))


def _pattern(path: NodePath) -> tuple[str, ...]:
    """The kind of mapping at a path: a key of :data:`SHAPES`."""
    names = _untagged(path)
    exact = (pattern for pattern in SHAPES if _fits(pattern, path))
    return next(exact, None) or next((pattern for pattern in SHAPES if _fits(_untagged(pattern), names)), ())


def _fits(pattern: NodePath, path: NodePath) -> bool:
    return len(pattern) == len(path) and all(p in ("*", step) for p, step in zip(pattern, path, strict=True))


def _find(root: Node, path: NodePath, key: bool = False) -> SourceRange:
    """The place of a value, or of its key; of the nearest node above it that exists."""
    node, place = root, root.place
    for number, step in enumerate(path):
        if isinstance(node, Mapping) and step in node.entries:
            name, value = node.entries[str(step)]
            rest = path[number + 1 :]
            by_key = (key and not any(_untagged(rest))) or rest[:1] == ("[key]",) or is_bare(value)
            node, place = value, name.place if by_key else value.place
        elif isinstance(node, Sequence) and isinstance(step, int) and step < len(node.items):
            node = node.items[step]
            place = node.place
    return place


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


def _dropped(parent: Node | None, key: str) -> bool:
    return isinstance(parent, Mapping) and parent.entries.pop(key, None) is not None


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
