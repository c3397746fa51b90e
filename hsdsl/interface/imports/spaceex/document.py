# pyright: basic
"""A SpaceEx model as data: its components, its conjunctions cut into relations, and its configuration.

A component has parameters, locations and transitions, or instances of other components. A configuration says which
component runs, where it starts, and for how long.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Any, TypeVar

from hsdsl.base.errors import Diagnostic, ModelError
from hsdsl.base.names import closest, shown
from hsdsl.language.expression import plain
from hsdsl.language.expression.parse import ExpressionError, Name, parse, walk
from hsdsl.language.expression.scope import RESERVED
from hsdsl.language.source.compose import decode
from hsdsl.language.source.nodes import Text
from hsdsl.language.source.xml import Element, Passage, read_xml

MOST_TEXTS = 100_000  # a product has the same few expressions in many places
value, names_in = lru_cache(MOST_TEXTS)(plain.value), lru_cache(MOST_TEXTS)(plain.names_in)

_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")
T = TypeVar("T")


@dataclass(frozen=True)
class Param:
    """A formal parameter: a label, a constant, or a variable."""

    name: str
    kind: str  # label, constant or variable
    local: bool
    element: Element


@dataclass(frozen=True)
class Location:
    """A location: what holds in it, and the derivatives."""

    name: str
    note: str
    invariant: tuple[Relation, ...]
    flow: tuple[Relation, ...]
    element: Element
    passing: bool  # whether time may pass: the flow is not `false`


@dataclass(frozen=True)
class Jump:
    """A transition between locations, by their ids; ``label`` is a formal name, empty where it has none."""

    source: str
    target: str
    label: str
    note: str
    guard: tuple[Relation, ...]
    assignment: tuple[Relation, ...]
    urgent: bool
    element: Element


@dataclass(frozen=True)
class Bind:
    """An instance of a component; ``values`` has a name or a number of the parent for each formal parameter."""

    component: str
    name: str
    values: dict[str, Passage]
    element: Element


@dataclass
class Component:
    """A component: a base one has locations, a network has instances."""

    name: str
    note: str
    element: Element
    params: dict[str, Param] = field(default_factory=dict[str, Param])
    locations: dict[str, Location] = field(default_factory=dict[str, Location])  # by id
    jumps: list[Jump] = field(default_factory=list[Jump])
    binds: list[Bind] = field(default_factory=list[Bind])


def components(path: str, data: bytes) -> dict[str, Component]:
    """The components of a file, in its order.

    Raises ModelError: no SpaceEx file, or a part that cannot be kept.
    """
    root = read_xml(path, data)
    if root.tag != "sspaceex":
        raise root.refusal("HS331", f"expected <sspaceex> or <sbml>, got <{shown(root.tag, 40)}>")
    found: dict[str, Component] = {}
    for element in root.all("component"):
        component = Component(element.attribute("id"), _note(element), element)
        for child in element.all("param"):
            _once(component.params, _name(child, "name"), _param(child), child)
        for child in element.all("location"):
            _once(component.locations, child.attribute("id"), _location(child), child)
        component.jumps += [_jump(child, component) for child in element.all("transition")]
        component.binds += [_bind(child) for child in element.all("bind")]
        if component.locations and component.binds:
            raise component.binds[0].element.refusal("HS331", "a component has locations or instances, not both")
        _once(found, element.attribute("id"), component, element)
    if not found:
        raise root.refusal("HS331", "the file has no <component>")
    return found


def _once(found: dict[str, T], name: str, entry: T, element: Element) -> None:
    if name in found:
        raise element.refusal("HS331", f"there are two of '{shown(name)}' here")
    found[name] = entry


def _name(element: Element, attribute: str) -> str:
    name = element.attribute(attribute)
    if element.attributes.get("type") == "label":
        return name
    if not _NAME.fullmatch(name):
        raise element.refusal("HS331", f"expected a name of letters, digits and underscores, got '{shown(name)}'")
    if name in RESERVED and name != "t":
        raise element.refusal("HS332", f"`{name}` has a meaning of its own in expressions", "rename it")
    return name


def _note(element: Element) -> str:
    return " ".join(" ".join(child.passage.text for child in element.all("note")).split())


def _param(element: Element) -> Param:
    kind = element.attributes.get("type", "real")
    if kind not in ("real", "int", "label") or any(element.attributes.get(d, "1") != "1" for d in ("d1", "d2")):
        message = "expected a label or a real number, got a vector, a matrix or another type"
        raise element.refusal("HS332", message, "write a parameter for each component")
    constant = element.attributes.get("dynamics", "any") == "const"
    meaning = "label" if kind == "label" else "constant" if constant else "variable"
    return Param(element.attribute("name"), meaning, element.attributes.get("local", "false") == "true", element)


def _location(element: Element) -> Location:
    name = element.attributes.get("name") or element.attribute("id")
    flow = element.passage_of("flow")
    passing = flow is None or flow.text.strip(" ()\t\n") != "false"
    invariant = element.passage_of("invariant")
    if invariant is not None and invariant.text.strip() == "false":
        raise invariant.refusal("HS332", "nothing can be in a location whose invariant is `false`")
    return Location(name, _note(element), _checked(invariant), _checked(flow) if passing else (), element, passing)


def _checked(passage: Passage | None) -> tuple[Relation, ...]:
    return tuple(map(checked, relations(passage)))


def _jump(element: Element, component: Component) -> Jump:
    ends = [element.attribute("source"), element.attribute("target")]
    for end in ends:
        if end not in component.locations:
            message = f"there is no location with the id '{shown(end)}' in '{shown(component.name)}'"
            raise element.refusal("HS331", message)
    label = element.passage_of("label")
    name = label.text.strip() if label else ""
    if label and name and (name not in component.params or component.params[name].kind != "label"):
        near = closest(name, [p.name for p in component.params.values() if p.kind == "label"])
        hint = f"did you mean '{near}'?" if near else "declare it as a <param> of type label"
        raise label.refusal("HS331", f"no label is called '{shown(name)}'", hint)
    guard, assignment = element.passage_of("guard"), element.passage_of("assignment")
    if guard is not None and guard.text.strip() == "false":
        raise guard.refusal("HS332", "a transition whose guard is `false` is never made", "remove it")
    urgent = element.attributes.get("asap", "false") == "true"
    return Jump(ends[0], ends[1], name, _note(element), _checked(guard), _checked(assignment), urgent, element)


def _bind(element: Element) -> Bind:
    values: dict[str, Passage] = {}
    for child in element.all("map"):
        _once(values, child.attribute("key"), child.passage, child)
    return Bind(element.attribute("component"), _name(element, "as"), values, element)


_AND = re.compile(r"&&?|\band\b|[()]")
_OF_SET = re.compile(r"[<>=]|\btrue\b")  # in parentheses that hold relations, and no expression
_DERIVATIVE = re.compile(r"([A-Za-z_]\w*)\s*'")
BOUNDED, DERIVED = "a derivative that is only bounded leaves the flow open", "write x' == and its derivative"
_RELATION = re.compile(r":=|==|<=|>=|!=|<|>|=")
_EITHER = re.compile(r"\|\|?|\bor\b|!(?!=)|\bnot\b")
MIRRORED = {"<=": ">=", ">=": "<=", "<": ">", ">": "<", "==": "=="}


@dataclass(frozen=True)
class Relation:
    """``left operator right`` with its place: ``start`` to ``end`` of a passage; ``primed`` where left had a prime."""

    left: str
    operator: str
    right: str
    passage: Passage
    start: int
    end: int
    primed: bool = False

    def fault(self, message: str, hint: str | None = None, code: str = "HS332") -> Diagnostic:
        """A diagnostic about it."""
        return self.passage.fault(code, message, hint, self.start, self.end)

    def refusal(self, message: str, hint: str | None = None, code: str = "HS332") -> ModelError:
        """The error that it cannot be kept."""
        return ModelError([self.fault(message, hint, code)])

    @property
    def text(self) -> str:
        """The relation as a model writes it."""
        return f"{self.left} {self.operator} {self.right}"

    @property
    def names(self) -> set[str]:
        """The names in it."""
        return {name for side in (self.left, self.right) for name in names_in(side)}

    def renamed(self, names: Mapping[str, str]) -> Relation:
        """The same with other names."""
        return replace(self, left=renamed(self.left, names), right=renamed(self.right, names))

    def mirrored(self) -> Relation:
        """The relation whose boundary is the same and which holds on its other side."""
        return replace(self, operator=MIRRORED[self.operator])

    @property
    def excess(self) -> Any:
        """The expression that is at most zero where it holds (for ``==``: zero), over plain symbols."""
        left, right = value(self.left), value(self.right)
        return right - left if self.operator in (">=", ">") else left - right


def relations(passage: Passage | None) -> list[Relation]:
    """The relations of a conjunction, in parentheses or not; none where it is empty or `true`.

    Raises ModelError: an alternative, a negation, or something that is no relation.
    """
    if passage is None or not passage.text.strip():
        return []
    if either := _EITHER.search(passage.text):
        message = "alternatives and negations cannot be kept: a set here is a conjunction of inequalities"
        hint = "write a transition or a location for each alternative"
        raise passage.refusal("HS332", message, hint, either.start(), either.end())
    return list(_conjunction(passage, 0, len(passage.text)))


def _conjunction(passage: Passage, start: int, end: int) -> Iterator[Relation]:
    """The relations of the parts between `and`, and of those within parentheses of their own."""
    depth, closing, begins = 0, [start], start
    for mark in [*_AND.finditer(passage.text, start, end), None]:
        if mark is not None and mark.group() in "()":
            depth += 1 if mark.group() == "(" else -1
            closing += [mark.end()] if depth == 0 else []
            continue
        if mark is not None and depth:
            continue
        part = passage.text[begins : (mark.start() if mark else end)]
        first, last = begins + len(part) - len(part.lstrip()), begins + len(part.rstrip())
        opened = [at for at in closing if first < at]
        if part.strip().startswith("(") and opened[:1] == [last] and _OF_SET.search(passage.text, first, last):
            yield from _conjunction(passage, first + 1, last - 1)
        elif part.strip() != "true":
            yield from _chain(passage, first, last)
        begins = mark.end() if mark else end


def _chain(passage: Passage, start: int, end: int) -> Iterator[Relation]:
    """The relations of ``a <= b <= c``."""
    operators = list(_RELATION.finditer(passage.text, start, end))
    if not operators:
        message = f"expected a relation such as `x >= 1`, got `{shown(passage.text[start:end], 40)}`"
        raise passage.refusal("HS332", message, None, start, end)
    cuts = [start, *(m.end() for m in operators)], [*(m.start() for m in operators), end]
    sides = list(zip(*cuts, strict=True))
    for operator, left, right in zip(operators, sides, sides[1:], strict=False):
        sign = "==" if operator.group() == "=" else operator.group()
        if sign == "!=":
            raise passage.refusal("HS332", "`!=` is no closed set", None, start, end)
        yield _related(passage, left, sign, right, (start, end))


def _related(
    passage: Passage, left: tuple[int, int], sign: str, right: tuple[int, int], whole: tuple[int, int]
) -> Relation:
    """A relation, with a derivative on its left where it has one."""
    a, b = (passage.text[slice(*side)].strip() for side in (left, right))
    if "'" in b and "'" not in a and sign in MIRRORED:
        left, right, sign, a, b = right, left, MIRRORED[sign], b, a
    negative = a.startswith("-") and _DERIVATIVE.fullmatch(a[1:].strip())
    if "'" not in a + b:
        return Relation(_side(passage, *left), sign, _side(passage, *right), passage, *whole)
    name = negative or _DERIVATIVE.fullmatch(a)
    if name and "'" not in b:
        other = _side(passage, *right)
        sign, other = (MIRRORED[sign], f"-({other})") if negative and sign in MIRRORED else (sign, other)
        return Relation(name[1], sign, other, passage, *whole, primed=True)
    message = BOUNDED if sign not in ("==", ":=") else "a derivative belongs on the left-hand side"
    raise passage.refusal("HS332", message, DERIVED, *whole)


def _side(passage: Passage, start: int, end: int) -> str:
    """An expression as a model writes it."""
    raw = passage.text[start:end]
    text = re.sub(r"^- +", "-", " ".join(raw.split()).replace("^", "**"))
    try:
        parse(text)
    except ExpressionError as error:
        at = start + len(raw) - len(raw.lstrip()) + error.start  # off by what blanks and `^` have changed
        raise passage.refusal(error.code, error.message, error.hint, at, end) from None
    return text


def renamed(text: str, names: Mapping[str, str]) -> str:
    """An expression with other names, and nothing else changed."""
    if names.keys().isdisjoint(names_in(text)):
        return text
    for node in reversed([node for node in walk(parse(text)) if isinstance(node, Name)]):
        if node.name in names:
            text = text[: node.start] + names[node.name] + text[node.end :]
    return text


def within(text: str) -> str:
    """An expression to put in place of a name."""
    return text if re.fullmatch(r"[\w.]+", text) else f"({text})"


def checked(relation: Relation) -> Relation:
    """The relation, whose sides have values.

    Raises ModelError: they do not.
    """
    try:
        for side in (relation.left, relation.right):
            value(side)
    except ExpressionError as error:
        raise relation.refusal(error.message, error.hint, error.code) from None
    return relation


_ENTRY = re.compile(r"[ \t]*([A-Za-z][\w-]*)[ \t]*=[ \t]*(\"[^\"]*\"|'[^']*'|[^#\n\"']*)[ \t]*(?:#[^\n]*)?(?:\n|$)")
_BLANK = re.compile(r"[ \t]*(?:#[^\n]*)?(?:\n|$)")
_AT = re.compile(r"\bloc\s*\(\s*([\w.]*)\s*\)\s*={1,2}\s*([A-Za-z_]\w*)")
_QUALIFIED = re.compile(r"\b[A-Za-z_]\w*(?:\.[A-Za-z_]\w*)+")


@dataclass(frozen=True)
class Configuration:
    """The entries of a configuration that matter here.

    ``locations`` has (instance, location, place); ``values`` the relations of `initially` with dots in names written
    as ``__dot__``; ``others`` what is only named in comments.
    """

    system: Passage | None = None
    initially: Passage | None = None
    horizon: Passage | None = None
    locations: tuple[tuple[str, str, tuple[int, int]], ...] = ()
    values: tuple[Relation, ...] = ()
    others: dict[str, str] = field(default_factory=dict[str, str])


def configuration(path: str, data: bytes) -> Configuration:
    """Read a configuration.

    Raises ModelError: a line that is no entry, or an initial set that cannot be read.
    """
    file = decode(path, data)
    text = file.content.replace("\r\n", "\n")
    entries: dict[str, Passage] = {}
    at = 0
    while at < len(text):
        match = _BLANK.match(text, at) or _ENTRY.match(text, at)
        line = text.count("\n", 0, at) + 1
        if match is None:
            raise ModelError([file.fault("HS333", 'expected an entry such as system = "ball"', line, 1)])
        if match.re is _ENTRY:
            quoted = match[2][:1] in ("'", '"') and match[2]
            entries[match[1]] = _passage(file, text, match.start(2) + bool(quoted), match.end(2) - bool(quoted))
        at = match.end()
    used = ("system", "initially", "time-horizon")
    others = {key: shown(entry.text, None) for key, entry in entries.items() if key not in used}
    found = {key: entries.get(key) for key in used}
    initially = found["initially"]
    if initially is None:
        return Configuration(found["system"], None, found["time-horizon"], others=others)
    places = tuple((m[1], m[2], m.span()) for m in _AT.finditer(initially.text))
    bare = _AT.sub(lambda m: "true".ljust(len(m[0])), initially.text)
    bare = re.sub(r"&&?(?=\s*$)", lambda m: " " * len(m[0]), bare)
    bare = _QUALIFIED.sub(lambda m: m[0].replace(".", DOT), bare)
    values = tuple(map(checked, relations(Passage(initially.file, bare, initially.starts))))
    return Configuration(found["system"], initially, found["time-horizon"], places, values, others)


def _passage(file: Text, text: str, start: int, end: int) -> Passage:
    """A part of the file: a piece a line."""
    starts: list[tuple[int, int, int]] = []
    for offset in (start, *(m.end() for m in re.finditer("\n", text[:end]) if m.end() > start)):
        line = text.count("\n", 0, offset) + 1
        starts.append((offset - start, line, offset - (text.rfind("\n", 0, offset) + 1) + 1))
    return Passage(file, text[start:end], tuple(starts))


DOT = "__dot__"
