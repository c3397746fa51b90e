"""A closed form as an execution: each stretch between jumps becomes polynomial pieces of a known error.

On a piece of length h the closed form is interpolated at K + 1 Chebyshev-Lobatto points, so that the pieces of a
stretch join, and the error is at most h^(K+1) M / ((K+1)! 4^K), M a bound on the derivative of order K + 1. What is
stated of the execution adds the round-off of coefficients and of Horner's rule (to first order), and what half a unit
in the last place of a transition's time makes. The values at both sides of a jump are the closed form's, rounded once.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from itertools import pairwise
from math import ceil, factorial, nextafter
from typing import Protocol

import numpy as np

from hsdsl.errors import UsageError
from hsdsl.exact.numbers import DIGITS, Number, Vector, mp
from hsdsl.execution import Arc, Array, Execution, Point, Stop, Transition, Verdict
from hsdsl.program import Program

TOLERANCE = 1e-14  # of the interpolation
UNIT = 2.0**-53


class Lowered(Protocol):
    """A model, as far as an exact execution needs one."""

    @property
    def program(self) -> Program: ...


@dataclass(frozen=True)
class Stretch:
    """The closed form between two jumps, over [start, end] in one mode.

    Attributes
    ----------
    first, last : Vector
        The values at start and end, from within.
    at : callable or None
        The state at a time; None where it is the line from ``first`` to ``last``.
    derivative : callable
        ``derivative(n)``: bounds on the absolute n-th derivatives of the states over the stretch.
    edge : str or None
        The transition that ends it; None where the state goes on, or the run ends.
    alternatives : tuple of str
        Edges reached at the same time and passed over.
    slack : float
        How far the truth may be from what the stretch says (an infinity of bounces put down as a line).
    """

    mode: str
    start: Number
    end: Number
    first: Vector
    last: Vector
    at: Callable[[Number], Vector] | None
    derivative: Callable[[int], Vector]
    edge: str | None = None
    alternatives: tuple[str, ...] = ()
    slack: float = 0.0


@dataclass(frozen=True)
class Scene:
    """An exact execution before it is cut into pieces; ``degree`` 0 is for one that is straight everywhere."""

    name: str
    title: str
    source: str
    states: tuple[str, ...]
    stretches: Sequence[Stretch]
    verdict: Verdict
    degree: int


@dataclass
class _Columns:
    """Rows, arcs and transitions as they are filled in, and the largest error so far."""

    states: tuple[str, ...]
    degree: int
    times: list[float] = field(default_factory=list[float])
    values: list[list[float]] = field(default_factory=list[list[float]])
    coefficients: list[Array] = field(default_factory=list[Array])
    arcs: list[Arc] = field(default_factory=list[Arc])
    transitions: list[Transition] = field(default_factory=list[Transition])
    error: float = 0.0

    def add(self, stretch: Stretch) -> None:
        """Add a stretch as an arc."""
        first = len(self.times)
        cuts = breakpoints(stretch, self.degree)
        for begin, end in pairwise(cuts):
            x = stretch.first if begin is stretch.start else self._at(stretch, begin)
            piece = coefficients(stretch, begin, end, self.degree)
            self._row(float(begin), x, piece)
            self.error = max(self.error, error_of(stretch, begin, end, x, piece))
        self._row(float(stretch.end), stretch.last, np.zeros((self.degree, len(self.states))))
        self.arcs.append(Arc(stretch.mode, self.states, "flow", len(self.transitions), first, len(self.times) - 1))

    def _at(self, stretch: Stretch, t: Number) -> Vector:
        assert stretch.at is not None
        return stretch.at(t)

    def _row(self, t: float, x: Vector, piece: Array) -> None:
        self.times.append(t)
        self.values.append([float(a) for a in x])
        self.coefficients.append(piece)

    def jump(self, before: Stretch, after: Stretch) -> None:
        """Add the transition between two stretches, if there is one."""
        if before.edge is None:
            return
        sides = [dict(zip(self.states, map(float, x), strict=True)) for x in (before.last, after.first)]
        t = float(before.end)
        self.transitions.append(
            Transition(
                index=len(self.transitions),
                time=t,
                resumed=t,
                edge=before.edge,
                source=before.mode,
                target=after.mode,
                before=sides[0],
                after=sides[1],
                alternatives=before.alternatives,
            )
        )


def breakpoints(stretch: Stretch, degree: int) -> list[Number]:
    """Cut a stretch so that every piece keeps the tolerance; between its ends at floats."""
    length = stretch.end - stretch.start
    if stretch.at is None or degree == 0:
        return [stretch.start, stretch.end]
    worst = max(stretch.derivative(degree + 1))
    share = float(worst) / (factorial(degree + 1) * 4.0**degree * TOLERANCE)
    count = max(1, ceil(float(length) * share ** (1 / (degree + 1))))
    inner = sorted({float(stretch.start + length * k / count) for k in range(1, count)})
    low, high = nextafter(float(stretch.start), np.inf), nextafter(float(stretch.end), -np.inf)
    return [stretch.start, *(mp.mpf(t) for t in inner if low < t < high), stretch.end]


@lru_cache
def nodes(degree: int) -> tuple[list[Number], list[list[Number]]]:
    """Chebyshev-Lobatto points of [0, 1] but the first, and the matrix from values there (less the first) to powers."""
    points = [(1 - mp.cos(mp.pi * k / degree)) / 2 for k in range(1, degree + 1)]
    inverse = mp.inverse(mp.matrix([[s**m for m in range(1, degree + 1)] for s in points]))
    return points, inverse.tolist()


def coefficients(stretch: Stretch, begin: Number, end: Number, degree: int) -> Array:
    """Return the piece from ``begin`` to ``end`` by powers, shape (degree, states)."""
    piece = np.zeros((degree, len(stretch.first)))
    if degree == 0:
        return piece
    if stretch.at is None:
        piece[0] = [float(b - a) for a, b in zip(stretch.first, stretch.last, strict=True)]
        return piece
    points, inverse = nodes(degree)
    start = stretch.at(begin)
    rises = [[b - a for a, b in zip(start, stretch.at(begin + s * (end - begin)), strict=True)] for s in points]
    for m, weights in enumerate(inverse):
        piece[m] = [float(mp.fdot(weights, column)) for column in zip(*rises, strict=True)]
    return piece


def error_of(stretch: Stretch, begin: Number, end: Number, x: Vector, piece: Array) -> float:
    """Bound the error of a piece at any float time: interpolation, arithmetic, and its ends' times as floats."""
    degree, h = len(piece), float(end - begin)
    cut = [0.0] * len(x)
    if stretch.at is not None and degree > 0:
        size = h ** (degree + 1) / (factorial(degree + 1) * 4.0**degree)
        cut = [float(m) * size for m in stretch.derivative(degree + 1)]
    late = max(abs(float(float(t) - t)) for t in (begin, end))
    powers = np.arange(1, degree + 1)[:, None]
    arithmetic = UNIT * (2 * np.abs([float(a) for a in x]) + np.sum((5 * powers + 5) * np.abs(piece), axis=0))
    line = 4 * UNIT * np.array([abs(float(b - a)) for a, b in zip(stretch.first, stretch.last, strict=True)])
    if stretch.at is None or degree == 0:
        rates = np.array([float(rate) for rate in stretch.derivative(1)])
    else:
        rates = np.sum(powers * np.abs(piece), axis=0) / h
    return float(np.max(np.array(cut) + arithmetic + line + rates * late)) + stretch.slack


