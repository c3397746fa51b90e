"""Resets, and what follows: is each continuous around its transition, and does it land on no surface?

A reset may put every state of its guard onto a surface, as a touchdown puts a foot onto its lift-off guard: states
moved by the error along the guard land on it too. Where they do not, an error decides on which side the run goes on.

A jump of an input within the error of a transition is no obstacle where the order of the two does not matter.

The theorem has no arc that leaves a surface tangentially, as where sliding ends. Derivatives exist all the same where
executions from nearby leave the surface too: they reach it with the value zero and the rate zero, as states of a motion
along it do that its end releases.

A reset that puts the state outside of the next mode's domain is not what the theorem is about. Where an event is set
off so at once on entry (M5), or a transition of another part, or by a jump of an input, it is what the model says: one
reset after another is a reset as well. The theorem holds for it where it is continuous: the state is clearly beyond the
surface, and clearly not beyond those that would go first. The order among these is the file's.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterator
from itertools import pairwise
from math import isfinite

from hsdsl.base.numbers.arithmetic import DOMAIN_ERRORS, Number
from hsdsl.base.numbers.enclosures import Range, Undecided, as_range
from hsdsl.engine.execution import Arc, Transition
from hsdsl.engine.integrators.stepper import State
from hsdsl.engine.kernel import ModeKernel
from hsdsl.engine.simulate.input_segments import Segment
from hsdsl.engine.simulate.stops import show
from hsdsl.engine.simulate.verdict.errors import SAFE, times
from hsdsl.engine.simulate.verdict.run_view import ALONG, GUARD_ROUNDS, Finding, Place, RunView, moved_onto
from hsdsl.engine.simulate.verdict.screen import RESET_UNDECIDED

UNITS = 64  # of round-off, and less, are no jump
WIDER = 8  # boxes so many times as wide: what jumps is no wider over them

Sides = tuple[Segment, Segment]


def landings(run: RunView) -> tuple[list[Finding], list[str]]:
    """Findings about the state that every arc of flow begins with, and about every reset."""
    if run.errors is None:
        return [], []
    found: list[Finding] = []
    for arc in run.undecided_flows("landing"):
        place = run.at_row(arc, arc.first)
        for k in place.mode.surfaces:
            try:
                if not (run.followed and leaves_along(run, arc, k)):
                    found += _start_on(run, place, k) if arc.first == 0 else _landing_on(run, arc, place, k)
            except DOMAIN_ERRORS:
                continue  # `misses` says so along the arc
    for made in run.undecided_transitions(RESET_UNDECIDED):
        try:
            place, k = run.before(made)
            if any(
                not indifferent(run, place, k, sides, made) for sides in jumps_near(run, made.time, run.late(made.time))
            ):
                where = f"the time of {made.edge} at t = {show(made.time)}"
                found.append(
                    Finding("input", "unknown", f"an input or function of time jumps within the error of {where}")
                )
            found += _smooth_reset(run, made)
        except DOMAIN_ERRORS:
            continue
    return found, []


def _start_on(run: RunView, place: Place, k: int) -> Iterator[Finding]:
    """Whether a run starts on a surface, and it is not sure what it does there within a tie and its error."""
    if abs(place.value(k)) <= place.roundoff_bound(k):
        slope, tie = place.kernel.flow(place.t, *place.x), run.tie(place.t)
        moved = zip(run.safe_error(place, 0), place.x, slope, strict=True)
        soon = tuple(e + run.arithmetic.unit * abs(x) + abs(f) * tie for e, x, f in moved)
        if not _decided_on(place, k, soon, tie):
            how = "which has an `if`" if place.has_condition(k) else "to which the flow is tangent"
            yield Finding("start", "unknown", f"the run starts on {place.where(k)}, {how}")


def _landing_on(run: RunView, arc: Arc, place: Place, k: int) -> Iterator[Finding]:
    """Whether the transition before an arc lands within the error of a surface that it need not land on."""
    if not arc.jump:
        return
    made, conditional = run.transitions[arc.jump - 1], place.has_condition(k)
    value, noise = place.value(k), place.roundoff_bound(k)
    shift, late = run.surface_error(place, k, arc.first), run.late(place.t)
    if any(before.alternatives for before in run.cascade(made)[:-1]) or abs(value) > SAFE * shift + noise:
        return  # `choices` decides what follows others at the same instant that were tied
    if place.rate(k) > place.rate_roundoff(k) and not conditional:
        return  # it is crossed at once, on either side of it
    error = run.safe_error(place, arc.first)
    if conditional and place.conditions(k, error, late) == {False}:
        return
    if conditional and place.rates_within(k, error, late).high <= 0:
        return  # nothing fires, on either side of it
    if (not shift > 0 and _decided_on(place, k, error, late)) or _keeps(run, made, k, value):
        return
    on = abs(value) <= noise or not shift > 0
    away = f"on {place.where(k)}" if on else f"{times(abs(value) / shift)} the error away from {place.where(k)}"
    yield Finding("landing", "unknown", f"the reset of {made.edge} lands {away}")


def _decided_on(place: Place, k: int, error: State, late: Number) -> bool:
    """Whether it is sure what a state does that is known to be on surface k: fire, leave inwards, or stay."""
    conditional = place.has_condition(k)
    holds = place.conditions(k, error, float(late)) if conditional else {True}
    rate = place.rates_within(k, error, float(late))
    if holds == {False} or rate.high < 0 or rate.low == rate.high == 0:
        return True
    return (rate.low > 0 and holds == {True}) or (conditional and rate.high <= 0)


def _keeps(run: RunView, made: Transition, k: int, value: Number) -> bool:
    """Whether states near the one before a transition, moved along its guard, land where surface k has its value.

    Of transitions without flow between them the first one's guard counts.
    """
    chain = run.cascade(made)
    before, edge = run.before(chain[0])
    if len(chain) == 1 and k == edge and made.target == made.source and before.mode.affine:
        slopes = before.kernel.gradients[edge](before.t, *before.x)[1:]
        rows = zip(before.mode.states, before.mode.edges[edge].reset_texts, slopes, strict=True)
        if all(text == name for name, text, slope in rows if slope):
            return True  # it depends on no state that its own reset changes
    here = run.after(chain, before.x)
    for after in (near := run.landed_nearby(chain, run.error_before(chain[0]))):
        slopes = after.kernel.gradients[k](after.t, *after.x)[1:]
        change = sum((abs(g * (a - b)) for g, a, b in zip(slopes, after.x, here.x, strict=True)), run.arithmetic.zero)
        if abs(after.value(k) - value) > ALONG * change + run.roundoff(after, k, run.row_before(made)):
            return False
    return bool(near)


def entries(run: RunView) -> tuple[list[Finding], list[str]]:
    """Findings about transitions that fired at once on entry."""
    found: list[Finding] = []
    if run.errors is None or not run.execution.enters_beyond:
        return found, []
    at_once = [made for made in run.reliable_transitions if made.entry]
    meant = [_is_meant(run, made) for made in at_once]
    outside = [made for made, is_meant in zip(at_once, meant, strict=True) if not is_meant]
    undecided = [made for made, is_meant in zip(at_once, meant, strict=True) if is_meant and not _is_sure(run, made)]
    for some, why in (
        (outside, "the state entered {} outside its domain"),
        (undecided, "an error in {} may keep it from that"),
    ):
        if some:
            first = f"{some[0].edge} at t = {show(some[0].time)}: {why.format(some[0].source)}"
            many = f"{len(some)} transition{'s' * (len(some) > 1)} fired at once on entry, the first {first}"
            found.append(Finding("entry", "unknown", many))
    for made in at_once:
        found += _smooth_reset(run, made)
    return found, []


def _is_meant(run: RunView, made: Transition) -> bool:
    """Whether the model says that a transition is set off so."""
    place, k = run.before(made)
    jumps = made.time > 0 and run.problem.timeline.at(made.time).start == made.time and len(run.cascade(made)) == 1
    return bool(run.problem.program.parts or place.mode.edges[k].of_event or jumps)


def _is_sure(run: RunView, made: Transition) -> bool:
    """Whether the state is beyond the surface of a transition, and beyond none that goes first, within the error."""
    place, k = run.before(made)
    row, edges = run.row_before(made), place.mode.edges
    try:
        box = place.box(run.safe_error(place, row), run.late(made.time))
        values = [as_range(r) for r in place.enclosing().surfaces(*box)]
        tied = {name for before in run.cascade(made) for name in before.alternatives}  # `choices` decides on these
        before = [j for j, edge in enumerate(edges) if (edge.priority, -j) > (edges[k].priority, -k)]
        first = [j for j in before if not edges[j].conditional and edges[j].name not in tied]
        known = {j: not run.surface_error(place, j, row) > 0 for j in (k, *first)}
    except (Undecided, *DOMAIN_ERRORS):
        return False
    return (values[k].low > 0 or known[k]) and all(values[j].high < 0 or known[j] for j in first)


def _smooth_reset(run: RunView, made: Transition) -> Iterator[Finding]:
    """Whether the reset of a transition is continuous around it: it jumps where a wider box makes it little wider."""
    place, k = run.before(made)
    if made.after is None or not place.mode.curved[k]:
        return
    late, error = run.late(made.time), run.error_before(made)
    narrow, wide = (_widths(place, k, [n * e for e in error], n * late) for n in (1, WIDER))
    noise = zip(made.after.values(), _noise(place, k), strict=True)
    least = [max(UNITS * float(run.arithmetic.unit) * abs(float(value)), n) for value, n in noise]
    names = zip(made.after, narrow, least, wide, strict=True)
    jump = [name for name, a, b, c in names if not isfinite(a) or (a > b and c < a * WIDER / 2)]
    chain = run.cascade(made)
    if jump and not run.remembered_alike(chain, jump, run.error_before(chain[0])):
        where = f"{made.edge} at t = {show(made.time)}"
        yield Finding("reset", "unknown", f"the reset of {where} jumps within the error")


def _noise(place: Place, k: int) -> list[float]:
    """What the enclosure of each result of a reset is wide at a point; 0 where it jumps within round-off of that."""
    wide, units = _widths(place, k, [0.0] * len(place.x), 0.0), UNITS * place.surfaces.arithmetic.unit
    sizes = place.kernel.spreads[k](place.t, *place.x, *map(abs, place.x))
    moved = place.moved_by(tuple(units * abs(x) for x in place.x))
    results = zip(*(place.kernel.resets[k](place.t, *x) for x in moved), strict=True)
    apart = [max(r) - min(r) <= 4 * units * abs(size) for r, size in zip(results, sizes, strict=True)]
    return [2 * w if little else 0.0 for w, little in zip(wide, apart, strict=True)]


def _widths(place: Place, k: int, error: list[float], late: float) -> list[float]:
    """How far apart the results of a reset may be over a box around a place."""
    results = place.enclosing().resets[k](*place.box(error, late))
    return [float(r.high - r.low) if isinstance(r, Range) else 0.0 for r in results]


def jumps_near(run: RunView, t: Number, late: float) -> Iterator[Sides]:
    """The segments on both sides of each jump of an input that is no further from a time than that may be late."""
    segments = run.problem.timeline.segments
    number = max(0, bisect_right(segments, t, key=lambda segment: segment.start) - 1)
    for before, after in zip(segments[max(0, number - 1) : number + 1], segments[number or 1 :], strict=False):
        if after.jump and abs(float(after.start) - float(t)) <= late:
            yield before, after


def indifferent(run: RunView, place: Place, k: int, sides: Sides, made: Transition | None = None) -> bool:
    """Whether a transition of edge k is the same on both sides of a jump, so that both orders lead to one point.

    The jump changes neither a surface of the modes that it leaves and enters nor its reset, and the flow crosses its
    surface before and after it. What the jump itself sets off, at once on entry, is after it.
    """
    if made is not None and made.entry and made.time == sides[1].start and len(run.cascade(made)) == 1:
        return True
    t, x, target = place.t, place.x, place.mode.edges[k].target

    def decides(kernel: ModeKernel) -> tuple[object, ...]:
        return kernel.surfaces(t, *x), kernel.conditions[k](t, *x), kernel.resets[k](t, *x)

    try:
        one, other = (run.problem.kernel.bind(run.index(place.mode.name), side.data) for side in sides)
        if decides(one) != decides(other):
            return False
        entry = made is not None and made.entry
        if not (entry or min(side.rates[k](t, *x)[0] for side in (one, other)) > place.rate_roundoff(k)):
            return False
        after = one.resets[k](t, *x)
        behind = [run.problem.kernel.bind(target, side.data).surfaces(t, *after) for side in sides]
    except DOMAIN_ERRORS:
        return False
    return behind[0] == behind[1]


def leaves_along(run: RunView, arc: Arc, k: int) -> bool:
    """Whether an arc and all from nearby begin on surface k of their mode, at the rate zero, and then fall below it."""
    if not arc.jump or run.errors is None:
        return False
    made, place = run.transitions[arc.jump - 1], run.at_row(arc, arc.first)
    try:
        if abs(place.value(k)) > place.roundoff_bound(k) or not _falls(run, arc, k):
            return False
        (before, edge), error = run.before(made), run.error_before(made)
        near = [run.after([made], x) for x in before.moved_by(error)]
        value, rate = ALONG * max(abs(at.value(k)) for at in near), ALONG * max(abs(at.rate(k)) for at in near)
        kept = _kept(run, made, k)
        for x in before.along_guard(edge, error):
            at = run.after([made], _onto(run, made, k, x) if kept else x)
            if abs(at.value(k)) > value + at.roundoff_bound(k) or abs(at.rate(k)) > rate + at.rate_roundoff(k):
                return False
        return True
    except DOMAIN_ERRORS:
        return False


def _falls(run: RunView, arc: Arc, k: int) -> bool:
    """Whether the surface falls on the first step of an arc, ever faster at first."""
    along = run.dense_output(arc, arc.first)
    rates = [along(run.arithmetic.zero + 2.0**-i).rate(k) for i in range(20, 2, -1)]
    return all(b < a < 0 for a, b in pairwise(rates))


def _kept(run: RunView, made: Transition, k: int) -> bool:
    """Whether a transition leaves a mode that, from nearby too, is entered on surface k of its target, and keeps it."""
    before, edge = run.before(made)
    arc = next(arc for arc in reversed(run.flows) if arc.jump <= made.index)
    if not arc.jump or run.crossed.get(arc.last) != edge:
        return False
    for x in before.moved_by(tuple(map(abs, before.x))):  # the flow keeps it there, and around it too
        there = _in_target(run, made, made.time, x)
        if there is None:
            return False
        flow = dict(zip(before.mode.states, before.kernel.flow(made.time, *x), strict=True))
        gradient = there.kernel.gradients[k](made.time, *there.x)
        terms = [gradient[0], *(g * flow[name] for g, name in zip(gradient[1:], there.mode.states, strict=True))]
        if abs(sum(terms)) > ALONG * ALONG * max(abs(term) for term in terms):
            return False
    earlier = run.transitions[arc.jump - 1]
    entered, by = run.before(earlier)
    for x in entered.along_guard(by, run.error_before(earlier)):
        there = _in_target(run, made, earlier.time, run.after([earlier], x).x)
        if there is None or abs(there.value(k)) > there.roundoff_bound(k):
            return False
    return True


def _onto(run: RunView, made: Transition, k: int, x: State) -> State:
    """A state of the mode that a transition leaves, taken to surface k of its target and, along that, to its guard."""
    before, edge = run.before(made)
    for _ in range(GUARD_ROUNDS):
        there = _in_target(run, made, made.time, x)
        assert there is not None
        named = dict(zip(there.mode.states, there.kernel.gradients[k](made.time, *there.x)[1:], strict=True))
        one = [named.get(name, 0) for name in before.mode.states]
        x = moved_onto(x, one, there.value(k))
        other = before.kernel.gradients[edge](made.time, *x)[1:]
        along = moved_onto(other, one, sum(a * b for a, b in zip(other, one, strict=True)))
        x = moved_onto(x, along, before.kernel.surfaces(made.time, *x)[edge])
    return x


def _in_target(run: RunView, made: Transition, t: Number, x: State) -> Place | None:
    """A state of the mode that a transition leaves, as one of its target, by name; None where that has others."""
    named = dict(zip(run.problem.program.modes[run.index(made.source)].states, x, strict=True))
    names = run.problem.program.modes[run.index(made.target)].states
    return run.place(made.target, t, tuple(named[name] for name in names)) if named.keys() >= set(names) else None
