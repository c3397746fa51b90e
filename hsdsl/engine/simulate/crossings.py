"""Crossings of a located step: the first of each surface, isolated on the surface's polynomials, settled to round-off.

Where a surface rises is found on its polynomials (`surfaces`). The rise is corrected on the surface itself, by Newton's
method, else in a bracket.

A guard is only *reached* where the flow has no value beyond it, as that of an empty tank: h' = -sqrt(h) with h <= 0
(`reaches`). The execution comes to the surface tangentially, in finite time. A step's polynomial ends there, or turns
back there as the equation does not: at its end the flow still leads towards the surface.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from itertools import chain

from hsdsl.base.numbers.arithmetic import DOMAIN_ERRORS, Number
from hsdsl.base.numbers.roundoff import ROUNDOFF_UNITS
from hsdsl.engine.integrators.stepper import State
from hsdsl.engine.scheme.polynomials import slope_of
from hsdsl.engine.scheme.roots import stays_below
from hsdsl.engine.simulate.contact import holds_next
from hsdsl.engine.simulate.located_steps import Span
from hsdsl.engine.simulate.run import ModeState, Run
from hsdsl.engine.simulate.surfaces import Crossing, Piece, Rise, at, close_bracket, deflated, rises_along, total

MOST_CORRECTIONS = 8
TURNINGS = 60  # halvings of a step


def crossings_along(run: Run, here: ModeState, span: Span) -> list[Crossing]:
    """The first crossing of each surface of a step, in their order.

    Surfaces that rise after the first of all are left out. There they are inside, beyond round-off and by more than
    they rise while crossings are tied. Not those of an implicit method: to a point of its step it iterates from the
    one before.
    """
    found: dict[int, Crossing] = {}
    waiting: dict[int, tuple[Rise, Iterator[Rise]]] = {}

    def keep(crossing: Crossing | None) -> None:
        strict = crossing and crossing.edge < len(here.mode.edges)
        if crossing and not (strict and here.surfaces.too_late(crossing.edge, crossing.time, run.tie(crossing.time))):
            found[crossing.edge] = crossing

    for k in range(len(span.curves)):
        rises = rises_of(run, here, span, k)
        rise = next(rises, None)
        if rise is None:
            keep(reaches(run, here, span, k, pieces_of(here, span, k)))
        elif run.control.implicit:
            keep(first_crossing(run, here, span, k, rise, rises))
        else:
            waiting[k] = rise, rises
    while waiting and not found:
        k = min(waiting, key=lambda k: waiting[k][0][0])
        keep(first_crossing(run, here, span, k, *waiting.pop(k)))
    first = min(found.values(), key=lambda c: c.time, default=None)
    later = {k for k, (rise, _) in waiting.items() if first and rises_after(run, here, first, k, rise)}
    for k in waiting:
        if k not in later:
            keep(first_crossing(run, here, span, k, *waiting[k]))
    return [found[k] for k in sorted(found)]


def rises_after(run: Run, here: ModeState, first: Crossing, k: int, rise: Rise) -> bool:
    """Whether surface k rises after the first crossing of a step."""
    share, _, certain = rise
    if not certain or not share > first.theta:
        return False
    t, x = first.time, first.state
    value, noise = here.kernel.surfaces(t, *x)[k], here.surfaces.roundoff_bound(k, t, x)
    try:
        return value < -max(noise, abs(here.kernel.rates[k](t, *x)[0]) * run.tie(t))
    except DOMAIN_ERRORS:
        return False


def pieces_of(here: ModeState, span: Span, k: int) -> list[Piece]:
    """The polynomials of surface k."""
    return deflated(span.curves[k]) if k in here.surfaces.active else span.curves[k]


def rises_of(run: Run, here: ModeState, span: Span, k: int) -> Iterator[Rise]:
    """Where surface k rises along a step, on its polynomials."""
    surfaces, pieces = here.surfaces, pieces_of(here, span, k)
    polynomials = ((piece.coefficients, len(piece.coefficients) - 1, piece.off) for piece in pieces)
    if span.ends[k] <= 0 and all(stays_below(run.roots, *each) for each in polynomials):
        return
    first, last = surfaces.roundoff_bound(k, span.t, span.x), surfaces.roundoff_bound(k, span.t1, span.z)
    beyond = pieces[0].coefficients[0] > first
    yield from rises_along(run.roots, pieces, max(first, last), beyond, span.ends[k] > last)


def first_crossing(
    run: Run, here: ModeState, span: Span, k: int, rise: Rise, further: Iterator[Rise]
) -> Crossing | None:
    """Find the first point of a step, from its first rise on, where surface k is crossed and its condition holds."""
    for share, slope, certain in chain([rise], further):
        theta, time, q = settled(here, span, k, share, slope)
        holds = k >= len(here.mode.edges) or here.kernel.conditions[k](time, *q)[0]
        if holds or (k in here.surfaces.active and holds_next(run, here, k, time, q)):
            if not certain:
                run.diagnostics.unsettled(here.mode.name, k, time)
            return Crossing(k, theta, time, q, run.arithmetic.zero)
    return reaches(run, here, span, k, pieces_of(here, span, k))


def with_unseen(run: Run, here: ModeState, span: Span, guards: list[Crossing]) -> list[Crossing]:
    """Crossings, with those before the first one that rise by less than a step's polynomials are off by.

    A surface may be beyond its guard so and be crossed again after the first one.
    """
    t, x, first, found = span.t, span.x, min(guards, key=lambda c: c.time), {c.edge: c for c in guards}
    start, end = here.kernel.surfaces(t, *x), here.kernel.surfaces(first.time, *first.state)
    tied = {c.edge for c in guards if c.time - first.time <= run.tie(first.time)}
    for k in range(len(here.mode.edges)):
        if k in tied or here.surfaces.releases(k) or not first.theta > 0:
            continue
        bound = here.surfaces.roundoff_bound
        if not end[k] > 0 or not end[k] > bound(k, first.time, first.state) or start[k] > bound(k, t, x):
            continue

        def residual(s: Number, k: int = k) -> Number:
            time, q = span.point(s)
            return here.kernel.surfaces(time, *q)[k]

        s = first.theta * 0
        if not start[k] > 0:
            s = close_bracket(residual, (s, start[k]), (first.theta, end[k]), s, run.arithmetic.unit * first.theta)
        time, q = span.point(s)
        if here.kernel.conditions[k](time, *q)[0] or (k in here.surfaces.active and holds_next(run, here, k, time, q)):
            found[k] = Crossing(k, s, time, q, run.arithmetic.zero)
    return list(found.values())


def settled(here: ModeState, span: Span, k: int, s: Number, slope: Number) -> tuple[Number, Number, State]:
    """Correct a crossing on the surface itself to round-off: by Newton's method, else in a bracket."""
    stands, best = k in here.surfaces.active, None

    def residual(s: Number) -> Number:
        time, q = span.point(s)
        return here.kernel.surfaces(time, *q)[k]

    for _ in range(MOST_CORRECTIONS):
        time, q = span.point(s)
        r = here.kernel.surfaces(time, *q)[k]
        if best is not None and not abs(r) < best[0]:
            break
        best = (abs(r), s)
        if slope == 0 or abs(r) <= here.surfaces.roundoff_bound(k, time, q, entry=stands):
            return s, time, q
        s = min(s * 0 + 1, max(s * 0, s - r / slope))
    assert best is not None
    s = bracketed(residual, best[1], here)
    return s, *span.point(s)


