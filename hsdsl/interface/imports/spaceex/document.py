"""Components of a SpaceEx file: parameters, locations and transitions, or instances of other components."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from typing import TypeVar

from hsdsl.base.errors import ModelError
from hsdsl.base.names import closest, shown
from hsdsl.interface.imports.spaceex.formula import Relation, checked, relations
from hsdsl.language.expression.scope import RESERVED
from hsdsl.language.source.xml import Element, Passage, read_xml

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
        raise ModelError([root.fault("HS331", f"expected <sspaceex> or <sbml>, got <{shown(root.tag, 40)}>")])
    found: dict[str, Component] = {}
    for element in root.all("component"):
        _once(found, element.attribute("id"), _component(element), element)
    if not found:
        raise ModelError([root.fault("HS331", "the file has no <component>")])
    return found


def _component(element: Element) -> Component:
    component = Component(element.attribute("id"), _note(element), element)
    for child in element.all("param"):
        _once(component.params, _name(child, "name"), _param(child), child)
    for child in element.all("location"):
        _once(component.locations, child.attribute("id"), _location(child), child)
    component.jumps += [_jump(child, component) for child in element.all("transition")]
    component.binds += [_bind(child) for child in element.all("bind")]
    if component.locations and component.binds:
        raise ModelError(
            [component.binds[0].element.fault("HS331", "a component has locations or instances, not both")]
        )
    return component


def _once(found: dict[str, T], name: str, entry: T, element: Element) -> None:
    if name in found:
        raise ModelError([element.fault("HS331", f"there are two of '{shown(name)}' here")])
    found[name] = entry


def _name(element: Element, attribute: str) -> str:
    name = element.attribute(attribute)
    if not _NAME.fullmatch(name):
        message = f"expected a name of letters, digits and underscores, got '{shown(name)}'"
        raise ModelError([element.fault("HS331", message)])
    if name in RESERVED and name != "t":
        raise ModelError([element.fault("HS332", f"`{name}` has a meaning of its own in expressions", "rename it")])
    return name


def _note(element: Element) -> str:
    return " ".join(" ".join(child.passage.text for child in element.all("note")).split())


def _param(element: Element) -> Param:
    kind = element.attributes.get("type", "real")
    if kind not in ("real", "int", "label") or any(element.attributes.get(d, "1") != "1" for d in ("d1", "d2")):
        message = "expected a label or a real number, got a vector, a matrix or another type"
        raise ModelError([element.fault("HS332", message, "write a parameter for each component")])
    constant = element.attributes.get("dynamics", "any") == "const"
    meaning = "label" if kind == "label" else "constant" if constant else "variable"
    return Param(element.attribute("name"), meaning, element.attributes.get("local", "false") == "true", element)


def _location(element: Element) -> Location:
    name = element.attributes.get("name") or element.attribute("id")
    flow = element.passage_of("flow")
    if flow is not None and flow.text.strip() == "false":
        hint = "join its transitions with those that lead to it"
        raise ModelError([flow.fault("HS332", "time does not pass in this location, and passes in every mode", hint)])
    invariant = element.passage_of("invariant")
    if invariant is not None and invariant.text.strip() == "false":
        raise ModelError([invariant.fault("HS332", "nothing can be in a location whose invariant is `false`")])
    return Location(name, _note(element), _checked(invariant), _checked(flow), element)


def _checked(passage: Passage | None) -> tuple[Relation, ...]:
    return tuple(map(checked, relations(passage)))


def _jump(element: Element, component: Component) -> Jump:
    ends = [element.attribute("source"), element.attribute("target")]
    for end in ends:
        if end not in component.locations:
            message = f"there is no location with the id '{shown(end)}' in '{shown(component.name)}'"
            raise ModelError([element.fault("HS331", message)])
    label = element.passage_of("label")
    name = label.text.strip() if label else ""
    if label and name and (name not in component.params or component.params[name].kind != "label"):
        near = closest(name, [p.name for p in component.params.values() if p.kind == "label"])
        hint = f"did you mean '{near}'?" if near else "declare it as a <param> of type label"
        raise ModelError([label.fault("HS331", f"no label is called '{shown(name)}'", hint)])
    guard, assignment = element.passage_of("guard"), element.passage_of("assignment")
    never = guard is not None and guard.text.strip() == "false"
    if never and guard is not None:
        raise ModelError([guard.fault("HS332", "a transition whose guard is `false` is never made", "remove it")])
    urgent = element.attributes.get("asap", "false") == "true"
    return Jump(ends[0], ends[1], name, _note(element), _checked(guard), _checked(assignment), urgent, element)


def _bind(element: Element) -> Bind:
    values: dict[str, Passage] = {}
    for child in element.all("map"):
        _once(values, child.attribute("key"), child.passage, child)
    return Bind(element.attribute("component"), _name(element, "as"), values, element)
