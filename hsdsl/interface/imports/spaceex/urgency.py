# pyright: basic
"""Transitions of a model for the arrows of an automaton, where "may" and "must" jump are one.

In SpaceEx a guard allows a jump, and only the end of the invariant forces it. A transition of a model is made where its
surface is crossed. Both have the same executions where the guard, inside the invariant, lies on a facet of it, and the
flow leads out there. That is proved for each arrow; what differs otherwise is a comment or a refusal.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from hsdsl.base.errors import Findings
from hsdsl.base.functions import replaced
from hsdsl.base.names import shown
from hsdsl.interface.imports.spaceex.drafts import Facet, ModeDraft, TransitionDraft
from hsdsl.interface.imports.spaceex.feasibility import decide
from hsdsl.interface.imports.spaceex.formula import Relation, renamed, within
from hsdsl.interface.imports.spaceex.product import Arrow
from hsdsl.language.expression.algebra import lie_derivative
from hsdsl.language.expression.plain import value
from hsdsl.language.expression.scope import symbol
from hsdsl.mathematics.decisions.search import Answer, Constraint, at_most_zero, negative, positive, zero

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
