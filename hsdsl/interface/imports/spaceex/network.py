"""A component flattened, and the product of its instances.

Instances of base components get names of their own, and constants bound in maps are put in. Of the product there are
the locations that can be reached, with labels synchronised, and the edges between them.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass, field, replace
from itertools import islice, product

from hsdsl.base import limits
from hsdsl.base.names import closest, shown
from hsdsl.interface.imports.spaceex.document import (
    BOUNDED,
    DERIVED,
    Bind,
    Component,
    Jump,
    Location,
    Param,
    Relation,
    names_in,
    value,
)
from hsdsl.language.expression.parse import ExpressionError, parse
from hsdsl.language.expression.scope import RESERVED
from hsdsl.language.source.xml import Element, Passage

MOST_INSTANCES, DEEPEST = 1000, 20
Origin = tuple[str, str]  # path of the instance that declares a parameter, and its name there
_Part = tuple[str, Component, dict[str, Origin]]


@dataclass(frozen=True)
class Instance:
    """A base component with a name of the whole for each formal parameter."""

    path: str
    component: Component
    names: dict[str, str]

    def of_kind(self, *kinds: str) -> dict[str, str]:
        """The names of the parameters of some kinds."""
        return {key: name for key, name in self.names.items() if self.component.params[key].kind in kinds}


@dataclass(frozen=True)
class Network:
    """All instances, the constants (None: not bound) and variables of the whole, and names by path and formal name.

    ``given`` are values at the start that do not come from the files, ``held`` variables that are constants by choice.
    """

    instances: tuple[Instance, ...]
    constants: dict[str, str | None]
    variables: tuple[str, ...]
    qualified: dict[str, str]
    params: dict[str, Param]
    given: dict[str, str] = field(default_factory=dict[str, str])
    held: tuple[str, ...] = ()

    @property
    def moved(self) -> set[str]:
        """The names that a flow or an equation of an invariant gives anywhere."""
        found: set[str] = set()
        for instance in self.instances:
            for location in instance.component.locations.values():
                equations = (r for r in location.invariant if r.operator == "==")
                names = {*(r.left for r in location.flow), *(name for r in equations for name in r.names)}
                found |= {instance.names[name] for name in names if name in instance.names}
        return found


@dataclass
class _Flattening:
    components: dict[str, Component]
    instances: list[_Part] = field(default_factory=list[_Part])
    origins: dict[Origin, Param] = field(default_factory=dict[Origin, Param])
    bound: dict[Origin, str] = field(default_factory=dict[Origin, str])

    def add(self, path: str, component: Component, given: dict[str, Origin], depth: int = 0) -> None:
        """Add an instance, and those in it."""
        own = dict(given)
        for param in component.params.values():
            if param.name not in own:
                own[param.name] = (path, param.name)
                self.origins[path, param.name] = param
        if depth > DEEPEST or len(self.instances) >= MOST_INSTANCES:
            message = f"the network has more than {MOST_INSTANCES} instances or {DEEPEST} levels"
            raise component.element.refusal("HS332", message)
        if not component.binds:
            self.instances.append((path, component, own))
        for bind in component.binds:
            inner = f"{path}.{bind.name}" if path else bind.name
            self.add(inner, self.component(bind), self.given(bind, inner, component, own), depth + 1)

    def component(self, bind: Bind) -> Component:
        """The component of an instance."""
        if bind.component in self.components:
            return self.components[bind.component]
        near = closest(bind.component, self.components)
        hint = f"did you mean '{near}'?" if near else None
        raise bind.element.refusal("HS331", f"there is no component '{shown(bind.component)}'", hint)

    def given(self, bind: Bind, path: str, parent: Component, names: dict[str, Origin]) -> dict[str, Origin]:
        """What the maps of an instance bind: names of its parent, or numbers."""
        component = self.component(bind)
        found: dict[str, Origin] = {}
        for key, passage in bind.values.items():
            param = component.params.get(key)
            if param is None or param.local:
                raise passage.refusal("HS331", f"'{shown(bind.component)}' has no parameter '{shown(key)}' to bind")
            text = passage.text.strip()
            if text in names:
                self.match(param, parent.params[text], passage)
                found[key] = names[text]
            else:
                self.origins[path, key] = param
                self.bound[path, key] = _number(passage, parent)
                found[key] = (path, key)
        for param in component.params.values():
            if not param.local and param.name not in found and param.kind != "label":
                message = f"'{param.name}' of '{shown(bind.component)}' is not bound"
                raise bind.element.refusal("HS331", message, f'add <map key="{param.name}">')
        return found

    def match(self, param: Param, outer: Param, passage: Passage) -> None:
        """Refuse a label for a number, and a variable for a constant."""
        if (param.kind == "label") != (outer.kind == "label"):
            raise passage.refusal("HS331", f"'{param.name}' is a {param.kind}, this is a {outer.kind}")


def _number(passage: Passage, parent: Component) -> str:
    text = passage.text.strip()
    try:
        names = names_in(text)
        parse(text)
    except ExpressionError as error:
        raise passage.refusal(error.code, error.message, error.hint) from None
    if not names:
        return text
    near = closest(text, parent.params)
    hint = f"did you mean '{near}'?" if near else "a map has a name or a number"
    raise passage.refusal("HS331", f"'{shown(parent.name)}' has no parameter '{shown(text)}'", hint)


def flattened(components: dict[str, Component], system: Component) -> Network:
    """A component with all of its instances.

    Raises ModelError: an instance of nothing, a parameter that nothing binds, or too many of them.
    """
    work = _Flattening(components)
    base = not system.binds
    work.add("", system, {})
    if not system.locations and base:
        raise system.element.refusal("HS332", f"'{shown(system.name)}' has neither locations nor instances")
    for path, component, _ in work.instances:
        if not component.locations:
            raise component.element.refusal("HS332", f"'{shown(path or component.name)}' has no locations")
    names = _named(work.origins)
    instances = tuple(
        Instance(path or component.name, component, {key: names[origin] for key, origin in own.items()})
        for path, component, own in work.instances
    )
    constants = {
        names[o]: work.bound.get(o) for o, p in work.origins.items() if p.kind == "constant" or o in work.bound
    }
    variables = [names[o] for o, p in work.origins.items() if p.kind == "variable" and o not in work.bound]
    qualified = {f"{path}.{name}" if path else name: names[path, name] for path, name in work.origins}
    for instance in instances:
        qualified |= {f"{instance.path}.{key}": name for key, name in instance.names.items()}
    return Network(instances, constants, tuple(variables), qualified, {names[o]: p for o, p in work.origins.items()})


def _named(origins: dict[Origin, Param]) -> dict[Origin, str]:
    """A name of the whole for each parameter: its own where that is the only one, else with its instance's before."""
    times = Counter(name for _, name in origins)
    outer = {name for path, name in origins if not path}
    found: dict[Origin, str] = {}
    used = set(RESERVED)
    for path, name in origins:
        alone = not path or (times[name] == 1 and name not in outer)
        chosen = name if alone else f"{path.replace('.', '_')}_{name}"
        while chosen in used:
            chosen += "_"
        used.add(chosen)
        found[path, name] = chosen
    return found


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
    passing: bool  # whether time may pass


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


