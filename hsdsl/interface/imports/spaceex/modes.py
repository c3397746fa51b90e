# pyright: basic
"""Modes of a model for the locations of an automaton: which variables are states, and which an equation gives."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from hsdsl.base.errors import ModelError
from hsdsl.base.functions import replaced
from hsdsl.interface.imports.spaceex.drafts import Facet, ModeDraft
from hsdsl.interface.imports.spaceex.feasibility import decide
from hsdsl.interface.imports.spaceex.formula import Relation
from hsdsl.interface.imports.spaceex.network import Network
from hsdsl.interface.imports.spaceex.product import Arrow, Automaton, Key, Place
from hsdsl.language.expression.algebra import lie_derivative
from hsdsl.language.expression.plain import names_in, value
from hsdsl.language.expression.scope import symbol
from hsdsl.mathematics.decisions.search import negative, positive


def mode_drafts(network: Network, found: Automaton, constants: Mapping[Any, Any]) -> dict[Key, ModeDraft]:
    """A mode for each place.

    Raises ModelError: a variable without a derivative, or an equation that the flow does not keep.
    """
    arrows: dict[Key, list[Arrow]] = {}
    for arrow in found.arrows:
        arrows.setdefault(arrow.source, []).append(arrow)
    drafts = {key: _draft(network, place, arrows.get(key, []), constants) for key, place in found.places.items()}
    for arrow in found.arrows:
        _refuse_loose(arrow, drafts[arrow.source], drafts[arrow.target])
    return drafts


def _draft(network: Network, place: Place, arrows: list[Arrow], constants: Mapping[Any, Any]) -> ModeDraft:
    states = [name for name in network.variables if name in place.flow]
    for name, relation in place.flow.items():
        if name in network.constants:
            raise relation.refusal(f"'{name}' is a constant, and has a derivative here")
    lets, rest = _definitions(network, place)
    _refuse_free(network, place, arrows, {*states, *lets})
    values = dict(constants)
    for name, text in lets.items():
        values[symbol(name)] = replaced(value(text), values, {})
    flow = {symbol(name): replaced(value(place.flow[name].right), values, {}) for name in states}
    draft = ModeDraft(place, states, lets, flow, [], [], values)
    for relation in rest:
        if relation.operator == "==":
            _keep(draft, relation)
            draft.equalities.append(draft.excess(relation))
        else:
            draft.facets.append(Facet(relation, draft.excess(relation)))
    _merge(draft)
    return draft


def _merge(draft: ModeDraft) -> None:
    """Leave one of facets that are the same set."""
    found: dict[Any, Facet] = {}
    for facet in draft.facets:
        found.setdefault(facet.excess, facet)
    draft.facets = list(found.values())


def _definitions(network: Network, place: Place) -> tuple[dict[str, str], list[Relation]]:
    """Equations of the invariant that give a variable without a derivative, in an order of use, and the others."""
    lets: dict[str, str] = {}
    rest: list[Relation] = list(place.invariant)
    known = {*place.flow, *network.constants}
    while True:
        for relation in rest:
            if relation.operator != "==":
                continue
            for name, text in ((relation.left, relation.right), (relation.right, relation.left)):
                if name in network.variables and name not in known and set(names_in(text)) <= known:
                    lets[name] = text
                    known.add(name)
                    rest.remove(relation)
                    break
            else:
                continue
            break
        else:
            return lets, rest


def _refuse_free(network: Network, place: Place, arrows: list[Arrow], known: set[str]) -> None:
    """Refuse a variable that is used here and may change in any way."""
    used: list[Relation] = [*place.flow.values(), *place.invariant]
    for arrow in arrows:
        used += [*arrow.guard, *arrow.reset.values()]
    for relation in used:
        names = set(names_in(relation.right)) if relation.primed or relation.operator == ":=" else relation.names
        for name in sorted(names):
            if name in network.variables and name not in known:
                message = f"'{name}' has no derivative in location {place.name}: it may change in any way there"
                hint = f"give it one, or an equation `{name} == ...` in the invariant"
                raise relation.refusal(message, hint)


def _refuse_loose(arrow: Arrow, source: ModeDraft, target: ModeDraft) -> None:
    """Refuse an arrow that leaves a state of its target without a value."""
    for name in target.states:
        if name not in {*source.states, *source.lets, *arrow.reset}:
            message = f"'{name}' has no derivative in location {source.place.name}, and no value after this transition"
            raise ModelError([arrow.element.fault("HS332", message, f"assign a value: {name} := ...")])


def _keep(draft: ModeDraft, relation: Relation) -> None:
    """Refuse an equation of states that the flow does not keep."""
    rate = lie_derivative(draft.excess(relation), draft.flow)
    held = [c for c in draft.inside]
    if not all(decide([*held, beyond]).never for beyond in (positive(rate), negative(rate))):
        message = "the flow does not keep this equation of the invariant: time cannot pass"
        raise relation.refusal(message)
    draft.comments.append(f"`{relation.text}` holds all along")
