# pyright: basic
"""Rules about guards and resets: crossed, passed or overlapping guards, landings, sliding, cycles at one instant."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import combinations
from typing import Any

import sympy as sp

from hsdsl.analysis.lint.finding import Alike, Finding
from hsdsl.analysis.lint.subject import EdgePart, Subject
from hsdsl.base.functions import replaced
from hsdsl.base.names import listed
from hsdsl.language.expression.scope import symbol
from hsdsl.language.system import TIME, Edge, Mode
from hsdsl.mathematics.decisions.dynamics import Clause, Dynamics, Proof, at, bounding, number, strict, within
from hsdsl.mathematics.decisions.mode_point import ModePoint, Unsure, cycle, ranked, same
from hsdsl.mathematics.decisions.search import UNKNOWN, Answer, Constraint, at_most_zero, negative, positive, zero
from hsdsl.mathematics.decisions.transitions import (
    Landing,
    commute,
    entered_beyond,
    fires,
    landings,
    matters,
    meeting,
    overlap_of,
    passes_by,
    speeds,
    uncrossed,
)

MOST_PAIRS = 100  # that are followed: each takes a hundred times as long as to see whether two guards overlap


def guard_never_crossed(subject: Subject) -> Iterator[Finding]:
    for _, edge in subject.edges:
        found = uncrossed(subject.dynamics, edge.edge)
        if found is None or entered_beyond(subject.dynamics, edge.edge):
            continue
        why, proof = found
        where, hint, severity = within(proof.searched), "reverse the inequality or correct its level", None
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
            # Whether two edges on one surface have an order: every run reaches both at once, and round-off
            # decides nothing
            if (
                first.edge.priority != second.edge.priority
                and first.edge.surface.residual == second.edge.surface.residual
            ):
                continue
            overlaps = overlap_of(subject.dynamics, first.edge, second.edge)
            if not any(subject.dynamics.ask(part.mode, overlap).somewhere for overlap in overlaps):
                continue
            if not left:
                message = f"more than {MOST_PAIRS} pairs of guards of this model overlap: the rule follows no more"
                yield from (*alike, Finding(second.document.when.place.span, message, severity="note"))
                return
            left -= 1
            _follow_both_orders(subject.dynamics, part.mode, first, second, overlaps, alike)
    yield from alike


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
        where = f"{' where r grows along the flow on both (L_f r > 0)' if out else ''}{within(proof.searched)}"
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


def reset_lands_beyond(subject: Subject) -> Iterator[Finding]:
    """Find resets that land outside the next domain: a warning where they always do, else a note."""
    alike = Alike("reset")
    for part, edge in subject.edges:
        _find_beyond(subject.dynamics, part.mode, edge, alike)
    yield from alike


def _find_beyond(dynamics: Dynamics, mode: Mode, edge: EdgePart, alike: Alike) -> None:
    target = dynamics.modes[edge.edge.target]
    for surface, after in bounding(target) if not target.final else ():
        carried = dynamics.carried(dynamics.residual(surface), edge.edge)
        answer = fires(dynamics, edge.edge, positive(carried))
        if not answer.somewhere:
            continue
        proof, guard = Proof(dynamics, mode), dynamics.guard(edge.edge)
        always = guard is not None and proof.never(guard, at_most_zero(carried))
        residual = dynamics.residual(edge.edge.surface)
        about = [residual, carried, *_deciding(dynamics, mode, edge.edge, after, always)]
        where = at(dynamics, mode, answer, about)
        beyond = f"the guard of '{after.name}'" if after else f"the wall '{surface.text}' of '{target.name}'"
        lands = f"lands{within(proof.searched)}" if always else "can land"
        then = _next(ModePoint(dynamics, mode, answer.point), edge)
        message = f"the reset of '{edge.edge.name}' {lands} beyond {beyond}: {where}{then}"
        decided, severity = (proof.decided, "warning") if always else (answer.decided, "note")
        finding = Finding(edge.target_span, message, None, decided, severity=severity)
        alike.add((carried, edge.edge.surface.residual), finding)


def _deciding(dynamics: Dynamics, mode: Mode, edge: Edge, after: Edge | None, always: bool) -> list[Any]:
    """What decides how a run goes on after a landing beyond a surface; where it always is, only edges that go first."""
    target = dynamics.modes[edge.target]
    free = ranked(e for e in target.edges if e.condition is None)
    first = [e.surface for e in free[: free.index(after) if after else None]]
    surfaces = first if always else [surface for surface, _ in bounding(target)]
    rate = [] if always else [dynamics.rate(mode, dynamics.residual(edge.surface))]
    return [*rate, *(dynamics.carried(dynamics.residual(surface), edge) for surface in surfaces)]


def _next(here: ModePoint, edge: EdgePart) -> str:
    """Say what a run does after a transition that lands beyond a surface."""
    try:
        following = here.after(edge.edge).next()
    except Unsure:
        return ""
    return f", where '{following.name}' fires at once" if following else ", where the run stops"


def reset_lands_on_guard(subject: Subject) -> Iterator[Finding]:
    """Find resets that land on surfaces and do not lead away from them."""
    alike = Alike("reset", "with these rates")
    for part, edge in subject.edges:
        for landing in landings(subject.dynamics, edge.edge):
            if landing.rate is not None and not landing.returns:
                _find_on_guard(subject.dynamics, part.mode, edge, landing, alike)
    yield from alike


def _find_on_guard(dynamics: Dynamics, mode: Mode, edge: EdgePart, landing: Landing, alike: Alike) -> None:
    name, residual = edge.edge.name, dynamics.residual(edge.edge.surface)
    kind = (landing.rate, landing.edge is None, dynamics.rate(mode, residual))
    if alike.again(kind):
        return
    own = landing.edge is not None and landing.edge.name == name and landing.edge.source == edge.edge.source
    answer, order = dynamics.ask_any(mode, landing.guard, positive(landing.rate)), 1
    then = "the flow can cross it at once" if landing.edge else "the flow can leave the domain there"
    if not answer.somewhere and own and landing.bend is not None:
        answer = dynamics.ask_any(mode, landing.guard, zero(landing.rate), at_most_zero(-landing.bend))
        then, order = "the flow does not lead away from it (Zeno is possible)", 2
    if not answer.somewhere or not _stays(ModePoint(dynamics, mode, answer.point), edge, landing, order):
        return
    on = f"the guard of '{landing.edge.name}'" if landing.edge else f"the wall '{landing.surface.text}'"
    on = "its own guard" if own else on
    on = on if landing.decided == "symbolic" else f"{on} at every point that was tried"
    about = [residual, landing.rate, landing.bend if own else None]
    message = f"the reset of '{name}' lands on {on}, and {at(dynamics, mode, answer, about)} {then}"
    decided = "sampled" if "sampled" in (landing.decided, answer.decided) else "symbolic"
    alike.add(kind, Finding(edge.target_span, message, None, decided))


def _stays(here: ModePoint, edge: EdgePart, landing: Landing, order: int) -> bool:
    """Whether the flow goes out of the surface after landing, or from the second order on does not go in."""
    try:
        reached = here.after(edge.edge)
        residual = reached.dynamics.residual(landing.surface)
        first, sign = reached.first(residual)
        return reached.sign(residual) == 0 and (sign > 0 if first < order or order == 1 else sign >= 0)
    except Unsure:
        return False


def sliding(subject: Subject) -> Iterator[Finding]:
    """Find pairs of transitions that push against one surface from both sides."""
    dynamics = subject.dynamics
    alike = Alike("pair", "with these rates")
    reported: set[tuple[str, str, str, str]] = set()
    for part, edge in subject.edges:
        residual = dynamics.residual(edge.edge.surface)
        rate = dynamics.rate(part.mode, residual)
        for landing in landings(dynamics, edge.edge):
            back = landing.edge
            if rate is None or landing.rate is None or back is None or not landing.returns:
                continue
            pair = (edge.edge.source, edge.edge.name, back.source, back.name)
            if pair[2:] + pair[:2] in reported or alike.again((rate, landing.rate)):
                continue
            answer = dynamics.ask_any(part.mode, landing.guard, positive(rate), positive(landing.rate))
            if not answer.somewhere or not _returns(ModePoint(dynamics, part.mode, answer.point), edge.edge, back):
                continue
            reported.add(pair)
            where = at(dynamics, part.mode, answer, [residual, rate, landing.rate])
            names = f"'{edge.edge.name}' and '{back.name}'"
            message = f"{names} point towards one surface from both sides (sliding): {where}"
            hint = "give the two surfaces a distance; where sliding is meant, experiment: {completion: auto} follows it"
            decided = "sampled" if answer.decided == "sampled" else "symbolic"
            alike.add((rate, landing.rate), Finding(edge.document.when.place.span, message, hint, decided))
    yield from alike


def _returns(here: ModePoint, edge: Edge, back: Edge) -> bool:
    """Whether the second transition follows the first, and leads back to the state before it."""
    try:
        reached = here.after(edge)
        return reached.next() is back and same(reached.after(back), here)
    except Unsure:
        return False


def zero_time_cycle(subject: Subject) -> Iterator[Finding]:
    """Find cycles of transitions that take no time, once for all that have a surface in common."""
    reported: set[frozenset[str]] = set()
    causes: list[tuple[set[Any], Finding, list[str]]] = []
    for part, edge in subject.edges:
        if _repeats(edge.edge, part.mode):
            message = (
                f"once '{edge.edge.name}' has fired, it fires again at once, for ever: its reset leaves all as it was"
            )
            hint = "write event: instead of when: so that it fires once each time, or reset a state that ends it"
            yield Finding(edge.target_span, message, hint)
            continue
        for answer in _followed_at_once(subject.dynamics, part.mode, edge.edge):
            here = ModePoint(subject.dynamics, part.mode, answer.point)
            edges = cycle(here, edge.edge) if answer.somewhere else None
            names = frozenset(after.name for after in edges or ())
            if not edges or names in reported:
                continue
            reported.add(names)
            surfaces = {side for after in edges for side in _sides(subject.dynamics, after)}
            for known, _, others in causes:
                if known & surfaces:
                    known |= surfaces
                    others.append(listed(after.name for after in edges))
                    break
            else:
                causes.append((surfaces, _cycle_finding(subject.dynamics, part.mode, edge, answer, edges), []))
    for _, finding, others in causes:
        verb = "do" if len(others) > 1 or " and " in "".join(others) else "does"
        more = f"; so {verb} {', as well as '.join(others)}" if others else ""
        yield replace(finding, message=finding.message + more)


def _sides(dynamics: Dynamics, edge: Edge) -> tuple[Any, Any]:
    """A surface function and its opposite: one surface, once either has another level."""
    residual = dynamics.residual(edge.surface)
    return residual, -residual


def _repeats(edge: Edge, mode: Mode) -> bool:
    """Whether the reset of an edge to its own mode changes states, and none that decides about a next transition."""
    if edge.target != mode.name or mode.final:
        return False
    changed = edge.changes.keys()
    surfaces = {x for surface in mode.surfaces for x in surface.residual.free_symbols}
    moving = [row for x, row in mode.vector_field.items() if x in edge.surface.residual.free_symbols]
    rates = {x for row in moving for x in row.free_symbols}
    conditions = {x for e in mode.edges if e.condition is not None for x in e.condition.free_symbols}
    return bool(changed) and not changed & (surfaces | rates | conditions)


def _cycle_finding(dynamics: Dynamics, mode: Mode, edge: EdgePart, answer: Answer, edges: tuple[Edge, ...]) -> Finding:
    about: list[Any] = [*map(symbol, mode.states), *(dynamics.residual(e.surface) for e in (edge.edge, *edges))]
    where = at(dynamics, mode, answer, about)
    names = listed(after.name for after in edges)
    follow = "follow each other" if len(edges) > 1 else "follows itself"
    message = f"once '{edge.edge.name}' has fired {where}, {names} {follow} at one instant without end"
    hint = "give them different levels" if len(edges) > 1 else "let its reset lead inside the domain"
    if len(edges) == 1 and _reflects(dynamics, mode, edges[0]):
        hint = "let it reflect the speed relative to its guard: where that moves at the speed s, v: s - e*(v - s)"
    return Finding(edge.target_span, message, hint, "sampled")


def _reflects(dynamics: Dynamics, mode: Mode, edge: Edge) -> bool:
    """Whether the reset of an edge to its own mode stays where it is on the guard, and changes the rate there."""
    residual = dynamics.residual(edge.surface)
    rate = dynamics.rate(mode, residual)
    known = edge.target == mode.name and rate is not None
    return known and dynamics.carried(residual, edge) == residual and dynamics.carried(rate, edge) != rate


def _followed_at_once(dynamics: Dynamics, mode: Mode, edge: Edge) -> Iterator[Answer]:
    """Points of a guard from which another transition fires at once."""
    target = dynamics.modes[edge.target]
    for after in target.edges if not target.final else ():
        if after.condition is None:
            carried = dynamics.carried(dynamics.residual(after.surface), edge)
            yield fires(dynamics, edge, positive(carried))
    for landing in landings(dynamics, edge):
        if landing.rate is not None and landing.edge is not None and not landing.returns:
            yield dynamics.ask_any(mode, landing.guard, positive(landing.rate))