def bracketed(residual: Callable[[Number], Number], s: Number, here: ModeState) -> Number:
    """Close in on a rise near s where Newton's method fails (a root of higher order), if one is bracketed there."""
    unit = here.surfaces.arithmetic.unit
    width, one = 8 * unit * max(s, unit), s * 0 + 1
    while width < 1:
        low, high = max(s * 0, s - width), min(one, s + width)
        below, above = residual(low), residual(high)
        if below < 0 and above == 0:
            return high
        if below <= 0 < above:
            return close_bracket(residual, (low, below), (high, above), s * 0, unit * s)
        width = width * 16
    return s


def reaches(run: Run, here: ModeState, span: Span, k: int, pieces: list[Piece]) -> Crossing | None:
    """Return where in a step surface k is reached so and its condition holds, on the step's own polynomial."""
    c, one = pieces[0].coefficients, run.arithmetic.zero + 1
    if not c[1] > 0 or len(pieces) > 1 or not run.control.tolerance > 0:
        return None
    share, time, q, slope = one, span.t1, span.z, slope_of(c, len(c) - 1, one)
    if slope > ROUNDOFF_UNITS * run.arithmetic.unit * c[1]:
        return None
    if here.kernel.rates[k](span.t1, *span.z)[0] > 0:
        if not slope < 0:
            return None
        share = turning(c, one)
        time, q = span.t + share * span.h, at(span.x, span.piece, share)
    elif not abs(span.ends[k]) <= here.surfaces.roundoff_bound(k, span.t, span.x):
        return None
    if not ends_at(run, here, k, time, q):
        return None
    holds = k >= len(here.mode.edges) or here.kernel.conditions[k](time, *q)[0]
    return Crossing(k, share, time, q, run.arithmetic.zero) if holds else None


def turning(c: Sequence[Number], one: Number) -> Number:
    """Where in [0, 1] a polynomial turns that rises at 0 and falls at 1."""
    low, high = one * 0, one
    for _ in range(TURNINGS):
        middle = (low + high) / 2
        low, high = (middle, high) if slope_of(c, len(c) - 1, middle) > 0 else (low, middle)
    return low


def ends_at(run: Run, here: ModeState, k: int, time: Number, q: State) -> bool:
    """Whether a state is on surface k, within the error of a step, and the flow has no value beyond."""
    zero, tolerance = run.arithmetic.zero, run.control.tolerance
    gradient = here.kernel.gradients[k](time, *q)[1:]
    sizes = zip(gradient, q, here.arc.scales, strict=True)
    off = total((abs(g) * (tolerance * max(size, abs(a))) for g, a, size in sizes), zero)
    norm = total((g * g for g in gradient), zero)
    if not norm > 0 or here.kernel.surfaces(time, *q)[k] < -off:
        return False
    beyond = tuple(a + 2 * off / norm * g for a, g in zip(q, gradient, strict=True))
    try:
        end = here.kernel.flow(time, *beyond)
    except DOMAIN_ERRORS:
        return True
    return not run.arithmetic.isfinite(total(end, zero))
