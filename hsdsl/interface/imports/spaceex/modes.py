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
from dataclasses import dataclass, field, replace
from typing import Any

from hsdsl.base.errors import Findings
from hsdsl.base.functions import replaced
from hsdsl.base.names import shown
from hsdsl.interface.imports.spaceex.document import Relation, names_in, value, within
from hsdsl.interface.imports.spaceex.network import Arrow, Key, Network, Place, place
from hsdsl.interface.imports.spaceex.points import decide
from hsdsl.language.expression.algebra import lie_derivative
from hsdsl.language.expression.scope import symbol
from hsdsl.mathematics.decisions.search import Answer, Constraint, at_most_zero, negative, positive, zero


def mode_drafts(
    network: Network, places: Mapping[Key, Place], arrows: Sequence[Arrow], constants: Mapping[Any, Any]
) -> dict[Key, ModeDraft]:
    """A mode for each place.

    Raises ModelError: a variable without a derivative, or an equation that the flow does not keep.
    """
    leaving: dict[Key, list[Arrow]] = {}
    for arrow in arrows:
        leaving.setdefault(arrow.source, []).append(arrow)
    drafts = {key: _draft(network, place, leaving.get(key, []), constants) for key, place in places.items()}
    for arrow in arrows:
        # Refuse an arrow that leaves a state of its target without a value.
        source = drafts[arrow.source]
        for name in drafts[arrow.target].states:
            if name not in {*source.states, *source.lets, *arrow.reset}:
                message = (
                    f"'{name}' has no derivative in location {source.place.name}, and no value after this transition"
                )
                raise arrow.element.refusal("HS332", message, f"assign a value: {name} := ...")
    return drafts


def lone_draft(network: Network, key: Key, constants: Mapping[Any, Any]) -> ModeDraft:
    """The mode of one place, without its transitions."""
    return _draft(network, place(network, key, ()), [], constants)


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
    draft = ModeDraft(place, states, lets, flow, {}, [], values)
    for relation in rest:
        if relation.operator == "==":
            rate = lie_derivative(draft.excess(relation), draft.flow)
            if not all(decide([*draft.inside, beyond]).never for beyond in (positive(rate), negative(rate))):
                raise relation.refusal("the flow does not keep this equation of the invariant: time cannot pass")
            draft.comments.append(f"`{relation.text}` holds all along")
            draft.equalities.append(draft.excess(relation))
        else:
            draft.facets.setdefault(draft.excess(relation), relation)
    return draft


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
                hint = f"give it one, or an equation `{name} == ...` in the invariant, or a value by --at {name}=NUMBER"
                raise relation.refusal(message, hint)


@dataclass
class ModeDraft:
    """A location as a mode of a model: ``lets`` are its variables that an equality of the invariant gives."""

    place: Place
    states: list[str]
    lets: dict[str, str]
    flow: dict[Any, Any]  # of symbols
    facets: dict[Any, Relation]  # inequalities of the invariant by their excess, which is at most zero inside
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
        return [*map(at_most_zero, self.facets), *map(zero, self.equalities)]

    def kept(self, facet: Any) -> bool:
        """Whether the flow leads back inside all over a facet, or moves nothing across it."""
        rate = lie_derivative(facet, self.flow)
        return rate == 0 or decide([*self.inside, zero(facet), at_most_zero(-rate)]).never


@dataclass
class TransitionDraft:
    """A transition of a model, at a surface ``when`` or where all of ``event`` begins to hold.

    ``facet`` is the excess of the facet; None where its surface is none of the invariant, by choice.
    """

    arrow: Arrow
    when: Relation | None
    condition: list[str]
    guard: list[Constraint]
    facet: Any | None
    comments: list[str]
    event: list[str] = field(default_factory=list[str])


STRICT = "<>"
ALWAYS = "1 >= 0"  # the condition of an event that goes on entry
INWARD = "SpaceEx may also jump where the flow leads back inside; this does not"
LATER = "SpaceEx may jump later: made as soon as the guard holds"
FIRST = "SpaceEx may make either of several transitions: the first of them here is made"


