"""Entering a mode: at the start, after a reset, at a jump of an input.

A state that enters beyond a surface without an `if` is outside the domain: that transition fires at once, without a
strip, and so may the next; the walls are looked at when no such transition is left.
"""

from __future__ import annotations

from hsdsl.arithmetic import DOMAIN_ERRORS, Number
from hsdsl.execution import Stop
from hsdsl.integrators.stepper import State
from hsdsl.simulate.diagnosis import not_finite
from hsdsl.simulate.run import Here, Run, choose, reset, show
from hsdsl.simulate.surfaces import Crossing


def enter(
    run: Run,
    mode: int,
    states: tuple[str, ...],
    t: Number,
    x: State,
    scale: State,
    before: Here | None = None,
) -> Here | Stop:
    """Enter a mode and make the transitions that fire at once; return where the run then stands, or why it stops."""
    visited: set[tuple[int, State]] = set()
    while True:
        here = run.place(mode, states, t, x, scale, before)
        if here.mode.final:
            return Stop("final", t, f"entered final mode {here.mode.name} at t = {show(t)}")
        if (mode, x) in visited:
            return Stop(
                "zeno", t, f"at t = {show(t)} transitions return to the same state in mode {here.mode.name} without end"
            )
        visited.add((mode, x))
        try:
            values, noise = here.kernel.surfaces(t, *x), here.surfaces.noise(t, x)
            finite = all(map(run.arithmetic.isfinite, values))
        except DOMAIN_ERRORS:
            return not_finite(run, here, t, (x,))
        if not finite:
            return not_finite(run, here, t, (x,))
        edges = here.mode.edges
        beyond = [k for k, edge in enumerate(edges) if not edge.conditional and values[k] > noise[k]]
        if not beyond:
            walls = [k for k in range(len(edges), len(values)) if values[k] > noise[k]]
            return left_domain(here, walls[0], t, "was entered outside it") if walls else here
        if stop := run.limit_reached(t):
            return stop
        zero = run.arithmetic.zero
        chosen, alternatives = choose(edges, [Crossing(k, zero, t, x, zero) for k in beyond], zero)
        outcome = reset(here, chosen, tuple(max(abs(a), s) for a, s in zip(x, scale, strict=True)), run)
        if isinstance(outcome, Stop):
            return outcome
        run.record(here, chosen, t, outcome[0], alternatives, entry=True)
        edge = edges[chosen.edge]
        before, mode, states, (x, scale) = here, edge.target, edge.target_states, outcome


def left_domain(here: Here, surface: int, t: Number, how: str) -> Stop:
    """Stop at a wall (the paper's n' = infinity)."""
    wall = here.mode.walls[surface - len(here.mode.edges)]
    return Stop(
        "left_domain", t, f"the domain of mode {here.mode.name} ends at {wall}: at t = {show(t)} the state {how}"
    )
