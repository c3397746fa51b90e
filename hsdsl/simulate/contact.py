"""Motion along a guard: a state that its own reset keeps while the flow pushes it out (M11).

At such a point q the reset is the identity, the target is the same mode, and the flow leaves the domain. The execution
follows the constrained flow of the edge's contact (`hsdsl.completion.contact`), at rest where that is zero, until the
flow no longer pushes out. Other surfaces are crossed as along any flow.
"""

from __future__ import annotations

from dataclasses import replace

from hsdsl.arithmetic import DOMAIN_ERRORS, Number
from hsdsl.execution import Stop
from hsdsl.integrators.stepper import State
from hsdsl.program import EdgeProgram
from hsdsl.simulate.root_isolation import total
from hsdsl.simulate.run import ModeState, Run
from hsdsl.simulate.scales import flow_sizes
from hsdsl.simulate.surfaces import Surfaces

SAME_UNITS = 4  # of round-off, relative to its scale: how far a reset may move a state that it keeps
ZERO_UNITS = 16  # of round-off: a rate that counts as zero


def contact_at(run: Run, here: ModeState) -> ModeState | Stop:
    """Return the place as one in contact with every guard that holds the state; a stop where they hold it together."""
    if not here.surfaces.active or here.mode.states != here.arc.states:
        return here
    held, edges = here, here.mode.edges
    for k in sorted(here.surfaces.active):
        if k < len(edges) and presses(run, here, k):
            contact = held.mode.edges[k].contact
            if contact is None:
                return run.diagnostics.accumulates(edges[k].name, here.t, here.t)
            held = in_contact(run, held, k, contact)
    return held


def presses(run: Run, here: ModeState, k: int) -> bool:
    """Whether the flow presses on the guard of edge k, and its reset keeps the state there."""
    contact = here.mode.edges[k].contact
    if contact is None or run.settings.completion == "none":
        return False
    try:
        if not keeps(run, here, k):
            return False
        held = in_contact(run, here, k, contact)
        if not held.kernel.surfaces(here.t, *here.x)[k] < -held.surfaces.roundoff_bound(k, here.t, here.x):
            return False
        return held.mode.push_order == 1 or is_tangent(run, here, k)
    except DOMAIN_ERRORS:
        return False


def keeps(run: Run, here: ModeState, k: int) -> bool:
    """Whether edge k is possible and its reset leaves the state where it is."""
    t, x, kernel = here.t, here.x, here.kernel
    noise = (SAME_UNITS * run.arithmetic.unit * s for s in here.arc.scales)
    after = kernel.resets[k](t, *x)
    still = all(abs(a - b) <= most for a, b, most in zip(after, x, noise, strict=True))
    return still and bool(kernel.conditions[k](t, *x)[0])


def is_tangent(run: Run, here: ModeState, k: int) -> bool:
    """Whether the flow is tangent to surface k, to round-off."""
    t, x = here.t, here.x
    slope, gradient = here.kernel.flow(t, *x), here.kernel.gradients[k](t, *x)
    sizes = flow_sizes(run, here, slope)
    size = total((abs(g) * f for g, f in zip(gradient[1:], sizes, strict=True)), abs(gradient[0]))
    return abs(here.kernel.rates[k](t, *x)[0]) <= ZERO_UNITS * run.arithmetic.unit * size


def in_contact(run: Run, here: ModeState, k: int, contact: int) -> ModeState:
    """The place with the routines of a contact of edge k; the arc goes on."""
    program, kernel = run.program.flows[contact], run.kernel.bind(contact, here.segment.data)
    edges, more = len(here.mode.edges), len(program.edges) - len(here.mode.edges)
    active = {j if j < edges else j + more for j in here.surfaces.active if j != k}
    surfaces = Surfaces(kernel, program.edges, here.surfaces.scale, run.arithmetic, active)
    return replace(here, flow=contact, mode=program, kernel=kernel, surfaces=surfaces)


def after_contact(here: ModeState, held: ModeState, t: Number, x: State) -> ModeState:
    """The place in the mode itself again, on the guards that it was in contact with."""
    edges, more = len(here.mode.edges), len(held.mode.edges) - len(here.mode.edges)
    here.surfaces.active.clear()
    here.surfaces.emerging.clear()
    here.surfaces.active.update({j if j < edges else j - more for j in held.surfaces.active if not releases(held, j)})
    here.surfaces.active.update(in_touch(here, held))
    return here.moved(t, x)


def in_touch(here: ModeState, held: ModeState) -> list[int]:
    """The edges of a mode that a place is in contact with."""
    return [k for k in range(len(here.mode.edges)) if releases(held, k)]


def condition_ends(run: Run, here: ModeState, held: ModeState, t: Number, x: State) -> tuple[Number, State] | None:
    """The first moment from t on, within the tie of times, at which an `if` in contact does not hold; None for none."""
    later: tuple[Number, State] = (t, x)
    after = run.arithmetic.unit * run.settings.until
    try:
        slope = held.kernel.flow(t, *x)
        while after <= run.tie(t):
            later = t + after, tuple(a + after * f for a, f in zip(x, slope, strict=True))
            if not all(here.kernel.conditions[k](later[0], *later[1])[0] for k in in_touch(here, held)):
                return later
            after = after * 2
    except DOMAIN_ERRORS:
        return later
    return None


def releases(held: ModeState, k: int) -> bool:
    """Whether surface k ends a contact."""
    edges: tuple[EdgeProgram, ...] = held.mode.edges
    return k < len(edges) and edges[k].releases
