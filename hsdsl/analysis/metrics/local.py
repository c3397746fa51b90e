"""Distances where guards, resets or domains are not affine: the best path that local solves find.

Its length is an upper bound: it is a path of the space, and whether its straight pieces stay in curved domains is
proved where enclosures can (:mod:`hsdsl.analysis.metrics.guard_clearance`). Nothing here bounds from below: that comes from
:mod:`hsdsl.analysis.metrics.guard_clearance`, and from the affine part of the model.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from importlib import import_module
from typing import Any

import numpy as np

from hsdsl.analysis.metrics.budget import Budget
from hsdsl.analysis.metrics.geometry import Array, Space
from hsdsl.analysis.metrics.guard_clearance import CERTAIN, OUTSIDE, segments_inside
from hsdsl.analysis.metrics.routes import Crossing, Route, bend, beyond, crossings
from hsdsl.analysis.metrics.search import End, Query, SearchResult
from hsdsl.analysis.metrics.socp import one_thread

MOST_SEQUENCES = 6
MORE_HOPS = 1  # than the shortest sequence has
STARTS = 3
ITERATIONS = 250
MANY = 14  # unknowns, from which on one start and fewer iterations must do
ITERATIONS_OF_MANY = 100
# Room for inequalities: a reset may land on a boundary everywhere, and no solver bears that as a constraint.
MARGINS = (1e-8, 1e-10)
STILL = 2.0**-52  # relative: a step so short is the last
STEPS = 12  # of Newton's method back onto a surface
FAR = 1e3  # times a guess's size: farther out a solve ran away
SMOOTHING = 1e-9  # of the length where a leg shrinks to nothing, relative to the points' distance
DEPTH = 0.05  # how deep inside a bent path is held, relative to how far outside the straight one was
BENDS = 2  # put into a path whose straight pieces leave their domains, at most so often


def search_locally(query: Query, enough: float) -> SearchResult:
    """The best path found; stops where it is as short as ``enough``."""
    found = SearchResult(upper=query.limit, lower=0.0)
    with one_thread():
        for start in query.starts:
            for end in query.ends:
                for number, sequence in enumerate(_sequences(query.space, start, end, query.most)):
                    if found.upper <= enough or (number and query.budget.spent()):
                        return found
                    route = Route(query.space, sequence, (start.mode, start.x[0]), (end.mode, end.x[0]))
                    _try(route, start.cost + end.cost + query.toll * len(sequence), found, query.budget)
    return found


def improve(route: Route, guess: Array, relaxation: float, budget: Budget) -> tuple[float, Route, Array] | None:
    """The shortest path near a guess through a given sequence: length with tolls, route, unknowns."""
    found = SearchResult()
    with one_thread():
        _try_from(route, guess, relaxation * route.passages, found, budget)
    return None if found.upper == np.inf else (found.upper, found.through, found.unknowns)


def _sequences(space: Space, start: End, end: End, hops: int) -> Iterator[tuple[Crossing, ...]]:
    """Sequences from mode to mode, shortest first, never straight back through the guard just passed."""
    waiting: deque[tuple[Crossing, ...]] = deque([()])
    given, most = 0, hops
    while waiting and given < MOST_SEQUENCES:
        sequence = waiting.popleft()
        mode = sequence[-1].target if sequence else start.mode
        if mode == end.mode and start.bound is None and end.bound is None:
            given += 1
            most = min(most, len(sequence) + MORE_HOPS)
            yield sequence
        if len(sequence) < most:
            waiting.extend((*sequence, c) for c in crossings(space) if c.source == mode and not _back(sequence, c))


def _back(sequence: tuple[Crossing, ...], following: Crossing) -> bool:
    return bool(sequence) and sequence[-1].surface is following.surface and sequence[-1].forward != following.forward


def _try(route: Route, toll: float, found: SearchResult, budget: Budget) -> None:
    p, q = route.start[1], route.end[1]
    if not route.sequence:
        verdict = int(segments_inside(route.space, route.start[0], p[None], q[None])[0])
        if verdict != OUTSIDE:
            _keep(found, float(np.linalg.norm(p - q)) + toll, route, np.zeros(0), verdict)
        else:
            _try_from(_bent(route, np.zeros(0), [0]), (p + q) / 2, toll, found, budget, BENDS - 1)
    for guess in _guesses(route) if route.sequence else ():
        _try_from(route, guess, toll, found, budget)


def _try_from(route: Route, guess: Array, toll: float, found: SearchResult, budget: Budget, bends: int = BENDS) -> None:
    """Solve from a guess; where straight pieces leave their domains, let them bend and solve again."""
    size = FAR * (route.size(guess) or np.inf)
    for margin in MARGINS:
        s = _solve(route, guess, margin, budget)
        # A solve that ran away: so far out its rounding alone would pass for a path.
        if s is None or not np.abs(s).max(initial=0) <= size or not route.allowed(s):
            continue
        value = route.charged(s) + toll
        if value >= found.upper:
            return
        verdicts = route.judged(s)
        outside = [k for k, verdict in enumerate(verdicts) if verdict == OUTSIDE]
        if not outside:
            _keep(found, value, route, s, min(verdicts))
        elif bends:
            bent = _bent(route, s, outside)
            _try_from(bent, _with_middles(route, s, outside), toll, found, budget, bends - 1)
        return


def _bent(route: Route, s: Array, legs: Sequence[int]) -> Route:
    """The same route with a bend in some of its legs, whose halves are held in their domains."""
    held, depths = dict(route.held), dict[int, float]()
    sequence: list[Crossing] = []
    for k, (mode, a, b) in enumerate(route.legs(s)):
        if k in legs:
            depth = max(DEPTH * beyond(route.space, mode, a, b), held.get(k, 0.0))
            depths |= {len(sequence): depth, len(sequence) + 1: depth}
            sequence.append(bend(route.space, mode))
        elif k in held:
            depths[len(sequence)] = held[k]
        sequence += route.sequence[k : k + 1]
    return replace(route, sequence=tuple(sequence), held=tuple(depths.items()))


def _with_middles(route: Route, s: Array, legs: Sequence[int]) -> Array:
    points = [*route.points(s), np.zeros(0)]
    parts: list[Array] = []
    for k, (_, a, b) in enumerate(route.legs(s)):
        parts += [(a + b) / 2] * (k in legs)
        parts.append(points[k])
    return np.concatenate(parts)


def _keep(found: SearchResult, value: float, route: Route, s: Array, verdict: int) -> None:
    if value < found.upper:
        found.upper, found.unknowns, found.through, found.proved = value, s, route, verdict == CERTAIN


def _guesses(route: Route) -> list[Array]:
    """Guard points between p and q, by the names of their coordinates; then some near them."""
    domains, (source, p), (target, q) = route.space.domains, route.start, route.end
    from_p = dict(zip(domains[source].coordinates, p.tolist(), strict=True))
    from_q = dict(zip(domains[target].coordinates, q.tolist(), strict=True))
    middle: list[float] = []
    for k, crossing in enumerate(route.sequence):
        share = (k + 1) / (len(route.sequence) + 1)
        for name in domains[crossing.guard_mode].coordinates:
            a = from_p.get(name, from_q.get(name, 0.0))
            middle.append(a + share * (from_q.get(name, a) - a))
    guess = np.array(middle)
    spread = np.random.default_rng(0).normal(size=((STARTS - 1) * (len(guess) < MANY), len(guess)))
    ends = np.abs(np.concatenate([p, q])).max(initial=0.0)
    width = 0.1 * (float(np.abs(guess).max(initial=ends)) or 1.0)
    return [guess, *(guess + width * row for row in spread)]


class _TimeOver(Exception):
    """Raised within a solve when the budget is spent."""


def _solve(route: Route, guess: Array, margin: float, budget: Budget) -> Array | None:
    """Solve in units of the path's own size, each constraint in units of its slope; None without a result in time."""
    minimise: Any = import_module("scipy.optimize").minimize
    unit = max(route.length(guess), 1e-3 * route.size(guess)) or 1.0
    on, in_ = (1 / (unit * _slopes(rows)) for rows in (route.surface_slopes(guess), route.room_slopes(guess)))
    clear = margin * max(1.0, route.size(guess) / unit)

    def length(x: Array) -> tuple[float, Array]:
        if budget.spent():
            raise _TimeOver
        value, slope = route.smooth_length(unit * x, SMOOTHING * unit)
        return value / unit, slope

    constraints = [
        _constraint("eq", route.surfaces, route.surface_slopes, unit, on, 0.0),
        _constraint("ineq", route.room, route.room_slopes, unit, in_, clear),
    ]
    most = ITERATIONS if len(guess) < MANY else ITERATIONS_OF_MANY
    options = {"maxiter": most, "ftol": 1e-11}
    with np.errstate(all="ignore"):
        try:
            first = guess / unit
            answer: Any = minimise(length, first, jac=True, method="SLSQP", constraints=constraints, options=options)
        except (_TimeOver, ValueError, np.linalg.LinAlgError):
            return None
        return onto(route, unit * np.array(answer.x, dtype=float))


