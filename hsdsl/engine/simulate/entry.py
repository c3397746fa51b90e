"""Entering a mode: at the start, after a reset, at a jump of an input.

A state that enters beyond a surface without an `if` is outside the domain: that transition fires at once, without a
strip, and so may the next; the walls are looked at when no such transition is left.
"""

from __future__ import annotations

from hsdsl.base.numbers.arithmetic import DOMAIN_ERRORS, Number
from hsdsl.engine.execution import Stop
from hsdsl.engine.integrators.stepper import State
from hsdsl.engine.simulate.cascade import decisive
from hsdsl.engine.simulate.run import ModeState, Run, reset
from hsdsl.engine.simulate.standstill import standstill
from hsdsl.engine.simulate.stops import ENTERED, endless, entered_final, left_domain, too_many_wait
from hsdsl.engine.simulate.surfaces import ANY, Arrival, Crossing
from hsdsl.mathematics.program import EdgeProgram


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
            return standstill(run, here).not_finite([(t, x)])
        if not finite:
            return standstill(run, here).not_finite([(t, x)])
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