def automaton(network: Network, start: Key) -> tuple[dict[Key, Place], list[Arrow]]:
    """The places that can be reached from the locations in which the instances start, and the arrows there.

    Raises ModelError: too many locations, or instances that contradict each other.
    """
    places, arrows, waiting = dict[Key, Place](), list[Arrow](), [start]
    most = limits.current().modes
    while waiting:
        key = waiting.pop(0)
        if key in places:
            continue
        if len(places) >= most or len(arrows) > MOST_EDGES:
            message = f"the network has more than {most:,} locations or {MOST_EDGES:,} transitions"
            raise network.instances[0].component.element.refusal("HS332", message)
        places[key] = place(network, key, [known.name for known in places.values()])
        leaving = list(islice(_arrows(network, key), MOST_EDGES))
        arrows += leaving
        waiting += [arrow.target for arrow in leaving]
    return places, arrows


def place(network: Network, key: Key, taken: Collection[str]) -> Place:
    """A location of the product, whose name is none of those that are taken."""
    locations = tuple(i.component.locations[k] for i, k in zip(network.instances, key, strict=True))
    invariant: dict[str, Relation] = {}
    passing = all(location.passing for location in locations)
    flow = _flow(network, locations) if passing else _still(network)
    for instance, location in zip(network.instances, locations, strict=True):
        names = instance.names
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
    while name in taken:
        name += "_"
    return Place(name, locations, tuple(invariant.values()), flow, locations[0].element, passing)


def _word(name: str) -> str:
    word = "".join(c if c.isascii() and c.isalnum() else "_" for c in name)
    return word if word[:1].isalpha() or word[:1] == "_" else f"l{word}"


def _known_names(relation: Relation, instance: Instance) -> None:
    known = instance.of_kind("variable", "constant")
    for name in sorted(relation.names):
        if name not in known:
            message = f"'{instance.component.name}' has no variable or constant '{name}'"
            raise relation.refusal(message, "declare it as a <param>", "HS331")


def _flow(network: Network, locations: Iterable[Location]) -> dict[str, Relation]:
    """The derivatives of all instances; two bounds that are equal give one."""
    flow: dict[str, Relation] = {}
    bounds: dict[str, Relation] = {}
    for instance, location in zip(network.instances, locations, strict=True):
        for relation in (each.renamed(instance.names) for each in location.flow):
            if not relation.primed or relation.operator == ":=":
                raise relation.refusal("a flow gives derivatives, such as x' == v", DERIVED)
            if relation.operator != "==":
                other = bounds.setdefault(relation.left, relation)
                if other.operator[:1] == relation.operator[:1] or value(other.right) != value(relation.right):
                    continue
                relation = replace(relation, operator="==")
            if flow.get(relation.left, relation).text != relation.text:
                raise relation.refusal(f"two instances give '{relation.left}' different derivatives")
            flow[relation.left] = relation
    for name, relation in bounds.items():
        if name not in flow:
            raise relation.refusal(BOUNDED, DERIVED)
    return flow


def _still(network: Network) -> dict[str, Relation]:
    """The derivatives where time does not pass: 0 for all variables that have one anywhere."""
    found: dict[str, Relation] = {}
    for instance in network.instances:
        for location in instance.component.locations.values():
            for relation in location.flow:
                if relation.primed:
                    name = instance.names.get(relation.left, relation.left)
                    found[name] = replace(relation, left=name, operator="==", right="0")
    return found


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
    if relation.operator not in (":=", "=="):
        raise relation.refusal("an assignment gives one value, such as x := 0", "write x := and its value")
    if relation.left.isidentifier() and reset.get(relation.left, relation).right == relation.right:
        reset[relation.left] = relation
        return
    sentence = (
        f"'{relation.left}' is given two values" if relation.left.isidentifier() else "a value is given to a name"
    )
    raise relation.refusal(sentence)