def _constraint(
    kind: str,
    value: Callable[[Array], Array],
    slopes: Callable[[Array], Array],
    unit: float,
    factors: Array,
    more: float,
) -> dict[str, Any]:
    """A constraint as the solver takes it, of unknowns in a unit, each row times a factor."""

    def scaled(x: Array) -> Array:
        return factors * value(unit * x) + more

    def scaled_slopes(x: Array) -> Array:
        return (unit * factors)[:, None] * slopes(unit * x)

    return {"type": kind, "fun": scaled, "jac": scaled_slopes}


def _slopes(rows: Array) -> Array:
    """How steep functions are; 1 where they are not, or not known to be."""
    steep = np.linalg.norm(rows, axis=1)
    return np.where(np.isfinite(steep) & (steep > 0), steep, 1.0)


def onto(route: Route, s: Array) -> Array:
    """Newton's method onto the surfaces, along their gradients."""
    for _ in range(STEPS):
        residual = route.surfaces(s)
        if not residual.any() or not np.all(np.isfinite(residual)):
            break
        jacobian = route.surface_slopes(s)
        if not np.all(np.isfinite(jacobian)):
            break
        step = np.linalg.lstsq(jacobian, residual, rcond=None)[0]
        s = s - step
        if np.abs(step).max() <= STILL * np.abs(s).max():
            break
    return s
