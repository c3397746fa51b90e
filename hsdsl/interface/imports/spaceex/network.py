"""A component flattened: instances of base components with names of their own, and the constants bound in maps."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field

from hsdsl.base.errors import ModelError
from hsdsl.base.names import closest, shown
from hsdsl.interface.imports.spaceex.document import Bind, Component, Param
from hsdsl.language.expression.parse import ExpressionError, parse
from hsdsl.language.expression.plain import names_in
from hsdsl.language.expression.scope import RESERVED
from hsdsl.language.source.xml import Passage

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
    """All instances, the constants (None: not bound) and variables of the whole, and names by path and formal name."""

    instances: tuple[Instance, ...]
    constants: dict[str, str | None]
    variables: tuple[str, ...]
    qualified: dict[str, str]
    params: dict[str, Param]


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
            raise ModelError([component.element.fault("HS332", message)])
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
        message = f"there is no component '{shown(bind.component)}'"
        raise ModelError([bind.element.fault("HS331", message, hint)])

    def given(self, bind: Bind, path: str, parent: Component, names: dict[str, Origin]) -> dict[str, Origin]:
        """What the maps of an instance bind: names of its parent, or numbers."""
        component = self.component(bind)
        found: dict[str, Origin] = {}
        for key, passage in bind.values.items():
            param = component.params.get(key)
            if param is None or param.local:
                message = f"'{shown(bind.component)}' has no parameter '{shown(key)}' to bind"
                raise ModelError([passage.fault("HS331", message)])
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
                raise ModelError([bind.element.fault("HS331", message, f'add <map key="{param.name}">')])
        return found

    def match(self, param: Param, outer: Param, passage: Passage) -> None:
        """Refuse a label for a number, and a variable for a constant."""
        if (param.kind == "label") != (outer.kind == "label"):
            raise ModelError([passage.fault("HS331", f"'{param.name}' is a {param.kind}, this is a {outer.kind}")])


def _number(passage: Passage, parent: Component) -> str:
    text = passage.text.strip()
    try:
        names = names_in(text)
        parse(text)
    except ExpressionError as error:
        raise ModelError([passage.fault(error.code, error.message, error.hint)]) from None
    if not names:
        return text
    near = closest(text, parent.params)
    hint = f"did you mean '{near}'?" if near else "a map has a name or a number"
    raise ModelError([passage.fault("HS331", f"'{shown(parent.name)}' has no parameter '{shown(text)}'", hint)])


def flattened(components: dict[str, Component], system: Component) -> Network:
    """A component with all of its instances.

    Raises ModelError: an instance of nothing, a parameter that nothing binds, or too many of them.
    """
    work = _Flattening(components)
    base = not system.binds
    work.add("", system, {})
    if not system.locations and base:
        raise ModelError([system.element.fault("HS332", f"'{shown(system.name)}' has neither locations nor instances")])
    for path, component, _ in work.instances:
        if not component.locations:
            raise ModelError([component.element.fault("HS332", f"'{shown(path or component.name)}' has no locations")])
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