def as_execution(scene: Scene, of: Lowered | None) -> Execution:
    """Cut a scene into pieces.

    Raises
    ------
    UsageError
        ``of`` has other modes or states than the scene.
    """
    columns = _Columns(scene.states, scene.degree)
    for k, stretch in enumerate(scene.stretches):
        if k:
            columns.jump(scene.stretches[k - 1], stretch)
        columns.add(stretch)
    path, digest = _identity(scene, of)
    values, until = np.array(columns.values), columns.times[-1]
    last = columns.arcs[-1]
    return Execution(
        model=path,
        digest=digest,
        engine="closed form",
        scheme="exact",
        method="closed form",
        settings={"until": until, "error": columns.error, "digits": DIGITS, "source": scene.source},
        stop=Stop("until", until, f"reached t = {until:.10g}"),
        transitions=tuple(columns.transitions),
        final=Point(until, last.mode, last.jump, "flow", dict(zip(scene.states, values[-1].tolist(), strict=True)), {}),
        verdict=scene.verdict,
        output_names=(),
        times=np.array(columns.times),
        values=values,
        outputs=np.empty((len(values), 0)),
        depth=np.zeros(len(values)),
        coefficients=np.array(columns.coefficients),
        arcs=tuple(columns.arcs),
        seconds={},
        title=scene.title,
    )


def _identity(scene: Scene, of: Lowered | None) -> tuple[str, str]:
    if of is None:
        return scene.name, ""
    program = of.program
    modes = {mode.name: mode.states for mode in program.modes}
    for stretch in scene.stretches:
        if modes.get(stretch.mode) != scene.states:
            raise UsageError(
                f"{program.path} is not the model of '{scene.title}': it has no mode {stretch.mode} "
                f"with the states {', '.join(scene.states)}"
            )
    return program.path, program.digest
