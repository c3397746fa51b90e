"""Where no derivative exists: ties, landings on guards, and guards that are touched.

*Ties.* Where several guards are reached together, a nearby execution reaches one of them first; which one depends on
the way in which it differs. Each of them is taken first in turn, then what fires at that instant. Where all orders lead
to the same point with the same derivatives, these are those of the execution. Otherwise each order has its own, for the
executions on its side (S. A. Burden, S. S. Sastry, D. E. Koditschek, S. Revzen, Event-selected vector field
discontinuities yield piecewise-differentiable flows, SIAM Journal on Applied Dynamical Systems 15, 2016).

*Landings.* A start or a transition leads onto a guard, which is moved by its derivative through states, time and
parameters. Where that is not zero, the executions on one side begin beyond the guard.

*Touched guards.* A run turns back at a guard within its error: executions from nearby cross it or do not.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from hsdsl.analysis.sensitivity.targets import derivative_name, own, shift_name
from hsdsl.base.numbers.arithmetic import DOMAIN_ERRORS, Number
from hsdsl.base.numbers.roundoff import ROUNDOFF_UNITS
from hsdsl.engine.execution import Transition
from hsdsl.engine.kernel import ModeKernel
from hsdsl.engine.simulate.input_segments import make_timeline
from hsdsl.engine.simulate.stops import show
from hsdsl.engine.simulate.verdict.commutation import land_after
from hsdsl.engine.simulate.verdict.misses import rising_zero
from hsdsl.engine.simulate.verdict.run_view import Place, RunView

POINTS, AROUND = 4, 2.0**-12  # where guards are compared: so many points, this share of sizes away
Slopes = dict[str, Number]


class Order(NamedTuple):
    """One order of tied transitions: the edge that goes first, the mode and state that it leads to, and its slopes.

    ``slopes`` are the derivatives of these states at a fixed time, right after the instant.
    """

    first: str
    mode: str
    state: dict[str, Number]
    slopes: dict[str, Slopes]


@dataclass(frozen=True)
class Tie:
    """An instant with several orders. ``reason`` says why no derivative exists there; it is None if all orders
    agree.
    """

    time: Number
    index: int
    orders: tuple[Order, ...]
    reason: str | None


def ties(run: RunView, wrt: Sequence[str], moving: Sequence[bool]) -> Iterator[Tie]:
    """Look at every instant of an augmented run where guards are reached together, or one is landed on.

    ``moving`` says of each parameter of the model whether it moves with any name in ``wrt``.
    """
    last: Transition | None = None
    tied_at: Number | None = None
    for made in run.transitions:
        tie = run.problem.tie(made.time)
        others = () if made.entry else _others(run, made, moving)
        if others:
            place, _ = run.before(made)
            since = 2 * run.problem.tie(made.time)
            orders: list[Order] = []
            for edge in (made.edge, *others):
                try:
                    landed = land_after(run, place, run.edge_at(place, edge), since, run.tails_before(made).copy())
                except DOMAIN_ERRORS:
                    landed = None
                if landed is not None:
                    orders.append(_order(run, edge, *landed, wrt))
            yield Tie(made.time, made.index, tuple(orders), _disagreement(run, made, others, orders))
            tied_at = made.time
        elif tied_at is not None and made.time - tied_at <= tie:
            pass  # a part of what the tie leads to
        elif last is not None and made.time - last.time <= tie and not made.entry and _parts(run, last, made, wrt):
            sentence = f"at t = {show(made.time)} {last.edge} leads onto the guard of {made.edge}"
            yield Tie(made.time, made.index, (), f"{sentence}, and from nearby to points before or beyond it")
        last = made


def _others(run: RunView, made: Transition, moving: Sequence[bool]) -> tuple[str, ...]:
    """The edges tied with a transition but those with the same guard, which are reached with it from everywhere."""
    if not made.alternatives:
        return ()
    place, own = run.before(made)
    tied = [run.edge_at(place, edge) for edge in made.alternatives]
    nearby, least = [*_nearby(run, place, moving, (own, *tied))], run.arithmetic.sqrt(run.arithmetic.unit)

    def same(k: int) -> bool:
        try:
            values = [(surfaces[own], surfaces[k]) for surfaces in (kernel.surfaces(*z) for kernel, z in nearby)]
        except DOMAIN_ERRORS:
            return False
        products = [(a * d, b * c) for (a, b), (c, d) in pairwise(values)]
        return all(abs(a - b) <= least * max(abs(a), abs(b)) for a, b in products)

    return tuple(edge for edge, k in zip(made.alternatives, tied, strict=True) if not same(k))


def _nearby(
    run: RunView, place: Place, moving: Sequence[bool], guards: Sequence[int]
) -> Iterator[tuple[ModeKernel, list[Number]]]:
    """Points all around a place, with the parameters that move: two surfaces in one proportion there are one guard.

    A state that has been round-off so far, as the pitch of a symmetric body, moves the guards by as much as they are.
    """
    roundoff = max(map(place.roundoff_bound, guards))
    gradients = [place.kernel.gradients[k](place.t, *place.x) for k in guards]
    slopes = [max(abs(gradient[i]) for gradient in gradients) for i in range(1 + len(place.x))]
    values = [place.t, *place.x, *run.problem.timeline.at(place.t).data[: len(run.problem.program.parameters)]]
    sizes = [abs(value) or 1.0 for value in values]
    for i, x in enumerate(place.mode.states, 1):
        sizes[i] = max(abs(values[i]), run.sizes.get(x, 0.0)) or 1.0
        if 0 < slopes[i] * sizes[i] <= roundoff:
            sizes[i] = roundoff / (ROUNDOFF_UNITS * run.arithmetic.unit * slopes[i])
    moves = np.ones(len(values))
    moves[1 + len(place.x) :] = 0
    moves[1 + len(place.x) : 1 + len(place.x) + len(moving)] = moving
    for shares in AROUND * np.random.default_rng(0).uniform(-1, 1, (POINTS, len(values))) * moves:
        t, *rest = (v + share * size for v, share, size in zip(values, shares.tolist(), sizes, strict=True))
        x, parameters = rest[: len(place.x)], rest[len(place.x) :]
        yield run.problem.kernel.bind(run.index(place.mode.name), data_at(run, parameters, t)), [t, *x]


def _order(run: RunView, edge: str, mode: str, values: Sequence[Number], wrt: Sequence[str]) -> Order:
    program = run.problem.program.modes[run.index(mode)]
    names = program.states or next(a.states for a in reversed(run.execution.arcs) if len(a.states) == len(values))
    named = dict(zip(names, values, strict=True))
    slopes = {x: {by: named.get(derivative_name(x, by), 0.0) for by in wrt} for x in own(names)}
    return Order(edge, mode, {x: named[x] for x in slopes}, slopes)


def _disagreement(run: RunView, made: Transition, others: Sequence[str], orders: Sequence[Order]) -> str | None:
    tied = " and ".join((made.edge, *others))
    together = f"at t = {show(made.time)} {tied} are reached together"
    if len(orders) <= len(others):
        return f"{together}, and not every order of them has an end"
    first = orders[0]
    if any(other.mode != first.mode for other in orders):
        return f"{together}, and lead to different modes, by their order"
    if not all(_same(run, other.state, first.state) for other in orders):
        return f"{together}, and lead to different states, by their order"
    for by in first.slopes[next(iter(first.slopes))] if first.slopes else ():
        columns = [{derivative_name(x, by): row[by] for x, row in order.slopes.items()} for order in orders]
        if not all(_same(run, column, columns[0]) for column in columns):
            return f"{together}, and the derivatives by {by} depend on their order"
    return None


def _same(run: RunView, one: dict[str, Number], other: dict[str, Number]) -> bool:
    """Whether numbers agree to half of their digits, relative to the largest that each has in the run."""
    least = run.arithmetic.sqrt(run.arithmetic.unit)
    return all(
        abs(a - b) <= least * max(abs(a), abs(b), run.sizes.get(x, 0.0))
        for (x, a), b in zip(one.items(), other.values(), strict=True)
    )


def _parts(run: RunView, last: Transition, made: Transition, wrt: Sequence[str]) -> bool:
    """Whether a guard that is landed on is not landed on from nearby: then both transitions move differently."""
    before, after = last.after or {}, made.after or {}
    least = run.arithmetic.sqrt(run.arithmetic.unit)
    for name in map(shift_name, wrt):
        a, b = before.get(name, 0), after.get(name, 0)
        if abs(a - b) > least * max(abs(a), abs(b), run.sizes.get(name, 0.0)):
            return True
    return False


Row = Mapping[str, Any]  # a derivative by each target


def landing(run: RunView, made: Transition) -> Place:
    """Where a transition leads, of a run that may have further states than its modes."""
    state = made.after or made.before
    mode = run.problem.program.modes[run.index(made.target)]
    return run.place(made.target, made.time, tuple(state[x] for x in mode.states))


def parted(
    run: RunView,
    place: Place,
    time: Row,
    state: Mapping[str, Row],
    parameters: Mapping[str, Sequence[Number]],
    sizes: Mapping[str, Row] | None = None,
    crossing: bool = False,
) -> Iterator[str]:
    """The surfaces that part executions near a place where a run begins or goes on, and what moves them there.

    ``time`` and ``state`` are the derivatives of the place's time and states, ``parameters`` those of all parameters by
    each target, ``sizes`` the largest that those of the states have been. With ``crossing`` a surface that is crossed
    at once counts too.
    """
    for k in place.mode.surfaces:
        try:
            if _begins_on(place, k, crossing):
                for by, slopes in parameters.items():
                    had = [sizes[x][by] if sizes else 0.0 for x in place.mode.states]
                    if not _moves(run, place, k, time[by], [state[x][by] for x in place.mode.states], had, slopes):
                        continue
                    yield f"the surface of {place.name(k)}, and from nearby, moved by {by}, beyond it or not"
                    return
        except DOMAIN_ERRORS:
            continue


def _begins_on(place: Place, k: int, crossing: bool) -> bool:
    """Whether a state is on a surface, one that it does not cross at once unless ``crossing``."""
    if abs(place.value(k)) > place.roundoff_bound(k):
        return False
    if not crossing and place.rate(k) > place.rate_roundoff(k):
        return False
    return k >= len(place.mode.edges) or bool(place.kernel.conditions[k](place.t, *place.x)[0])


def _moves(
    run: RunView,
    place: Place,
    k: int,
    time: Number,
    state: Sequence[Number],
    had: Sequence[Number],
    slopes: Sequence[Number],
) -> bool:
    """Whether a surface has a derivative by a target that is not round-off, of differences or of the derivatives."""
    columns: list[Number] = [time, *state]
    values: list[Number] = [place.t, *place.x, *run.problem.timeline.at(place.t).data[: len(slopes)]]
    largest: Number = max(abs(v) for v in (*columns, *slopes))
    if not largest > 0:
        return False
    step = run.arithmetic.sqrt(run.arithmetic.unit) * (max(abs(v) for v in values) or largest) / largest
    ends: list[Number] = []
    for way in (step, -step):
        moved = [a + way * s for a, s in zip(values, (*columns, *slopes), strict=True)]
        t, x, data = moved[0], moved[1 : len(columns)], data_at(run, moved[len(columns) :], moved[0])
        ends.append(run.problem.kernel.bind(run.index(place.mode.name), data).surfaces(t, *x)[k])
    slope = (ends[0] - ends[1]) / (2 * step)
    gradient, flow = place.kernel.gradients[k](place.t, *place.x), (0, *place.kernel.flow(place.t, *place.x))
    terms = [abs(g) * (abs(s) + abs(f * time)) for g, s, f in zip(gradient, columns, flow, strict=True)]
    through = abs(slope - sum(g * s for g, s in zip(gradient, columns, strict=True)))
    noise = [
        ROUNDOFF_UNITS * run.arithmetic.unit * size + f * abs(time)
        for size, f in zip(had, place.flow_roundoff(), strict=True)
    ]
    least = run.arithmetic.sqrt(run.arithmetic.sqrt(run.arithmetic.unit)) * max(*terms, through)
    least = max(least, sum(abs(g) * n for g, n in zip(gradient[1:], noise, strict=True)))
    return abs(slope) > least and abs(slope) * step > place.roundoff_bound(k)


def data_at(run: RunView, parameters: Sequence[Number], t: Number) -> Sequence[Number]:
    """Other parameters at a time, with the inputs that follow from them."""
    program, timeline = run.problem.program, run.problem.timeline
    if any(given.times is None for given in program.inputs):
        timeline = make_timeline(program, run.problem.kernel, parameters, run.problem.settings.until)
    return (*parameters, *timeline.at(t).data[len(parameters) :])


def touched(run: RunView) -> Iterator[tuple[Number, str]]:
    """The times and reasons, in order; nothing where the run has no estimate of its error."""
    if run.errors is None:
        return
    for arc in run.flows:
        count = len(run.problem.program.modes[run.index(arc.mode)].edges)
        try:
            rates = [[run.at_row(arc, row).rate(k) for k in range(count)] for row in range(arc.first, arc.last + 1)]
        except DOMAIN_ERRORS:
            continue
        for i, (before, after) in enumerate(pairwise(rates)):
            for k in range(count):
                if before[k] > 0 >= after[k]:
                    yield from _turning(run, run.dense_output(arc, arc.first + i), arc.first + i + 1, k)


def _turning(run: RunView, along: Callable[[Number], Place], row: int, k: int) -> Iterator[tuple[Number, str]]:
    """Look at a surface where it turns back on a step."""
    try:
        place = rising_zero(along, lambda place: -place.rate(k))
        shift, below = run.surface_error(place, k, row), -place.value(k)
        if place.has_condition(k) and place.conditions(
            k, run.error(place, row), run.safe_time_error(place, k, row)
        ) == {False}:
            return
    except DOMAIN_ERRORS:
        return
    if abs(below) <= shift:
        where = f"at t = {show(place.t)} the run turns back at the guard of {place.name(k)}"
        yield place.t, f"{where}, within its error: executions from nearby cross it or do not"
