"""Executions of smooth hybrid systems by Taylor series of high order, in many digits.

It shares nothing with the simulator: no strips, no stages, no interpolant, equations written for `hsdsl.exact` by hand.
A step sums the solution's series; a crossing is a root of the surface's own series. Steps are half as long in a
second solution, and the digits in which both agree are the digits that are stated.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from itertools import pairwise
from math import floor
from typing import Any

from hsdsl.base.errors import UsageError
from references.interpolation import Number, Stretch, Vector, mp
from references.series import Flow, Series, States, solution, value, values

ORDER = 40
ZERO = mp.mpf(10) ** -50  # below it a surface is reached, and two times are one
MOST = 1000  # transitions
SAMPLES = 16  # of a surface in each step: two crossings within a sixteenth of a step would be missed


@dataclass(frozen=True)
class Edge:
    """A transition: made when ``surface`` rises through 0; ``reset`` gives what changes."""

    name: str
    target: str
    surface: Callable[[States], Series]
    reset: Callable[[States], Mapping[str, Any]] = lambda states: {}


@dataclass(frozen=True)
class Mode:
    """States in the model's order, their rates, and the transitions in the model's order; no flow: the run ends."""

    states: tuple[str, ...]
    flow: Flow | None
    edges: tuple[Edge, ...] = ()


@dataclass
class Solved:
    """An execution by series.

    Attributes
    ----------
    stretches : list of Stretch
        What `hsdsl.exact.pieces` cuts into pieces.
    rates : list
        How fast the surface rises at each transition.
    misses : list
        How near to a surface the state turned back, wherever it did.
    final : str or None
        The final mode entered at the end.
    """

    stretches: list[Stretch] = field(default_factory=list[Stretch])
    rates: list[Number] = field(default_factory=list[Number])
    misses: list[Number] = field(default_factory=list[Number])
    final: str | None = None


class Arc:
    """Steps in one mode: their starts, and the states' coefficients."""

    def __init__(self, start: Number) -> None:
        self.start = start
        self.starts: list[Number] = []
        self.columns: list[list[list[Number]]] = []
        self.length = mp.zero  # of the longest step

    def add(self, t: Number, columns: list[list[Number]], h: Number) -> None:
        """Add a step."""
        self.starts.append(t)
        self.columns.append(columns)
        self.length = max(self.length, h)

    def at(self, t: Number) -> Vector:
        """The states at a time."""
        k = max(0, bisect_right(self.starts, t) - 1)
        return values(self.columns[k], t - self.starts[k])

    def derivative(self, n: int) -> Vector:
        """Bounds on the n-th derivatives: sums of absolute terms, to the order of the series."""
        h = self.length
        weights = [mp.factorial(k) / mp.factorial(k - n) * h ** (k - n) for k in range(n, ORDER + 1)]
        each = [tuple(mp.fdot(weights, [abs(c) for c in column[n:]]) for column in columns) for columns in self.columns]
        return tuple(max(sizes) for sizes in zip(*each, strict=True))


@dataclass(frozen=True)
class Crossing:
    """Where an edge's surface is crossed, in time from the step's start, and how fast it rises there."""

    time: Number
    edge: Edge
    rate: Number


def solve(
    modes: Mapping[str, Mode], mode: str, start: Sequence[Number], until: Number, step: Number, order: int = 1
) -> Solved:
    """Follow an execution from ``start`` in ``mode`` to ``until``, or to a final mode.

    Of transitions at one time the first in the model's order is made, with ``order`` -1 the last.

    Raises UsageError: more than 1000 transitions.
    """
    solved, t, x = Solved(), mp.zero, tuple(start)
    for _ in range(MOST):
        flow = modes[mode].flow
        if flow is None:
            solved.final = mode
            return solved
        stretch, crossing = _follow(modes[mode], mode, flow, t, x, until, (step, order), solved)
        solved.stretches.append(stretch)
        if crossing is None:
            return solved
        solved.rates.append(crossing.rate)
        t, x = stretch.end, _after(modes, mode, crossing.edge, stretch.last)
        mode = crossing.edge.target
    raise UsageError(f"more than {MOST} transitions")


