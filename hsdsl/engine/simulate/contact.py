"""Motion along guards that hold a state (M11).

A guard *holds* the state where its own resets keep the state while the flow leads out: at such a point q the reset is
the identity, the target is the same mode, and the flow leaves the domain. The guard is then an active constraint, as a
closed contact in mechanics. The *push* on a guard is how fast the flow that the other constraints leave leads into it
(of a body on a floor the acceleration by which the floor must hold it, or the velocity): the contact ends where the
push changes sign. Until then the execution follows the constrained flow (`completion.constrained`), and is at rest if
that is zero. Other surfaces are crossed as along any flow. A guard that holds the state is
*touched* in `Surfaces`; ``held`` is the place of a run in contact, ``here`` the same in the mode itself.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import replace
from functools import partial, reduce

from hsdsl.base.numbers.arithmetic import DOMAIN_ERRORS, NOTHING, Number
from hsdsl.engine.execution import Stop
from hsdsl.engine.integrators.stepper import State, rows_of
from hsdsl.engine.simulate.run import ModeState, Run
from hsdsl.engine.simulate.surfaces import Surfaces, joined, total
from hsdsl.mathematics.program import HELD, LOOKED_AT

SAME_UNITS = 4  # of round-off, relative to its scale: how far a reset may move a state that it keeps
ZERO_UNITS = 16  # of round-off: a rate that counts as zero
FURTHER = 16  # times as far ahead: where a push that is zero is looked at next
MOST_CORRECTIONS_TO_GUARD = 4  # of a point towards a guard
MOST_ROUNDS = 60  # of acceleration towards a fixed point
MOST_LEAP = 4096  # times a step: rounds may take back as little as a four-thousandth


def contact_at(run: Run, here: ModeState) -> ModeState | Stop:
    """Return the place as one in contact with the guards that hold the state; a stop where these have no one motion."""
    if not here.surfaces.active or here.mode.held is None or here.mode.states != here.arc.states:
        return here
    kept = keeping(run, here, sorted(here.surfaces.active))
    holding = pressing(run, here, kept) if kept else []
    if holding is None or (len(holding) > 1 and not flows(here, in_contact(run, here, holding))):
        return run.diagnostics.coupled(here.mode.edges[kept[0]].name, here.t)
    return in_contact(run, here, holding) if holding else here


def flow_sizes(run: Run, here: ModeState, slope: State) -> list[Number]:
    """For each state the size that its flow has had, |f| + sum |df/dx_j| s_j: below round-off of it, it is at rest."""
    mode, scales = here.flow, here.sizes
    found: list[Number] = []
    rows = rows_of(run.kernel.jacobian(mode, here.segment.data)(here.t, *here.x), len(here.x))
    for f, row in zip(slope, rows, strict=True):
        total = abs(f)
        for d, s in zip(row, scales, strict=True):
            total = total + abs(d) * s
        found.append(total)
    return found


def start_sizes(run: Run, mode: int, x: State) -> State:
    """The sizes that the flow gives the states within the run, from a start at x in a mode with motion along guards.

    A start on a guard is off it by the round-off of these. Elsewhere they are zero.
    """
    program, segment, zero = run.program.modes[mode], run.timeline.at(run.arithmetic.zero), run.arithmetic.zero
    nothing = tuple(zero for _ in x)
    if program.held is None:
        return nothing
    try:
        slope = run.kernel.bind(mode, segment.data).flow(zero, *x)
        rows = rows_of(run.kernel.jacobian(mode, segment.data)(zero, *x), len(x))
    except DOMAIN_ERRORS:
        return nothing
    back = zero
    for i, row in enumerate(rows):
        back = max(back, total((abs(d) * abs(rows[k][i]) for k, d in enumerate(row)), zero))
    time = run.settings.until / (1 + run.settings.until * run.arithmetic.sqrt(back))  # in which motion turns back
    first = tuple(max(abs(a), time * abs(f)) for a, f in zip(x, slope, strict=True))
    moved = (time * total((abs(d) * s for d, s in zip(row, first, strict=True)), zero) for row in rows)
    found = tuple(map(max, first, moved))
    return found if all(map(run.arithmetic.isfinite, found)) else nothing


def flows(here: ModeState, held: ModeState) -> bool:
    """Whether guards that hold the state together have a flow."""
    try:
        return not any(f != f for f in held.kernel.flow(here.t, *here.x))
    except DOMAIN_ERRORS:
        return True


def keeping(run: Run, here: ModeState, surfaces: Iterable[int]) -> list[int]:
    """The edges of some surfaces whose guards hold the state where the flow presses on them: resets keep it there."""
    edges, sizes, found = here.mode.edges, list[Number](), list[int]()
    for k in surfaces if run.settings.completion != "none" else ():
        if not k < len(edges) or edges[k].contact is None:
            continue
        try:
            if not keeps(run, here, k):
                continue
            if edges[k].push_order == 2:
                sizes = sizes or flow_sizes(run, here, here.kernel.flow(here.t, *here.x))
                gradient = here.kernel.gradients[k](here.t, *here.x)
                size = total((abs(g) * f for g, f in zip(gradient[1:], sizes, strict=True)), abs(gradient[0]))
                if not abs(here.kernel.rates[k](here.t, *here.x)[0]) <= ZERO_UNITS * run.arithmetic.unit * size:
                    continue  # the flow is not tangent to the surface, to round-off
        except DOMAIN_ERRORS:
            continue
        found.append(k)
    return found


def pressing(run: Run, here: ModeState, kept: list[int]) -> list[int] | None:
    """Those of some guards that hold the state together; None where that is not one choice.

    The flow that the others leave presses on each that holds while its `if` does, and on none of those that do not.
    """
    holding: list[int] | None = kept
    for _ in range(len(kept) + 2):
        before, holding = holding, pushes(run, here, holding, kept)
        if holding is None or holding == before or len(kept) == 1:
            return holding
    return None


def pushes(run: Run, here: ModeState, holding: list[int], kept: list[int]) -> list[int] | None:
    """Those of some guards that the flow presses on while those ``holding`` hold it; None without such a flow."""
    looked, asked = in_contact(run, here, holding, kept), in_contact(run, here, (), kept)
    t, x = here.t, here.x
    try:
        r = looked.kernel.surfaces(t, *x)
        if any(r[k] != r[k] for k in kept):
            return None
        noise = {k: looked.surfaces.roundoff_bound(k, t, x) for k in kept}
        pushed = [k for k in kept if r[k] < -noise[k] or (r[k] <= noise[k] and not lifts_next(run, looked, k))]
    except DOMAIN_ERRORS:
        return []
    return [k for k in pushed if holds(asked, k, t, x) or is_possible(run, here, k, t, x, holding)]


def holds(here: ModeState, k: int, t: Number, x: State) -> bool:
    """Whether the `if` of edge k holds; not where it has no value."""
    try:
        return bool(here.kernel.conditions[k](t, *x)[0])
    except DOMAIN_ERRORS:
        return False


def lifts_next(run: Run, looked: ModeState, k: int) -> bool:
    """Whether the push on a guard, zero now, is first negative where the flow makes it differ from zero."""
    t, x, after = looked.t, looked.x, run.arithmetic.unit * run.settings.until
    try:
        while looked.t + after < looked.segment.end:
            slope, time = looked.kernel.flow(t, *x), looked.t + after
            t, x = time, tuple(a + (time - t) * f for a, f in zip(x, slope, strict=True))
            r = looked.kernel.surfaces(t, *x)[k]
            if abs(r) > looked.surfaces.roundoff_bound(k, t, x):
                return r > 0
            after = after * FURTHER
    except DOMAIN_ERRORS:
        pass
    return False


def reset_but_counts(run: Run, here: ModeState, k: int, t: Number, x: State) -> State:
    """What the reset of edge k, its branch for slow impacts, makes of a state, but for states that it counts with."""
    kernel, counts = here.kernel, here.mode.edges[k].counts
    if here.mode.edges[k].branched:
        kernel = in_contact(run, here, ()).kernel
    after = kernel.resets[k](t, *x)
    return tuple(x[i] if i in counts else a for i, a in enumerate(after)) if counts else after


def keeps(run: Run, here: ModeState, k: int) -> bool:
    """Whether the reset of edge k leaves the state where it is."""
    noise = (SAME_UNITS * run.arithmetic.unit * s for s in here.sizes)
    after = reset_but_counts(run, here, k, here.t, here.x)
    return all(abs(a - b) <= most for a, b, most in zip(after, here.x, noise, strict=True))


def is_possible(run: Run, here: ModeState, k: int, t: Number, x: State, touched: Collection[int]) -> bool:
    """Whether the `if` of edge k holds at a point, or next along the flow that the guards of other edges leave.

    So `v < 0` holds for a body at rest on the floor: what it is pressed to, it does.
    """
    holds = here.kernel.conditions[k]
    try:
        if holds(t, *x)[0] or not here.mode.edges[k].conditional:
            return bool(holds(t, *x)[0])
        return bool(holds(t, *pressed(run, here, k, t, x, touched))[0])
    except DOMAIN_ERRORS:
        return False


def holds_next(run: Run, here: ModeState, k: int, t: Number, x: State) -> bool:
    """Whether the `if` of an edge that leads back, of a surface that the state is on, holds next along the flow."""
    edge = here.mode.edges[k]
    returns = edge.target == here.index and edge.target_states == here.mode.states == here.arc.states
    return returns and is_possible(run, here, k, t, x, ())


def pressed(run: Run, here: ModeState, k: int, t: Number, x: State, touched: Collection[int]) -> State:
    """Where the flow presses a state, by what its guard would take away of the flow that others' guards leave.

    It is off by round-off where the reset changes it.
    """
    edge, others, after = here.mode.edges[k], sorted({*touched} - {k}), run.arithmetic.zero
    slope = (in_contact(run, here, others) if others else here).kernel.flow(t, *x)
    if edge.contact is not None:
        left = in_contact(run, here, sorted({*others, k})).kernel.flow(t, *x)
        slope = tuple(f - g for f, g in zip(slope, left, strict=True))
    sizes = here.sizes
    for i in edge.changes:
        if slope[i] != 0:
            after = max(after, ZERO_UNITS * run.arithmetic.unit * sizes[i] / abs(slope[i]))
    after = after or run.arithmetic.unit * run.settings.until  # where these states have been zero only
    return tuple(a + after * f for a, f in zip(x, slope, strict=True))


def in_contact(run: Run, here: ModeState, holding: Sequence[int], looked_at: Sequence[int] = ()) -> ModeState:
    """The place with the routines of contacts of some edges of its mode; the arc goes on."""
    number, edges = here.mode.held, here.mode.edges
    assert number is not None
    levels = dict.fromkeys(looked_at, LOOKED_AT) | dict.fromkeys(holding, HELD)
    numbers = [run.arithmetic.zero] * sum(edge.contact is not None for edge in edges)
    places = {k: place for k in levels if (place := edges[k].contact) is not None}
    for k, place in places.items():
        numbers[place] = run.arithmetic.zero + levels[k]
    segment = replace(here.segment, data=(*here.segment.data, *numbers))
    program, kernel = run.program.flows[number], run.kernel.bind(number, segment.data)
    more = len(program.edges) - len(edges)
    active = {j if j < len(edges) else j + more for j in here.surfaces.active if j not in levels}
    touched, pushes = frozenset(places[k] for k in holding), frozenset(places.values())
    scale, had = here.surfaces.scale, here.arc.scales
    end = run.settings.until
    surfaces = Surfaces(kernel, program.edges, scale, run.arithmetic, active, set(), touched, pushes, had, end)
    return replace(here, flow=number, mode=program, kernel=kernel, surfaces=surfaces, segment=segment)


def after_contact(here: ModeState, held: ModeState, t: Number, x: State) -> ModeState:
    """The place in the mode itself again, on the guards that it was in contact with."""
    edges, more = len(here.mode.edges), len(held.mode.edges) - len(here.mode.edges)
    here.surfaces.active.clear()
    here.surfaces.emerging.clear()
    kept = (j for j in held.surfaces.active if not held.surfaces.releases(j))
    here.surfaces.active.update(j if j < edges else j - more for j in kept)
    here.surfaces.active.update(in_touch(here, held))
    return here.moved(t, x)


def in_touch(here: ModeState, held: ModeState) -> list[int]:
    """The edges of a mode that a place is in contact with."""
    return [k for k, edge in enumerate(here.mode.edges) if edge.contact in held.surfaces.touched]


def past_end(run: Run, here: ModeState, held: ModeState, k: int, t: Number, x: State) -> tuple[Number, State, bool]:
    """A point after the end of a part of an `if` in contact, and whether an `if` does not hold there.

    Surface k of the contact rises through zero at t; it is above round-off at the point, if all hold there.
    """
    touched, after = in_touch(here, held), run.arithmetic.unit * run.settings.until
    own = next(j for j in touched if here.mode.edges[j].contact == held.mode.edges[k].releases)
    later, most = x, run.arithmetic.sqrt(run.arithmetic.unit) * run.settings.until  # further on a line is no motion
    try:
        slope = held.kernel.flow(t, *x)
        while True:
            time = min(t + after, here.segment.end)
            later = tuple(a + (time - t) * f for a, f in zip(x, slope, strict=True))
            if not all(is_possible(run, here, j, time, later, touched) for j in touched):
                return time, later, True
            r = held.kernel.surfaces(time, *pressed(run, here, own, time, later, touched))[k]
            if r > held.surfaces.roundoff_bound(k, time, later) or not (after < most and time < here.segment.end):
                return time, later, False
            after = after * 2
    except DOMAIN_ERRORS:
        return t, x, True


def held_exactly(
    run: Run, here: ModeState, held: ModeState, t: Number, x: State, reached: Sequence[int] = ()
) -> ModeState:
    """The mode itself again, the state without what steps along its guards were off by: they may hold it again.

    It stays on those that it has ``reached``. It is off them by the round-off of what it has ever been computed from.
    """
    touched, after = in_touch(here, held), after_contact(here, held, t, x)
    scale = tuple(map(joined, after.surfaces.scale, here.arc.scales))
    after = replace(after, surfaces=replace(after.surfaces, scale=scale))
    try:
        q = in_turn(partial(onto_guard, after), sorted({*touched, *reached}), t, x)
        q = in_turn(partial(fixed_point, run, after), touched, t, q)
        return after.moved(t, q) if all(keeps(run, after.moved(t, q), k) for k in touched) else after
    except DOMAIN_ERRORS:
        return after


def in_turn(taken: Callable[[int, Number, State], State], edges: list[int], t: Number, x: State) -> State:
    """The point that a state runs to which several edges, in turn, take to what one of them keeps."""
    if len(edges) == 1:
        return taken(edges[0], t, x)
    return limit(lambda x: reduce(lambda q, k: taken(k, t, q), edges, x), x)


def onto_guard(here: ModeState, k: int, t: Number, x: State) -> State:
    """A point near a guard taken to it, as near as numbers are, each state in proportion to its scale."""
    r = here.kernel.surfaces(t, *x)[k]
    for _ in range(MOST_CORRECTIONS_TO_GUARD):
        gradient = here.kernel.gradients[k](t, *x)[1:]
        weights = [g * s * s for g, s in zip(gradient, here.sizes, strict=True)]
        across = total((g * w for g, w in zip(gradient, weights, strict=True)), r * 0)
        if not across > 0:
            break
        nearer = tuple(a - r / across * w for a, w in zip(x, weights, strict=True))
        left = here.kernel.surfaces(t, *nearer)[k]
        if not abs(left) < abs(r):
            break
        x, r = nearer, left
    return x


def fixed_point(run: Run, here: ModeState, k: int, t: Number, x: State) -> State:
    """The point that repeated resets run to."""
    return limit(lambda x: reset_but_counts(run, here, k, t, x), x)


def limit(step: Callable[[State], State], x: State) -> State:
    """The point that repeated steps run to: by Aitken's acceleration of each state, if the step after it is shorter."""
    for _ in range(MOST_ROUNDS):
        one = step(x)
        if one == x:
            break
        two = step(one)
        leap = tuple(map(_accelerated, x, one, two))
        after = step(leap)
        x = after if all(map(_shorter, leap, after, one, two)) else two
        x = tuple(a if abs(a) > NOTHING else a - a for a in x)
    return x


def _accelerated(a: Number, b: Number, c: Number) -> Number:
    bend = c - 2 * b + a
    slow = bend != 0 and abs(c - b) <= abs(b - a) and abs(c - b) <= MOST_LEAP * abs(bend)
    return a - (b - a) / bend * (b - a) if slow else c


def _shorter(a: Number, b: Number, c: Number, d: Number) -> bool:
    return abs(b - a) <= abs(d - c)
