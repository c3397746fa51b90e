"""One transition: which crossing goes, its reset, the executions that wait, the mode that is entered, and cascades.

The *spread* of a reset is the sum of the sizes of the terms that each state after it is computed from: its
round-off is relative to that.

A mode is entered at the start, after a reset, at a jump of an input. A state that enters beyond a surface without an
`if` is outside the domain: that transition fires at once, without a strip, and so may the next; the walls are looked at
when no such transition is left. A *cascade* is transitions that follow each other without any flow between them: where
it returns to a state, it would go on without end.

Executions of events that wait after the first of their event are no states, so that any number can wait. A mode's
states have of each queue how many wait and the first that is made; a *tail* of a queue has the others, in the order in
which they are made. What a reset does to these states says what happens to the tail: one more waits, which goes where
its time says, the first was made, or all were dropped.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from hsdsl.base.numbers.arithmetic import DOMAIN_ERRORS, Number
from hsdsl.engine.execution import Stop
from hsdsl.engine.integrators.stepper import State
from hsdsl.engine.scheme.pace import returns
from hsdsl.engine.simulate.moving import moved_reset
from hsdsl.engine.simulate.stops import ENTERED, endless, entered_final, left_domain, reset_not_finite, too_many_wait
from hsdsl.engine.simulate.surfaces import ANY, Arrival, Crossing, joined
from hsdsl.mathematics.program import EdgeProgram, ModeProgram

if TYPE_CHECKING:
    from hsdsl.engine.simulate.run import ModeState, Run


@dataclass(frozen=True)
class Event:
    """A step that ended in a strip at t1: where it left the domain, and the sizes of the numbers there.

    The guards of edges ``held`` held the state until then.
    """

    crossing: Crossing
    alternatives: tuple[str, ...]
    t1: Number
    scale: State
    held: tuple[int, ...] = ()


def choose(here: ModeState, crossings: Sequence[Crossing], run: Run) -> tuple[Crossing, tuple[str, ...]]:
    """Choose which of several crossings goes: the earliest; of tied ones the highest priority, then the file's order.

    Tied are also guards that the earliest crossing's point is on. The chosen edge goes from that point. Returns the
    crossing and the names of those tied with it.
    """
    edges, first = here.mode.edges, min(crossings, key=lambda c: c.time)
    since = run.tie(first.time)
    tied = {c.edge: c for c in crossings if c.time - first.time <= since}
    tied |= dict.fromkeys(here.surfaces.standing(first.time, first.state, since, known=tied), first)
    edge = min(tied, key=lambda k: (-edges[k].priority, k))
    chosen = replace(first, edge=edge, depth=tied[edge].depth)
    return chosen, tuple(edges[k].name for k in sorted(tied) if k != edge)


def reset(here: ModeState, crossing: Crossing, scale: State, run: Run) -> tuple[State, State] | Stop:
    """Apply a reset to the values before the jump; also the sizes of the numbers the new state came from."""
    k, t, q = crossing.edge, crossing.time, crossing.state
    edge, isfinite = here.mode.edges[k], run.arithmetic.isfinite
    try:
        after = here.kernel.resets[k](t, *q)
    except DOMAIN_ERRORS:
        after = (run.arithmetic.functions["nan"],)
    if not all(map(isfinite, after)):
        return reset_not_finite(edge, t)
    if run.settings.moves:
        after = moved_reset(run.kernel, here.index, k, here.segment.data, t, q) or after
    try:
        spread = here.kernel.spreads[k](t, *q, *scale)
    except DOMAIN_ERRORS:
        spread = ()
    known = bool(spread) and all(map(isfinite, spread))
    return after, tuple(spread if known else map(abs, after))  # where a reset is infinitely steep, no more is known


def enter(
    run: Run,
    mode: int,
    states: tuple[str, ...],
    t: Number,
    x: State,
    scale: State,
    before: ModeState | None = None,
    arrival: Arrival = ANY,
) -> ModeState | Stop:
    """Enter a mode and make the transitions that fire at once; return the mode entered last, or why the run stops.

    Of ``arrival`` the time ``since`` holds for all of them, the rest for the mode entered first.
    """
    visited: set[tuple[int, State]] = set()
    while True:
        here = run.place(mode, states, t, x, scale, before)
        if run.tails.full is not None:
            return too_many_wait(here.mode, run.tails.full, t)
        if here.mode.final:
            return entered_final(here.mode.name, t)
        decides = mode, decisive(here.mode, x)
        if decides in visited:
            return endless(here.mode.name, t)
        visited.add(decides)
        try:
            values = here.kernel.surfaces(t, *x)
            finite = all(map(run.arithmetic.isfinite, values))
            outside = here.surfaces.enter(t, x, values, arrival)
        except DOMAIN_ERRORS:
            return run.standstill(here).not_finite([(t, x)])
        if not finite:
            return run.standstill(here).not_finite([(t, x)])
        edges = here.mode.edges
        beyond = [k for k in outside if k < len(edges) and not edges[k].conditional]
        if not beyond:
            walls = [k for k in outside if k >= len(edges)]
            return left_domain(here.mode, walls[0], t, ENTERED) if walls else here
        if stop := run.limit_reached(t):
            return stop
        zero = run.arithmetic.zero
        chosen, alternatives = choose_entry(edges, [Crossing(k, zero, t, x, zero) for k in beyond])
        outcome = reset(here, chosen, scale, run)
        if isinstance(outcome, Stop):
            return outcome
        edge, scale = edges[chosen.edge], outcome[1]
        x = run.record(here, chosen, t, outcome[0], alternatives, entry=True)
        before, mode, states = here, edge.target, edge.target_states
        arrival = Arrival(arrival.since)


def choose_entry(edges: tuple[EdgeProgram, ...], beyond: list[Crossing]) -> tuple[Crossing, tuple[str, ...]]:
    """Choose among surfaces that the state is beyond: the highest priority, then the file's order."""
    chosen = min(beyond, key=lambda c: (-edges[c.edge].priority, c.edge))
    return chosen, tuple(edges[c.edge].name for c in beyond if c is not chosen)


