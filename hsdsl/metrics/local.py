"""Distances where guards, resets or domains are not affine: the best path that local solves find.

Its length is an upper bound (it is a path of the space, checked in points where a domain is curved). Nothing here
bounds from below: that comes from what no passage changes, and from the affine part of the model.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from importlib import import_module
from typing import Any

import numpy as np

from hsdsl.metrics.geometry import Array, Space
from hsdsl.metrics.routes import Crossing, Route, crossings, straight_inside
from hsdsl.metrics.search import End, Found

MOST_SEQUENCES = 6
MORE_HOPS = 1  # than the shortest sequence has
STARTS = 3
ITERATIONS = 250
MANY = 14  # unknowns, from which on one start and fewer iterations must do
ITERATIONS_OF_MANY = 100
# Room for inequalities: a reset may land on a boundary everywhere, and no solver bears that as a constraint.
MARGINS = (1e-8, 1e-10)
STEPS = 12  # of Newton's method back onto a surface


def search_locally(
    space: Space, starts: list[End], ends: list[End], relaxation: float, hops: int, limit: float, enough: float
) -> Found:
    """The best path found between any of ``starts`` and ``ends``; stops where it is as short as ``enough``."""
    found = Found(upper=limit, lower=0.0)
    for start in starts:
        for end in ends:
            for sequence in _sequences(space, start, end, hops):
                if found.upper <= enough * (1 + 1e-9):
                    return found
                _try(space, sequence, start, end, relaxation, found)
    return found


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


def _try(space: Space, sequence: tuple[Crossing, ...], start: End, end: End, relaxation: float, found: Found) -> None:
    toll = start.cost + end.cost + relaxation * len(sequence)
    if not sequence:
        value = float(np.linalg.norm(start.x - end.x)) + toll
        if value < found.upper and straight_inside(space, start.mode, start.x, end.x):
            _keep(found, value, (), start, end, [])
        return
    route = Route(space, sequence, (start.mode, start.x), (end.mode, end.x))
    size = 1e3 * (1 + float(max(np.abs(start.x).max(initial=0), np.abs(end.x).max(initial=0))))
    for guess in _guesses(space, sequence, start, end):
        for margin in MARGINS:
            s = _solve(route, guess, margin * (1 + float(np.abs(guess).max(initial=0))))
            if s is None or not np.abs(s).max(initial=0) <= size:
                continue  # a solve that ran away: so far out its rounding alone would pass for a path
            value = route.length(s) + toll
            if route.allowed(s):
                if value < found.upper:
                    _keep(found, value, sequence, start, end, route.legs(s))
                break


def _keep(
    found: Found,
    value: float,
    sequence: tuple[Crossing, ...],
    start: End,
    end: End,
    legs: list[tuple[int, Array, Array]],
) -> None:
    found.upper, found.start, found.end = value, start, end
    found.route = [(c.edge, c.forward) for c in sequence]
    found.legs = legs or [(start.mode, start.x, end.x)]


def _guesses(space: Space, sequence: tuple[Crossing, ...], start: End, end: End) -> list[Array]:
    """Guard points between p and q, by the names of their coordinates; then some beside them."""
    from_p = dict(zip(space.domains[start.mode].coordinates, start.x.tolist(), strict=True))
    from_q = dict(zip(space.domains[end.mode].coordinates, end.x.tolist(), strict=True))
    middle: list[float] = []
    for k, crossing in enumerate(sequence):
        share = (k + 1) / (len(sequence) + 1)
        for name in space.domains[crossing.guard_mode].coordinates:
            a = from_p.get(name, from_q.get(name, 0.0))
            middle.append(a + share * (from_q.get(name, a) - a))
    guess = np.array(middle)
    spread = np.random.default_rng(0).normal(size=((STARTS - 1) * (len(guess) < MANY), len(guess)))
    width = 0.1 * (0.1 + float(np.abs(guess).max(initial=0)))
    return [guess, *(guess + width * row for row in spread)]


def _solve(route: Route, guess: Array, margin: float) -> Array | None:
    minimise: Any = import_module("scipy.optimize").minimize
    constraints: list[dict[str, Any]] = [
        {"type": "eq", "fun": route.surfaces},
        {"type": "ineq", "fun": lambda s: route.room(s) + margin},  # pyright: ignore[reportUnknownLambdaType, reportUnknownArgumentType]
    ]
    with np.errstate(all="ignore"):
        try:
            answer: Any = minimise(
                route.length,
                guess,
                method="SLSQP",
                constraints=constraints,
                options={"maxiter": ITERATIONS if len(guess) < MANY else ITERATIONS_OF_MANY, "ftol": 1e-13},
            )
        except (ValueError, np.linalg.LinAlgError):
            return None
    return _onto(route, np.array(answer.x, dtype=float))


def _onto(route: Route, s: Array) -> Array:
    """Newton's method onto the surfaces, along their gradients."""
    for _ in range(STEPS):
        residual = route.surfaces(s)
        if not np.all(np.isfinite(residual)) or np.abs(residual).max(initial=0) <= 1e-14:
            break
        step = 1e-7 * (1 + np.abs(s))
        moves = np.diag(step)
        jacobian = np.column_stack(
            [(route.surfaces(s + m) - route.surfaces(s - m)) / (2 * float(h)) for m, h in zip(moves, step, strict=True)]
        )
        if not np.all(np.isfinite(jacobian)):
            break
        s = s - np.linalg.lstsq(jacobian, residual, rcond=None)[0]
    return s
