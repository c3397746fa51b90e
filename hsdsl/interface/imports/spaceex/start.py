# pyright: basic, reportAttributeAccessIssue=false, reportOperatorIssue=false
"""Where a run starts: the location of each instance, and a point; the values of constants that no map binds."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from hsdsl.base.errors import ModelError
from hsdsl.base.functions import replaced
from hsdsl.base.names import closest, did_you_mean, shown
from hsdsl.interface.imports.spaceex.document import DOT, Configuration, Relation, renamed, within
from hsdsl.interface.imports.spaceex.modes import ModeDraft
from hsdsl.interface.imports.spaceex.network import Key, Network
from hsdsl.language.expression.plain import names_in, value
from hsdsl.language.expression.scope import symbol
from hsdsl.language.source.xml import Element


@dataclass(frozen=True)
class Start:
    """Texts of values of constants and variables, and the numbers behind them, by symbol."""

    constants: dict[str, str]
    variables: dict[str, str]
    numbers: dict[Any, Any]


def first_locations(network: Network, configured: Configuration, system: str) -> Key:
    """The location in which each instance starts, by id.

    Raises ModelError: a location or an instance that does not exist, two locations, or none of several.
    """
    chosen: dict[str, str] = {}
    paths = {i.path: i for i in network.instances}
    for name, location, span in configured.locations:
        assert configured.initially is not None
        path = name.removeprefix(f"{system}.")
        path = next(iter(paths)) if len(paths) == 1 and path in ("", system) else path
        fault = configured.initially.fault
        if path not in paths:
            message = f"there is no instance '{shown(name)}' in '{shown(system)}'"
            raise ModelError([fault("HS333", message, did_you_mean(path, paths), *span)])
        ids = {known.name: key for key, known in paths[path].component.locations.items()}
        if location not in ids:
            message = f"'{shown(path)}' has no location '{shown(location)}'"
            raise ModelError([fault("HS333", message, did_you_mean(location, ids), *span)])
        if chosen.setdefault(path, ids[location]) != ids[location]:
            raise ModelError([fault("HS333", f"'{shown(path)}' starts in two locations", None, *span)])
    for path, instance in paths.items():
        locations = instance.component.locations
        if path not in chosen and len(locations) > 1:
            message = f"in which location '{shown(path)}' starts is not given"
            hint = f"write loc({path})=={next(iter(locations.values())).name} under `initially` in the configuration"
            raise ModelError([_place_of(configured, instance.component.element, message, hint)])
        chosen.setdefault(path, next(iter(locations)))
    return tuple(chosen[instance.path] for instance in network.instances)


def _place_of(configured: Configuration, element: Element, message: str, hint: str) -> Any:
    if configured.initially is not None:
        return configured.initially.fault("HS333", message, hint)
    return element.fault("HS333", message, hint)


def start(network: Network, configured: Configuration, system: str) -> Start:
    """The values that `initially` and maps give.

    Raises ModelError: a name that does not exist, a set of more than one point, or a constant without a value.
    """
    waiting = [_named_place(relation, network, system) for relation in configured.values]
    found = {name: text for name, text in network.constants.items() if text is not None}
    texts = dict(found)
    numbers = {symbol(name): value(text) for name, text in found.items()}
    while step := next(_solvable(waiting, texts), None):
        relation, name, text = step
        waiting.remove(relation)
        variables = {n: within(texts[n]) for n in names_in(text) if n in network.variables}
        texts[name] = renamed(text, variables)
        numbers[symbol(name)] = replaced(value(text), numbers, {})
    for name in network.constants:
        if name not in texts:
            message, hint = f"the constant '{name}' has no value", f"write {name} == and its value under `initially`"
            raise ModelError([network.params[name].element.fault("HS333", message, hint)])
    for relation in waiting:
        _hold(relation, numbers)
    constants = {name: text for name, text in texts.items() if name in network.constants}
    return Start(constants, {n: t for n, t in texts.items() if n in network.variables}, numbers)


def _named_place(relation: Relation, network: Network, system: str) -> Relation:
    """A relation of `initially` with the names of the whole."""
    names: dict[str, str] = {}
    for name in relation.names:
        dotted = name.replace(DOT, ".").removeprefix(f"{system}.")
        if dotted not in network.qualified:
            near = closest(dotted, network.qualified)
            hint = f"did you mean '{near}'?" if near else None
            raise ModelError([relation.fault(f"nothing is called '{shown(dotted)}'", hint, "HS333")])
        names[name] = network.qualified[dotted]
    if relation.operator == ":=" or relation.primed:
        raise ModelError([relation.fault("an initial set has relations such as x == 1", None, "HS333")])
    return relation.renamed(names)


def _solvable(waiting: list[Relation], known: Mapping[str, str]) -> Any:
    """Relations that give a name a value: an equation with it alone on one side, or two bounds that are equal."""
    for relation in waiting:
        for name, text in ((relation.left, relation.right), (relation.right, relation.left)):
            if not name.isidentifier() or name in known or [name] != names_in(name) or set(names_in(text)) - set(known):
                continue
            opposite = {"<=": ">=", ">=": "<="}.get(relation.operator)
            other = opposite and any(
                (r.left, r.operator, r.right) == (relation.left, opposite, relation.right)
                or (r.left, r.operator, r.right) == (relation.right, relation.operator, relation.left)
                for r in waiting
            )
            if relation.operator == "==" or other:
                yield relation, name, text


def _hold(relation: Relation, numbers: dict[Any, Any]) -> None:
    excess = replaced(relation.excess, numbers, {})
    if excess.free_symbols:
        names = ", ".join(f"'{s.name}'" for s in sorted(excess.free_symbols, key=lambda s: s.name))
        hint = f"choose a point of it: write {min(s.name for s in excess.free_symbols)} == and a number"
        raise ModelError([relation.fault(f"a run starts at one point, and this leaves {names} open", hint, "HS333")])
    if (excess != 0) if relation.operator == "==" else bool(excess > 0):
        raise ModelError(
            [relation.fault("the initial set is empty: this does not hold at its only point", None, "HS333")]
        )


def refuse_outside(draft: ModeDraft, begin: Start, configured: Configuration, element: Element) -> None:
    """Refuse a start without a value for each state, or outside the invariant.

    Raises ModelError: so it is.
    """
    for name in draft.states:
        if name not in begin.variables:
            message, hint = f"where '{name}' starts is not given", f"write {name} == and a number under `initially`"
            raise ModelError([_place_of(configured, element, message, hint)])
    for facet in draft.facets:
        if bool(replaced(draft.placed(facet.excess), begin.numbers, {}) > 0):
            raise ModelError([facet.relation.fault("the run starts where this invariant does not hold")])
    for equality in draft.equalities:
        if replaced(equality, begin.numbers, {}) != 0:
            message = "the run starts where an equation of the invariant does not hold"
            raise ModelError([_place_of(configured, element, message, "change `initially`")])