def comes_back(run: Run, flowed: bool, here: ModeState) -> bool:
    """Count a transition that led to ``here``; whether one of the same cascade has led there before."""
    x = decisive(here.mode, here.x)
    return returns(run.cascade, flowed, here.index, x, len(x))


def decisive(mode: ModeProgram, x: State) -> State:
    """What of a state decides how a run goes on: a cascade that only counts comes back to it."""
    return tuple(x[i] for i in mode.deciding) if mode.idle else x


def standing_on(run: Run, here: ModeState) -> list[Crossing]:
    """Guards that the state is on, to round-off or a tie."""
    t, x, zero = here.t, here.x, run.arithmetic.zero
    return [Crossing(k, zero, t, x, zero) for k in here.surfaces.standing(t, x, run.tie(t))]


def sizes(x: State, z: State, here: ModeState, stays: bool = False) -> State:
    """Return the sizes of the numbers that a point between x and z is computed from.

    A state that has not moved since the mode was entered still carries the sizes that it came in with. So does one that
    ``stays`` on a guard, which it has not left: it is off that by the round-off of these.
    """
    entered = zip(here.arc.values[0], here.surfaces.scale, strict=True)
    kept = (s if stays or b == first else b * 0 for b, (first, s) in zip(z, entered, strict=True))
    return tuple(joined(s, max(abs(a), abs(b))) for s, a, b in zip(kept, x, z, strict=True))


def go_on(run: Run, here: ModeState) -> ModeState | Stop:
    """Enter the next segment of the inputs: anew where one of them jumps."""
    t, x, mode, surfaces = here.t, here.x, here.index, here.surfaces
    if run.timeline.at(t).jump:
        try:
            inside = surfaces.inside(t, x)
            stood = surfaces.off(t, x, surfaces.active - surfaces.emerging)
        except DOMAIN_ERRORS:
            return run.standstill(here).not_finite([(t, x)])
        return enter(run, mode, here.mode.states, t, x, surfaces.scale, arrival=Arrival(inside=inside, stood=stood))
    after = run.place(mode, here.mode.states, t, x, surfaces.scale, active=surfaces.active)
    after.surfaces.emerging.update(surfaces.emerging)
    return after
