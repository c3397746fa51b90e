"""Two curves on their common time span, cut at the breakpoints of both."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from hsdsl.analysis.metrics.bernstein import degree_raised, restrict
from hsdsl.analysis.metrics.trace import Array, Trace
from hsdsl.base.errors import UsageError

ROUNDOFF = 64 * 2.0**-53  # times the largest state: two bounds need not be nearer


@dataclass(frozen=True, eq=False)
class Side:
    """One curve on n cells, each a part of a piece of ``trace``.

    ``powers`` (n, p + 1, w) are its polynomials by powers of u in [0, 1]; ``depth`` (n, 2) is the depth in the strip at
    the cells' ends, 0 where the state flows; ``rounding`` is how far rounding may have moved any point of the curve.
    """

    trace: Trace
    pieces: Array
    powers: Array
    depth: Array
    duration: Array
    rounding: Array

    @property
    def stray(self) -> Array:
        """How much of the length of the control polygon rounding may have hidden: its legs are short of the curve."""
        return 2 * self.powers.shape[1] * self.trace.roughness[self.pieces]

    @property
    def mode(self) -> Array:
        """Name of each cell's mode."""
        return np.array([name for name, _ in self.trace.modes])[self.trace.mode[self.pieces]]

    @property
    def edge(self) -> Array:
        """Edge of the strip that each cell is in, empty where the state flows."""
        return np.array([*self.trace.edges, ""])[self.trace.strip[self.pieces]]

    def at_end(self, end: int) -> Array:
        """Return the states at the cells' left (0) or right (1) ends, shape (n, w)."""
        return self.powers[:, 0] if end == 0 else np.sum(self.powers, axis=1)

    def __getitem__(self, chosen: Array) -> Side:
        arrays = (self.pieces, self.powers, self.depth, self.duration, self.rounding)
        return Side(self.trace, *(array[chosen] for array in arrays))


@dataclass(frozen=True, eq=False)
class Cells:
    """Parts of the common time span in which each curve is one polynomial; the ends of a cell belong to it.

    The left end of a cell compares values with values, its right end left limits with left limits. The last cell has no
    length: it compares the values at the very end.
    """

    a: Trace
    b: Trace
    piece_a: Array
    piece_b: Array
    begin: Array
    end: Array

    def __len__(self) -> int:
        return len(self.begin)

    @property
    def _arrays(self) -> tuple[Array, ...]:
        return self.piece_a, self.piece_b, self.begin, self.end

    def __getitem__(self, chosen: Array | slice) -> Cells:
        return Cells(self.a, self.b, *(array[chosen] for array in self._arrays))

    def joined(self, other: Cells) -> Cells:
        """These cells, then others of the same curves."""
        pairs = zip(self._arrays, other._arrays, strict=True)
        return Cells(self.a, self.b, *(np.concatenate(pair) for pair in pairs))

    def halved(self) -> Cells:
        """Cut each cell in two, first halves first."""
        middle = self.begin + (self.end - self.begin) / 2
        return replace(self, end=middle).joined(replace(self, begin=middle))

    @property
    def divisible(self) -> Array:
        """Whether there is a number between the ends of each cell."""
        middle = self.begin + (self.end - self.begin) / 2
        return (middle > self.begin) & (middle < self.end)

    @property
    def same(self) -> bool:
        """Whether both curves are one."""
        return self.a.equals(self.b)

    @cached_property
    def span(self) -> tuple[float, float]:
        """The time span that both curves cover."""
        return common_span(self.a, self.b)

    @property
    def note(self) -> str:
        """A sentence where a curve goes on beyond that."""
        begin, end = self.span
        whole = all((curve.start[0], curve.end[-1]) == self.span for curve in (self.a, self.b))
        return "" if whole else f"Compared from t = {begin:.10g} to {end:.10g}, which both cover."

    @cached_property
    def rounding(self) -> float:
        """How far apart bounds on the two curves may be for rounding alone."""
        return rounding_of(self.a, self.b)

    def sides(self) -> tuple[Side, Side]:
        """Return both curves on the cells, their polynomials of one degree."""
        degree = max(self.a.coefficients.shape[1], self.b.coefficients.shape[1]) - 1
        return self._side(self.a, self.piece_a, degree), self._side(self.b, self.piece_b, degree)

    def _side(self, trace: Trace, pieces: Array, degree: int) -> Side:
        first, last = trace.share(pieces, self.begin), trace.share(pieces, self.end)
        powers = degree_raised(restrict(trace.coefficients[pieces], first, last), degree)
        depth = np.stack([trace.depths(pieces, first), trace.depths(pieces, last)], axis=1)
        return Side(trace, pieces, powers, depth, self.end - self.begin, trace.rounding[pieces])


def rounding_of(*curves: Trace) -> float:
    """Return how far apart two bounds on curves may be for rounding alone."""
    largest = max(float(np.max(np.abs(curve.coefficients[:, 0]), initial=0.0)) for curve in curves)
    return ROUNDOFF * largest + 4 * sum(float(np.max(curve.rounding, initial=0.0)) for curve in curves)


def common_span(a: Trace, b: Trace) -> tuple[float, float]:
    """Return the time span that both curves cover; raise :class:`UsageError` without any."""
    begin, end = max(a.start[0], b.start[0]), min(a.end[-1], b.end[-1])
    if begin > end:
        raise UsageError(
            f"the runs have no time in common: one goes from {a.start[0]:.10g} to {a.end[-1]:.10g}, "
            f"the other from {b.start[0]:.10g} to {b.end[-1]:.10g}"
        )
    return float(begin), float(end)


def merge(a: Trace, b: Trace) -> Cells:
    """Cut the common time span of two curves at the breakpoints of both."""
    begin, end = common_span(a, b)
    breaks = np.union1d(a.start, b.start)
    breaks = np.union1d(breaks[(breaks > begin) & (breaks < end)], [begin, end])
    starts, ends = breaks, np.append(breaks[1:], end)
    return Cells(a, b, a.find(starts), b.find(starts), starts, ends)