def _follow(
    mode: Mode, name: str, flow: Flow, t: Number, x: Vector, until: Number, how: tuple[Number, int], solved: Solved
) -> tuple[Stretch, Crossing | None]:
    """Step through one mode, up to a crossing or the end."""
    (step, order), arc, first, crossed = how, Arc(t), x, list[Crossing]()
    seen: list[list[Number]] = [[] for _ in mode.edges]
    while not crossed:
        series = solution(flow, dict(zip(mode.states, x, strict=True)))
        surfaces = [edge.surface(series).upto(ORDER) for edge in mode.edges]
        h = min(step, until - t)
        found = [_crossing(edge, surface, h) for edge, surface in zip(mode.edges, surfaces, strict=True)]
        crossed = sorted((c for c in found if c is not None), key=lambda c: c.time)
        taken = crossed[0].time if crossed else h
        columns = [series[state].upto(ORDER) for state in mode.states]
        arc.add(t, columns, taken)
        for known, surface in zip(seen, surfaces, strict=True):
            known += [value(surface, taken * k / SAMPLES) for k in range(SAMPLES)]
        t, x = t + taken, values(columns, taken)
        if t >= until:
            break
    solved.misses += [miss for known in seen for miss in _misses(known)]
    together = [c for c in crossed if c.time - crossed[0].time <= ZERO]
    together.sort(key=lambda c: order * mode.edges.index(c.edge))
    names = tuple(c.edge.name for c in together)
    stretch = Stretch(name, arc.start, t, first, x, arc.at, arc.derivative, names[0] if names else None, names[1:])
    return stretch, together[0] if together else None


def _crossing(edge: Edge, surface: list[Number], h: Number) -> Crossing | None:
    """Find the first rise of a surface through 0 within [0, h]; a start on it counts if it rises from there."""
    slopes = [k * c for k, c in enumerate(surface)][1:]
    if abs(surface[0]) <= ZERO and slopes[0] > ZERO:
        return Crossing(mp.zero, edge, slopes[0])
    times = [h * k / SAMPLES for k in range(SAMPLES + 1)]
    for low, high in pairwise(times):
        if value(surface, high) > 0:
            root = mp.findroot(partial(value, surface), (low, high), solver="anderson", tol=1e-130)
            return Crossing(root, edge, value(slopes, root))
    return None


def _misses(known: list[Number]) -> Iterator[Number]:
    """Give the distances at which a sampled surface function turned back below 0."""
    for before, here, after in zip(known, known[1:], known[2:], strict=False):
        if before < here >= after:
            yield -here


def _after(modes: Mapping[str, Mode], mode: str, edge: Edge, x: Vector) -> Vector:
    """The state behind a transition."""
    states: dict[str, Any] = {name: Series.constant(a) for name, a in zip(modes[mode].states, x, strict=True)}
    states |= edge.reset(states)
    names = modes[edge.target].states if modes[edge.target].flow is not None else modes[mode].states
    return tuple(states[name][0] for name in names)


def digits(a: Solved, b: Solved) -> int:
    """Return in how many digits behind the point two solutions agree, in times and states of transitions and ends.

    Raises UsageError: they make other transitions.
    """
    if [s.edge for s in a.stretches] != [s.edge for s in b.stretches]:
        raise UsageError("half the step makes other transitions")
    worst = mp.zero
    for one, other in zip(a.stretches, b.stretches, strict=True):
        for x, y in zip((one.end, *one.first, *one.last), (other.end, *other.first, *other.last), strict=True):
            worst = max(worst, abs(x - y))
    return int(mp.dps) if worst == 0 else floor(-mp.log10(worst))
