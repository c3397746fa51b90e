"""The product of instances: locations that can be reached, with labels synchronised, and the edges between them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import islice, product

from hsdsl.base import limits
from hsdsl.base.errors import ModelError
from hsdsl.interface.imports.spaceex.document import Jump, Location
from hsdsl.interface.imports.spaceex.formula import Relation
from hsdsl.interface.imports.spaceex.network import Instance, Network
from hsdsl.language.source.xml import Element

Key = tuple[str, ...]  # the location of each instance, by id
MOST_EDGES = 100_000


@dataclass(frozen=True)
class Place:
    """A location of the product."""

    name: str
    locations: tuple[Location, ...]
    invariant: tuple[Relation, ...]
    flow: dict[str, Relation]
    element: Element


@dataclass(frozen=True)
class Arrow:
    """An edge of the product; several jumps that share a label are one."""

    source: Key
    target: Key
    label: str
    notes: tuple[str, ...]
    guard: tuple[Relation, ...]
    reset: dict[str, Relation]
    urgent: bool
    element: Element


@dataclass
class Automaton:
    """Places that can be reached from the first one, and arrows."""

    places: dict[Key, Place] = field(default_factory=dict[Key, Place])
    arrows: list[Arrow] = field(default_factory=list[Arrow])


def automaton(network: Network, start: Key) -> Automaton:
    """Follow all transitions from the locations in which the instances start.

    Raises ModelError: too many locations, or instances that contradict each other.
    """
    found = Automaton()
    waiting = [start]
    most = limits.current().modes
    while waiting:
        key = waiting.pop(0)
        if key in found.places:
            continue
        if len(found.places) >= most or len(found.arrows) > MOST_EDGES:
            message = f"the network has more than {most:,} locations or {MOST_EDGES:,} transitions"
            raise ModelError([network.instances[0].component.element.fault("HS332", message)])
        found.places[key] = _place(network, key, found)
        arrows = list(islice(_arrows(network, key), MOST_EDGES))
        found.arrows += arrows
        waiting += [arrow.target for arrow in arrows]
    return found


def _place(network: Network, key: Key, found: Automaton) -> Place:
    locations = tuple(i.component.locations[k] for i, k in zip(network.instances, key, strict=True))
    flow: dict[str, Relation] = {}
    invariant: dict[str, Relation] = {}
    for instance, location in zip(network.instances, locations, strict=True):
        names = instance.names
        for relation in location.flow:
            _add_flow(flow, relation.renamed(names))
        for relation in location.invariant:
            _known_names(relation, instance)
            renamed = relation.renamed(names)
            if renamed.operator == ":=" or renamed.primed:
                raise relation.refusal("an invariant has relations between variables, no assignments")
            invariant.setdefault(renamed.text, renamed)
    for instance, location in zip(network.instances, locations, strict=True):
        for relation in location.flow:
            _known_names(relation, instance)
    telling = [
        location for i, location in zip(network.instances, locations, strict=True) if len(i.component.locations) > 1
    ]
    name = "_".join(_word(location.name) for location in telling or locations[:1])
    taken = {place.name for place in found.places.values()}
    while name in taken:
        name += "_"
    return Place(name, locations, tuple(invariant.values()), flow, locations[0].element)


def _word(name: str) -> str:
    word = "".join(c if c.isascii() and c.isalnum() else "_" for c in name)
    return word if word[:1].isalpha() or word[:1] == "_" else f"l{word}"


def _known_names(relation: Relation, instance: Instance) -> None:
    known = instance.of_kind("variable", "constant")
    for name in sorted(relation.names):
        if name not in known:
            message = f"'{instance.component.name}' has no variable or constant '{name}'"
            raise ModelError([relation.fault(message, "declare it as a <param>", "HS331")])


def _add_flow(flow: dict[str, Relation], relation: Relation) -> None:
    if not relation.primed or relation.operator != "==":
        hint = "write x' == and its derivative"
        if relation.primed:
            raise relation.refusal("a derivative that is only bounded leaves the flow open", hint)
        raise relation.refusal("a flow gives derivatives, such as x' == v", hint)
    if flow.get(relation.left, relation).text != relation.text:
        raise relation.refusal(f"two instances give '{relation.left}' different derivatives")
    flow[relation.left] = relation


def _arrows(network: Network, key: Key) -> Iterator[Arrow]:
    """The edges that leave a location of the product."""
    instances = network.instances
    leaving = [[j for j in i.component.jumps if j.source == k] for i, k in zip(instances, key, strict=True)]
    labels: dict[str, None] = {}
    for at, (instance, jumps) in enumerate(zip(instances, leaving, strict=True)):
        for jump in jumps:
            if jump.label:
                labels[instance.names[jump.label]] = None
            else:
                yield _arrow(network, key, {at: jump}, "")
    for label in labels:
        together: dict[int, list[Jump]] = {}
        for at, (instance, jumps) in enumerate(zip(instances, leaving, strict=True)):
            own = [formal for formal, name in instance.of_kind("label").items() if name == label]
            if own:
                together[at] = [jump for jump in jumps if jump.label in own]
        for chosen in product(*together.values()):
            yield _arrow(network, key, dict(zip(together, chosen, strict=True)), label)


def _arrow(network: Network, key: Key, jumps: dict[int, Jump], label: str) -> Arrow:
    target = tuple(jumps[at].target if at in jumps else location for at, location in enumerate(key))
    guard: dict[str, Relation] = {}
    reset: dict[str, Relation] = {}
    for at, jump in jumps.items():
        instance = network.instances[at]
        for relation in (*jump.guard, *jump.assignment):
            _known_names(relation, instance)
        for relation in jump.guard:
            renamed = relation.renamed(instance.names)
            if renamed.operator == ":=" or renamed.primed:
                raise relation.refusal("a guard has relations between variables, no assignments")
            guard.setdefault(renamed.text, renamed)
        for relation in jump.assignment:
            _add_reset(reset, relation.renamed(instance.names))
    notes = tuple(jump.note for jump in jumps.values() if jump.note)
    urgent = any(jump.urgent for jump in jumps.values())
    element = next(iter(jumps.values())).element
    return Arrow(key, target, label, notes, tuple(guard.values()), reset, urgent, element)


def _add_reset(reset: dict[str, Relation], relation: Relation) -> None:
    if not (relation.operator == ":=" or (relation.operator == "==" and relation.primed)):
        raise relation.refusal("an assignment gives one value, such as x := 0", "write x := and its value")
    if relation.left.isidentifier() and reset.get(relation.left, relation).right == relation.right:
        reset[relation.left] = relation
        return
    sentence = (
        f"'{relation.left}' is given two values" if relation.left.isidentifier() else "a value is given to a name"
    )
    raise relation.refusal(sentence)
