# pyright: basic
"""Modes and transitions of a model for the locations and arrows of an automaton, and the decisions about them.

An equation of an invariant gives a variable, any other variable is a state. In SpaceEx a guard allows a jump, and only
the end of the invariant forces it; "may" and "must" are one here. A transition of a model is made where its surface is
crossed. Both have the same executions where the guard, inside the invariant, lies on a facet of it, and the flow leads
out there. That is proved for each arrow, by an exact linear program or, where a constraint is not affine, by a search;
what differs otherwise is a comment or a refusal.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any

import numpy as np

from hsdsl.base.errors import Findings, ModelError
from hsdsl.base.functions import replaced
from hsdsl.base.names import shown
from hsdsl.base.numbers.rational import Exact, about, axes, deepest, matrix, maximise, zeros
from hsdsl.interface.imports.spaceex.document import Relation, renamed, within
from hsdsl.interface.imports.spaceex.network import Arrow, Automaton, Key, Network, Place
from hsdsl.language.expression.algebra import lie_derivative
from hsdsl.language.expression.plain import names_in, value
from hsdsl.language.expression.scope import symbol
from hsdsl.mathematics.decisions.decide import Decider
from hsdsl.mathematics.decisions.polynomial import NormalForms
from hsdsl.mathematics.decisions.search import (
    NEVER,
    UNKNOWN,
    Answer,
    Constraint,
    SearchRange,
    at_most_zero,
    negative,
    positive,
    zero,
)


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


_FORMS = NormalForms()
REACH = 100.0  # how far a search for a point of constraints that are not affine goes, in units of the model


def decide(constraints: Sequence[Constraint]) -> Answer:
    """Whether there is a point where all constraints hold; `never` is a proof over the whole space."""
    constraints = [c for c in constraints if not _holds(c)]
    names = sorted({s for c in constraints for s in c.expr.free_symbols}, key=lambda s: s.name)
    found = [_row(c.expr, names) for c in constraints]
    rows = [row for row in found if row is not None]
    if len(rows) < len(found):
        ranges = {name: SearchRange(None, None, (-REACH, REACH), 1.0) for name in names}
        answer = Decider().decide(tuple(constraints), ranges, prove=True)
        return UNKNOWN if answer.never and answer.searched else answer
    relations = [c.relation for c in constraints]
    if any(
        not row[1:].any() and not _constant(row[0], relation) for row, relation in zip(rows, relations, strict=True)
    ):
        return NEVER
    point = _interior(*_split(rows, relations, len(names)))
    if point is None:
        return NEVER
    return Answer("somewhere", "symbolic", {name: float(v) for name, v in zip(names, point, strict=True)})


def _holds(constraint: Constraint) -> bool:
    row = _row(constraint.expr, [])
    return row is not None and _constant(row[0], constraint.relation)


def _constant(value: Fraction, relation: str) -> bool:
    return value == 0 if relation == "= 0" else value <= 0 if relation == "<= 0" else value < 0


def _row(expr: Any, names: Sequence[Any]) -> Exact | None:
    """An affine expression as its constant and its slopes; None for another."""
    row = zeros(1 + len(names))
    for monomial, factor in _FORMS.of(expr).terms.items():
        if not monomial:
            row[0] += factor
            continue
        ((atom, exponent), *others) = monomial
        if others or exponent != 1 or atom.kind != "name" or atom.head not in names:
            return None
        row[1 + names.index(atom.head)] += factor
    return row


def _split(rows: Sequence[Exact], relations: Sequence[str], size: int) -> tuple[Exact, Exact]:
    """Rows that hold weakly, and those that hold strictly; those without names do not count."""
    pairs = [(row, relation) for row, relation in zip(rows, relations, strict=True) if row[1:].any()]
    weak = [sign * row for row, relation in pairs if relation != "< 0" for sign in (1, -1)[: 1 + (relation == "= 0")]]
    return matrix(weak, 1 + size), matrix((row for row, relation in pairs if relation == "< 0"), 1 + size)


def _interior(weak: Exact, strict: Exact) -> Exact | None:
    """A point where weak rows hold, and strict ones with room to spare."""
    size = weak.shape[1] - 1
    if not len(weak) + len(strict):
        return zeros(size)
    depth, point, _ = deepest(np.vstack([weak, strict]))
    if depth < 0:
        return None
    if not len(strict):
        return point
    goal = axes(size + 1)[-1]
    lengths = np.array([about(row[1:]) for row in strict], dtype=object)
    wider = [np.column_stack([weak, zeros(len(weak))]), np.column_stack([strict, lengths])]
    wider.append(np.append(np.array([Fraction(-1)], dtype=object), goal)[None])
    found = maximise(goal, np.vstack(wider), np.append(point, zeros(1)))
    assert found is not None  # the last row bounds it
    return found[0][:-1] if found[0][-1] > 0 else None


@dataclass(frozen=True)
class Facet:
    """An inequality of an invariant, and its excess: at most zero inside."""

    relation: Relation
    excess: Any


@dataclass
class ModeDraft:
    """A location as a mode of a model: ``lets`` are its variables that an equality of the invariant gives."""

    place: Place
    states: list[str]
    lets: dict[str, str]
    flow: dict[Any, Any]  # of symbols
    facets: list[Facet]
    equalities: list[Any]  # of states, which the flow keeps
    values: dict[Any, Any]  # of constants and lets, by symbol
    comments: list[str] = field(default_factory=list[str])

    def excess(self, relation: Relation) -> Any:
        """The excess of a relation over the states alone."""
        return self.placed(relation.excess)

    def placed(self, expr: Any) -> Any:
        """An expression over the states alone."""
        return replaced(expr, self.values, {})

    @property
    def inside(self) -> list[Constraint]:
        """The invariant."""
        return [*(at_most_zero(f.excess) for f in self.facets), *map(zero, self.equalities)]

    def kept(self, facet: Facet) -> bool:
        """Whether the flow leads back inside all over a facet, or moves nothing across it."""
        rate = lie_derivative(facet.excess, self.flow)
        return rate == 0 or decide([*self.inside, zero(facet.excess), at_most_zero(-rate)]).never


@dataclass
class TransitionDraft:
    """A transition of a model; ``facet`` is None where its surface is one of the guard, by choice."""

    arrow: Arrow
    when: Relation
    condition: list[str]
    guard: list[Constraint]
    facet: Facet | None
    comments: list[str]


STRICT = "<>"
INWARD = "SpaceEx may also jump where the flow leads back inside; this does not"
LATER = "SpaceEx may jump later: made as soon as the guard holds"


@dataclass(frozen=True)
class Judge:
    """Decides about arrows, and gathers what cannot be kept; ``eager`` jumps as soon as a guard allows it."""

    findings: Findings
    eager: bool = False

    def transition(self, arrow: Arrow, source: ModeDraft, target: ModeDraft) -> TransitionDraft | None:
        """The transition for an arrow; None where it is never made, or was refused."""
        guard = [closed(relation, source.excess(relation)) for relation in arrow.guard]
        if decide([*source.inside, *guard]).never:
            source.comments.append(f"no transition to {target.place.name}: its guard never holds in the invariant")
            return None
        facet, witness = self.facet(arrow, source, guard)
        if facet is None:
            return self.at_once(arrow, source, target, guard, witness)
        on = [*source.inside, zero(facet.excess)]
        rate = lie_derivative(facet.excess, source.flow)
        leaving = [*on, at_most_zero(-rate)]
        draft = TransitionDraft(arrow, facet.relation.mirrored(), [], guard, facet, [])
        self.conditions(draft, source, leaving)
        self.landing(draft, source, target, [*leaving, *guard])
        if not decide([*on, *guard, negative(rate)]).never:
            draft.comments.append(INWARD)
        return draft

    def facet(self, arrow: Arrow, source: ModeDraft, guard: list[Constraint]) -> tuple[Facet | None, Answer | None]:
        """The facet that the guard lies on; else a point where the guard holds off one."""
        witness: Answer | None = None
        mentioned = {name for relation in arrow.guard for name in relation.names}
        for facet in sorted(source.facets, key=lambda f: not f.relation.names <= mentioned):
            answer = decide([*source.inside, *guard, negative(facet.excess)])
            if answer.never:
                return facet, None
            witness = answer if answer.somewhere or witness is None else witness
        return None, witness

    def at_once(
        self, arrow: Arrow, source: ModeDraft, target: ModeDraft, guard: list[Constraint], witness: Answer | None
    ) -> TransitionDraft | None:
        """A transition that is made as soon as its guard holds, where that is given; else it is refused."""
        where = f" ({point(witness)})" if witness and witness.point else ""
        if not (self.eager or arrow.urgent):
            message = f"the guard can hold where the invariant does not end{where}: SpaceEx may jump there or go on"
            hint = "end the invariant where the guard begins, or give --urgent: jump as soon as the guard holds"
            self.refuse(arrow, message, hint)
            return None
        open_ = [r for r, c in zip(arrow.guard, guard, strict=True) if not _implied(c, source.inside)]
        if len(open_) != 1 or open_[0].operator == "==":
            message = "the first time at which this guard holds is not where one inequality begins to hold"
            self.refuse(arrow, message, "write a guard with one inequality that the invariant does not imply")
            return None
        draft = TransitionDraft(arrow, open_[0], [], guard, None, [])
        draft.comments.append(LATER)
        self.landing(draft, source, target, [*source.inside, *guard])
        return draft

    def conditions(self, draft: TransitionDraft, source: ModeDraft, leaving: Sequence[Constraint]) -> None:
        """What of the guard the surface does not imply."""
        for relation in draft.arrow.guard:
            excess = source.excess(relation)
            if relation.operator == "==":
                if not all(decide([*leaving, beyond]).never for beyond in (positive(excess), negative(excess))):
                    message = f"the guard is smaller than the facet `{draft.when.text}` by an equation, not by a region"
                    self.refuse(draft.arrow, message, "write an inequality", relation)
            elif decide([*leaving, at_most_zero(-excess) if relation.operator in STRICT else positive(excess)]).never:
                continue
            elif relation.operator in STRICT and decide([*leaving, positive(excess)]).never:
                draft.comments.append(
                    f"`{relation.text}` is left out: where the flow leads out it holds, but for its boundary"
                )
            else:
                draft.condition.append(relation.text)

    def landing(
        self, draft: TransitionDraft, source: ModeDraft, target: ModeDraft, given: Sequence[Constraint]
    ) -> None:
        """A jump is made only to where the target's invariant holds."""
        texts = {name: within(relation.right) for name, relation in draft.arrow.reset.items()}
        moves = {symbol(name): value(relation.right) for name, relation in draft.arrow.reset.items()}
        for facet in target.facets:
            landed = source.placed(replaced(facet.excess, moves, {}))
            answer = decide([*given, positive(landed)])
            if answer.never:
                continue
            relation = facet.relation
            if answer.somewhere:
                draft.condition.append(
                    f"{renamed(relation.left, texts)} {relation.operator} {renamed(relation.right, texts)}"
                )
                draft.comments.append(f"SpaceEx jumps only to where `{relation.text}` holds in {target.place.name}")
            else:
                self.refuse(draft.arrow, f"whether the jump leads to where `{relation.text}` holds is not decided")
        for equality in target.equalities:
            landed = source.placed(replaced(equality, moves, {}))
            if not all(decide([*given, beyond]).never for beyond in (positive(landed), negative(landed))):
                self.refuse(draft.arrow, f"the jump can miss an equation of the invariant of {target.place.name}")

    def choices(self, drafts: Sequence[TransitionDraft], source: ModeDraft) -> None:
        """Refuse two transitions that are possible in a region of one facet."""
        for i, draft in enumerate(drafts):
            for other in drafts[:i]:
                if draft.facet is None or other.facet is None or draft.facet.excess != other.facet.excess:
                    continue
                on = zero(draft.facet.excess)
                others = [f for f in source.facets if f.excess != draft.facet.excess]
                region = [negative(f.excess) for f in others]
                held = [c for c in (*draft.guard, *other.guard) if not _implied(c, [*source.inside, on])]
                if any(c.relation == "= 0" for c in held):
                    continue
                strictly = [Constraint(c.expr, "< 0") for c in held]
                if not decide([on, *map(zero, source.equalities), *region, *strictly]).never:
                    message = "this guard overlaps with that of a transition before it: either may be made"
                    self.refuse(draft.arrow, message, "make the guards disjoint")

    def refuse(self, arrow: Arrow, message: str, hint: str | None = None, relation: Relation | None = None) -> None:
        """Gather a refusal, at the guard where there is one."""
        place = relation or (arrow.guard[0] if arrow.guard else None)
        fault = place.fault(message, hint) if place else arrow.element.fault("HS332", message, hint)
        self.findings.add(fault)


def closed(relation: Relation, excess: Any) -> Constraint:
    """A relation as a constraint; a strict one is closed, which allows more."""
    return zero(excess) if relation.operator == "==" else at_most_zero(excess)


def _implied(constraint: Constraint, given: Sequence[Constraint]) -> bool:
    beyond = [positive(constraint.expr), *([negative(constraint.expr)] if constraint.relation == "= 0" else [])]
    return all(decide([*given, c]).never for c in beyond)


def point(answer: Answer) -> str:
    """The point of an answer in a sentence."""
    return shown(", ".join(f"{name.name} = {v:.4g}" for name, v in answer.point.items()), 80)