@dataclass(frozen=True)
class Judge:
    """Decides about arrows, and gathers what cannot be kept; ``eager`` jumps as soon as a guard allows it."""

    findings: Findings
    eager: bool = False

    def transitions(self, arrow: Arrow, source: ModeDraft, target: ModeDraft) -> list[TransitionDraft]:
        """The transitions for an arrow, mostly one; none where it is never made, or was refused.

        A jump is made only to where the target's invariant holds: that counts as a part of its guard.
        """
        texts = {name: within(relation.right) for name, relation in arrow.reset.items()}
        landed = [relation.renamed(texts) for relation in target.facets.values()]  # of values before the jump
        relations = [side for relation in (*arrow.guard, *landed) for side in _sides(relation, source)]
        guard = [closed(relation, source.excess(relation)) for relation in relations]
        if decide([*source.inside, *guard]).never:
            source.comments.append(f"no transition to {target.place.name}: its guard never holds in the invariant")
            return []
        self.landing(arrow, source, target, guard)
        eager = self.eager or arrow.urgent or not source.place.passing
        facet, witness = self.facet(relations, source, guard) if source.place.passing else (None, None)
        if facet is None and not eager:
            where = f" ({point(witness)})" if witness and witness.point else ""
            message = f"the guard can hold where the invariant does not end{where}: SpaceEx may jump there or go on"
            hint = "end the invariant where the guard begins, or give --urgent: jump as soon as the guard holds"
            self.refuse(arrow, message, hint)
            return []
        if facet is not None:
            drafts = self.on_facet(arrow, source, facet, guard, relations)
        else:
            drafts = self.at_once(arrow, source, guard, relations)
        known = {new.text: old.text for old, new in zip(target.facets.values(), landed, strict=True)}
        for draft in drafts:
            kept = [f"`{known[text]}`" for text in (*draft.condition, *draft.event) if text in known]
            if kept:
                draft.comments.append(f"SpaceEx jumps only to where {' and '.join(kept)} holds in {target.place.name}")
        return drafts

    def facet(
        self, relations: Sequence[Relation], source: ModeDraft, guard: list[Constraint]
    ) -> tuple[Any | None, Answer | None]:
        """The facet that the guard lies on; else a point where the guard holds off one."""
        witness: Answer | None = None
        mentioned = {name for relation in relations for name in relation.names}
        for facet in sorted(source.facets, key=lambda f: not source.facets[f].names <= mentioned):
            answer = decide([*source.inside, *guard, negative(facet)])
            if answer.never:
                return facet, None
            witness = answer if answer.somewhere or witness is None else witness
        return None, witness

    def on_facet(
        self, arrow: Arrow, source: ModeDraft, facet: Any, guard: list[Constraint], relations: Sequence[Relation]
    ) -> list[TransitionDraft]:
        """The transition of an arrow whose guard lies on a facet: made where the invariant ends."""
        on = [*source.inside, zero(facet)]
        rate = lie_derivative(facet, source.flow)
        draft = TransitionDraft(arrow, source.facets[facet].mirrored(), [], guard, facet, [])
        self.conditions(draft, source, [*on, at_most_zero(-rate)], relations)
        if not decide([*on, *guard, negative(rate)]).never:
            draft.comments.append(INWARD)
        return [draft]

    def at_once(
        self, arrow: Arrow, source: ModeDraft, guard: list[Constraint], relations: Sequence[Relation]
    ) -> list[TransitionDraft]:
        """The transitions that are made as soon as a guard holds.

        One inequality that the flow crosses is a surface. Several, or one that may be met at rest, are an event. An
        equation is a surface from both of its sides. What always holds is a surface that every point is beyond.
        """
        pairs = zip(relations, guard, strict=True)
        open_ = [(r, c) for r, c in pairs if not _implied(c, source.inside, r.operator in STRICT)]
        comments = [LATER] if source.place.passing else []
        equations = [r for r, _ in open_ if r.operator == "=="]
        others = [r for r, _ in open_ if r.operator != "=="]
        if equations:
            if len(equations) > 1:
                message = "the first time at which this guard holds is not where one inequality begins to hold"
                self.refuse(arrow, message, "write a guard with one equation at most")
                return []
            conditions = [r.text for r in others] or ["true"]
            sides = [replace(equations[0], operator=operator) for operator in (">=", "<=")]
            return [TransitionDraft(arrow, side, [*conditions], guard, None, [*comments]) for side in sides]
        draft = TransitionDraft(arrow, None, [], guard, None, comments, [r.text for r in others] or [ALWAYS])
        if len(others) == 1 and source.place.passing:
            (excess,) = (c.expr for r, c in open_ if r is others[0])
            if decide([*source.inside, zero(excess), at_most_zero(-lie_derivative(excess, source.flow))]).never:
                return [replace(draft, when=others[0], event=[])]
        return [draft]

    def conditions(
        self, draft: TransitionDraft, source: ModeDraft, leaving: Sequence[Constraint], relations: Sequence[Relation]
    ) -> None:
        """What of the guard the surface does not imply."""
        facet = draft.when.text if draft.when else ""
        for relation in relations:
            excess = source.excess(relation)
            if relation.operator == "==":
                if not all(decide([*leaving, beyond]).never for beyond in (positive(excess), negative(excess))):
                    message = f"the guard is smaller than the facet `{facet}` by an equation, not by a region"
                    self.refuse(draft.arrow, message, "write an inequality", relation)
            elif decide([*leaving, at_most_zero(-excess) if relation.operator in STRICT else positive(excess)]).never:
                continue
            elif relation.operator in STRICT and decide([*leaving, positive(excess)]).never:
                draft.comments.append(
                    f"`{relation.text}` is left out: where the flow leads out it holds, but for its boundary"
                )
            else:
                draft.condition.append(relation.text)

    def landing(self, arrow: Arrow, source: ModeDraft, target: ModeDraft, guard: Sequence[Constraint]) -> None:
        """Refuse a jump that can miss an equation of its target."""
        moves = {symbol(name): value(relation.right) for name, relation in arrow.reset.items()}
        for equality in target.equalities:
            landed = source.placed(replaced(equality, moves, {}))
            given = [*source.inside, *guard]
            if not all(decide([*given, beyond]).never for beyond in (positive(landed), negative(landed))):
                self.refuse(arrow, f"the jump can miss an equation of the invariant of {target.place.name}")

    def choices(self, drafts: Sequence[TransitionDraft], source: ModeDraft) -> None:
        """Refuse two transitions that are possible in a region of one facet, or at one instant where no time passes."""
        for i, draft in enumerate(drafts):
            if any(self.overlap(draft, other, source) for other in drafts[:i] if other.arrow is not draft.arrow):
                if self.eager:
                    draft.comments.append(FIRST)
                    continue
                message = "this guard overlaps with that of a transition before it: either may be made"
                hint = "make the guards disjoint, or give --urgent: the first of them in the file is made"
                self.refuse(draft.arrow, message, hint)

    def overlap(self, draft: TransitionDraft, other: TransitionDraft, source: ModeDraft) -> bool:
        """Whether two transitions are possible in a region."""
        if not source.place.passing:
            return not decide([*source.inside, *draft.guard, *other.guard]).never
        if draft.facet is None or draft.facet != other.facet:
            return False
        on = zero(draft.facet)
        region = [negative(facet) for facet in source.facets if facet != draft.facet]
        held = [c for c in (*draft.guard, *other.guard) if not _implied(c, [*source.inside, on])]
        if any(c.relation == "= 0" for c in held):
            return False
        strictly = [Constraint(c.expr, "< 0") for c in held]
        return not decide([on, *map(zero, source.equalities), *region, *strictly]).never

    def refuse(self, arrow: Arrow, message: str, hint: str | None = None, relation: Relation | None = None) -> None:
        """Gather a refusal, at the guard where there is one."""
        place = relation or (arrow.guard[0] if arrow.guard else None)
        self.findings.add(place.fault(message, hint) if place else arrow.element.fault("HS332", message, hint))


def _sides(relation: Relation, source: ModeDraft) -> list[Relation]:
    """A relation; two inequalities for an equation that no flow changes, as of a counter."""
    still = relation.operator == "==" and lie_derivative(source.excess(relation), source.flow) == 0
    return [replace(relation, operator=operator) for operator in (">=", "<=")] if still else [relation]


def closed(relation: Relation, excess: Any) -> Constraint:
    """A relation as a constraint; a strict one is closed, which allows more."""
    return zero(excess) if relation.operator == "==" else at_most_zero(excess)


def _implied(constraint: Constraint, given: Sequence[Constraint], strict: bool = False) -> bool:
    outside = [at_most_zero(-constraint.expr) if strict else positive(constraint.expr)]
    outside += [negative(constraint.expr)] if constraint.relation == "= 0" else []
    return all(decide([*given, c]).never for c in outside)


def point(answer: Answer) -> str:
    """The point of an answer in a sentence."""
    return shown(", ".join(f"{name.name} = {v:.4g}" for name, v in answer.point.items()), 80)
