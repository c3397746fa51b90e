# pyright: basic
"""Rules about guards: whether flows cross or pass them, and whether they overlap."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import combinations
from typing import Any

import sympy as sp

from hsdsl.analysis.lint.finding import Alike, Finding
from hsdsl.analysis.lint.subject import EdgePart, Subject
from hsdsl.base.functions import replaced
from hsdsl.language.system import TIME, Edge, Mode
from hsdsl.mathematics.decisions.commutation import commute, matters, meeting, overlap_of, speeds
from hsdsl.mathematics.decisions.crossing import passes_by, uncrossed
from hsdsl.mathematics.decisions.dynamics import Clause, Dynamics
from hsdsl.mathematics.decisions.landing import entered_beyond
from hsdsl.mathematics.decisions.mode_point import ModePoint
from hsdsl.mathematics.decisions.proof import strict
from hsdsl.mathematics.decisions.question import UNKNOWN, Answer, Constraint, negative, positive, zero
from hsdsl.mathematics.decisions.wording import at, number, within

MOST_PAIRS = 100  # that are followed: each takes a hundred times as long as to see whether two guards overlap


def guard_never_crossed(subject: Subject) -> Iterator[Finding]:
    """Find guards that no flow crosses."""
    for _, edge in subject.edges:
        found = uncrossed(subject.dynamics, edge.edge)
        if found is None or entered_beyond(subject.dynamics, edge.edge):
            continue
        why, proof = found
        where, hint, severity = within(proof.searched), "turn the inequality round or correct its level", None
        if any(s is not TIME for s, _, _ in proof.searched):  # a run may go beyond
            hint = f"a run that leaves these bounds may cross it; where none does, {hint}"
            severity = "note"
        crosses = f"{'does not cross' if where else 'never crosses'} the guard of '{edge.edge.name}'{where}"
        span = edge.document.when.place.span
        yield Finding(span, f"the flow {crosses}: {why}", hint, proof.decided, severity=severity)


def condition_beyond_surface(subject: Subject) -> Iterator[Finding]:
    """Find conditions that can become true where nothing fires."""
    dynamics = subject.dynamics
    for part, edge in subject.edges:
        if edge.edge.condition is None or edge.document.condition is None:
            continue
        answer = _turns_true(dynamics, part.mode, edge)
        if answer.somewhere and passes_by(dynamics, edge.edge).somewhere:
            about = [dynamics.residual(edge.edge.surface), dynamics.placed(edge.edge.condition)]
            where = at(dynamics, part.mode, answer, about)
            name = edge.edge.name
            message = f"the `if` of '{name}' can become true beyond its surface, {where}, and nothing fires there"
            hint = "to fire where both have become true, write `event: A and B` in the place of `when: A` with `if: B`"
            yield Finding(edge.document.condition.place.span, message, hint, answer.decided)


def _turns_true(dynamics: Dynamics, mode: Mode, edge: EdgePart) -> Answer:
    """A point beyond the surface where the flow carries a comparison of the `if` to true."""
    beyond = (positive(dynamics.residual(edge.edge.surface)), *strict(dynamics.domain(mode, without=edge.edge)))
    for clause in dynamics.condition(edge.edge) or ():
        for comparison in clause:
            rate = dynamics.rate(mode, comparison.expr)
            if comparison.relation == "= 0" or rate is None:
                continue
            others: list[Constraint] = [c for c in clause if c is not comparison]
            answer = dynamics.ask(mode, (*beyond, zero(comparison.expr), negative(rate), *others))
            if answer.somewhere:
                return answer
    return UNKNOWN


def guard_inside_domain(subject: Subject) -> Iterator[Finding]:
    """Find surfaces that the flow passes where no `if` holds, once for each surface of a mode."""
    dynamics = subject.dynamics
    reported: set[tuple[str, Any]] = set()
    for part, edge in subject.edges:
        if edge.edge.condition is None or edge.document.condition is None:
            continue
        residual = dynamics.residual(edge.edge.surface)
        answer = passes_by(dynamics, edge.edge)
        if not answer.somewhere or (part.mode.name, residual) in reported:
            continue
        reported.add((part.mode.name, residual))
        inside = [constraint.expr for constraint in dynamics.domain(part.mode, without=edge.edge)]
        about = [residual, dynamics.placed(edge.edge.condition), dynamics.rate(part.mode, residual), *inside]
        passes = f"{at(dynamics, part.mode, answer, about)} the flow passes its surface, and nothing fires"
        message = f"the guard of '{edge.edge.name}' lies inside its domain: {passes}"
        hint = "add a transition for the rest of the surface, unless passing is intended"
        yield Finding(edge.document.condition.place.span, message, hint, answer.decided)


def guard_turns_inward(subject: Subject) -> Iterator[Finding]:
    """Find guards that the flow leaves through or not, depending on time."""
    dynamics = subject.dynamics
    moving = {TIME, *dynamics.inputs}
    for part, edge in subject.edges:
        residual = dynamics.residual(edge.edge.surface)
        rate = dynamics.rate(part.mode, residual)
        if rate is None or not rate.free_symbols & moving:
            continue
        surface = dynamics.guard(edge.edge, pointing_out=False) or []
        answer, later = _at_two_times(dynamics, part.mode, surface, negative(rate), positive(rate))
        if not answer.somewhere:
            continue
        where = at(dynamics, part.mode, answer, [residual, rate])
        changed = (residual.free_symbols | rate.free_symbols) & moving
        then = ", ".join(f"{s.name} = {number(later[s])}" for s in later if s in changed)
        depends = f"{where} it points back into the domain, and out of it with {then}"
        message = f"whether the flow leaves through the guard of '{edge.edge.name}' depends on time: {depends}"
        yield Finding(edge.document.when.place.span, message, None, answer.decided)


def _at_two_times(
    dynamics: Dynamics, mode: Mode, alternatives: Sequence[Clause], once: Constraint, again: Constraint
) -> tuple[Answer, Mapping[Any, float]]:
    """Look for a state where one constraint holds at one time, another at another, and an alternative at both.

    Returns the state with the first time and inputs, and the time and the inputs of the second.
    """
    copies, ranges = dynamics.remembered(("two times", mode.name), lambda: _copies(dynamics, mode))
    for clause in alternatives:
        later = tuple(c.along(replaced(c.expr, copies, {})) for c in (*clause, again))
        answer = dynamics.decider.decide(tuple(dict.fromkeys((*clause, once, *later))), ranges)
        if answer.somewhere:
            return answer, {name: answer.point[copy] for name, copy in copies.items()}
    return UNKNOWN, {}


def _copies(dynamics: Dynamics, mode: Mode) -> tuple[dict[Any, Any], dict[Any, Any]]:
    copies = {s: sp.Symbol(f"later {s.name}", real=True) for s in (*sorted(dynamics.inputs, key=str), TIME)}
    ranges = dynamics.ranges(mode)
    return copies, {**ranges, **{copy: ranges[s] for s, copy in copies.items()}}


def overlapping_guards(subject: Subject) -> Iterator[Finding]:
    """Find guards that overlap, and say whether the order of their transitions matters."""
    alike = Alike("pair")
    left = MOST_PAIRS
    for part in subject.modes:
        for first, second in combinations(part.edges, 2):
            if _ordered(first.edge, second.edge):
                continue
            overlaps = overlap_of(subject.dynamics, first.edge, second.edge)
            if not any(subject.dynamics.ask(part.mode, overlap).somewhere for overlap in overlaps):
                continue
            if not left:
                message = f"more than {MOST_PAIRS} pairs of guards of this model overlap: from here on none is followed"
                yield from (*alike, Finding(second.document.when.place.span, message, severity="note"))
                return
            left -= 1
            _follow_both_orders(subject.dynamics, part.mode, first, second, overlaps, alike)
    yield from alike


def _ordered(first: Edge, second: Edge) -> bool:
    """Whether two edges on one surface have an order: every run reaches both at once, and round-off decides nothing."""
    return first.priority != second.priority and first.surface.residual == second.surface.residual


def _follow_both_orders(
    dynamics: Dynamics, mode: Mode, first: EdgePart, second: EdgePart, overlaps: Sequence[Clause], alike: Alike
) -> None:
    out = speeds(dynamics, first.edge, second.edge)
    answers = (meeting(dynamics, first.edge, second.edge, overlap) for overlap in overlaps)
    answer = next((answer for answer in answers if answer.somewhere), None)
    if answer is None:
        return
    different = matters(ModePoint(dynamics, mode, answer.point), first.edge, second.edge)
    proof = None if different else commute(dynamics, first.edge, second.edge, [(*o, *out) for o in overlaps])
    decided = answer.decided
    if proof is not None:
        where = f"{' where L_f r > 0 on both' if out else ''}{within(proof.searched)}"
        then = f"they commute{where}: either order leads to the same state"
        decided = "interval" if proof.decided == "interval" and decided == "symbolic" else decided
    else:
        then = _UNPROVED[different]
    residuals = [dynamics.residual(edge.edge.surface) for edge in (first, second)]
    where = at(dynamics, mode, answer, residuals)
    message = f"the guards of '{first.edge.name}' and '{second.edge.name}' overlap, {where}; {then}"
    hint = None if proof else _separate(first.edge, second.edge)
    severity = "note" if proof else "warning"
    kind = (then, *(dynamics.rate(mode, residual) for residual in residuals))
    alike.add(kind, Finding(second.document.when.place.span, message, hint, decided, severity=severity))


def _separate(first: Edge, second: Edge) -> str:
    if first.priority == second.priority:
        return "separate them with `if`, or say with `priority` which goes first"
    winner = max(first, second, key=lambda edge: edge.priority)
    return f"separate them with `if`; where both are reached '{winner.name}' goes first, by its priority"


_UNPROVED = {
    None: "whether it matters which goes first is not known",
    True: "it matters which goes first",
    False: "either order leads to the same state there, elsewhere perhaps not",
}
