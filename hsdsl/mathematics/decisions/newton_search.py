"""Decisions by numbers: a point that satisfies everything, by Newton's method, or a proof that there is none.

Equations, and inequalities that do not hold, are linearised by difference quotients and solved by the shortest step,
from many starts that are the same every time. A point that is found holds to round-off; that none is found means
nothing. For a proof, boxes where interval arithmetic excludes some constraint are thrown away, and others are halved.
When none is left, there is no point; when they get too many, nothing is known.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from hsdsl.mathematics.decisions.question import Relation
from hsdsl.mathematics.decisions.straight_line_program import Array, StraightLine, quiet

BATCH = 512
MOST_BOXES = 30_000
_SMALLEST = 2.0**-40
STARTS = 96
ROUNDS = 24
_TIGHT = 1e-10  # how far from zero an equation may end, relative to what it is made of
_ROOM = 1e-7  # how far from zero a strict inequality must end
_STEP = 1e-7


@dataclass(frozen=True)
class NewtonSearch:
    """Constraints as a program and what each has to be, and the box to search, with a typical point to start from."""

    program: StraightLine
    relations: tuple[Relation, ...]
    low: Array
    high: Array
    typical: Array

    def point(self) -> Array | None:
        """A point where everything holds, with plain coordinates where that is possible."""
        if not len(self.low):
            found = self._good(np.zeros((1, 0)))
            return np.zeros(0) if found[0] else None
        with quiet():
            points = self._starts()
            for _ in range(ROUNDS):
                if self._good(points).any():
                    break
                points = self._moved(points)
            good = self._good(points)
        return self._plain(points[np.argmax(good)]) if good.any() else None

    def points(self) -> Array:
        """All the points that were found: array (n, names)."""
        with quiet():
            points = self._starts() if len(self.low) else np.zeros((1, 0))
            for _ in range(ROUNDS if len(self.low) else 0):
                points = np.where(self._good(points)[:, None], points, self._moved(points))
            return points[self._good(points)]

    def _starts(self) -> Array:
        generator = np.random.default_rng(0)
        points = self.low + (self.high - self.low) * generator.random((STARTS, len(self.low)))
        near = self.typical + (points - self.typical) * 10.0 ** -generator.integers(0, 4, (STARTS, 1))
        points = np.where((np.arange(STARTS) % 2 == 0)[:, None], points, near)
        points[0] = self.typical
        points[1] = 0.0
        points[2] = (self.low + self.high) / 2
        return np.clip(points, self.low, self.high)

    def _slopes(self, points: Array, values: Array) -> Array:
        """Difference quotients: array (constraints, n, names)."""
        columns: list[Array] = []
        for i in range(points.shape[1]):
            step = _STEP * np.maximum(np.abs(points[:, i]), 1e-3 * np.minimum(self.high[i] - self.low[i], 1e3) + 1e-12)
            step = np.where(points[:, i] + step > self.high[i], -step, step)
            moved = points.copy()
            moved[:, i] += step
            columns.append((self.program.at(moved) - values) / step)
        return np.stack(columns, axis=-1)

    def _good(self, points: Array) -> Array:
        with quiet():
            values = self.program.at(points)
            good = np.isfinite(values).all(axis=0)
            if not good.any() or not points.shape[1]:
                return good & self._hold(values, np.zeros_like(values))
            made_of = (np.abs(self._slopes(points, values)) * np.maximum(np.abs(points), 1e-3)).sum(axis=-1)
        return good & self._hold(values, np.where(np.isfinite(made_of), made_of, np.inf))

    def _hold(self, values: Array, made_of: Array) -> Array:
        equal, strict = _kinds(self.relations)
        near = np.where(equal, np.abs(values), values) <= _TIGHT * np.minimum(made_of, 1e6)
        good: Any = np.where(strict, values < -_ROOM * made_of, near)
        return good.all(axis=0)

    def _moved(self, points: Array) -> Array:
        values = self.program.at(points)
        slopes = self._slopes(points, values)
        equal, strict = _kinds(self.relations)
        room = 0.1 * np.abs(slopes * np.maximum(np.abs(points), 1e-1)).sum(axis=-1)
        beyond = values > np.where(strict, -_ROOM * room, 0.0)
        goal = np.where(equal, values, np.where(beyond, values + room, 0.0))
        active = goal != 0
        matrix = np.where(active[..., None], slopes, 0.0).transpose(1, 0, 2)
        usable: Any = np.isfinite(matrix).all(axis=(1, 2)) & np.isfinite(goal).all(axis=0)
        matrix, right = np.where(usable[:, None, None], matrix, 0.0), np.where(usable[:, None], goal.T, 0.0)
        try:
            step = (np.linalg.pinv(matrix, rcond=1e-9) @ right[..., None])[..., 0]
        except np.linalg.LinAlgError:
            step = np.zeros_like(points)
        lost = ~usable
        step[lost] = 0.5 * (points[lost] - self.typical)
        return np.clip(points - step, self.low, self.high)

    def _plain(self, point: Array) -> Array:
        """The same with rounder coordinates, one by one, as long as everything holds."""
        for i in range(len(point)):
            for change in self._rounder(i):
                moved = point.copy()
                moved[i] = change(point[i])
                if self.low[i] <= moved[i] <= self.high[i] and self._good(moved[None])[0]:
                    point = moved
                    break
        return point

    def _rounder(self, i: int) -> Sequence[Callable[[float], float]]:
        return (lambda x: self.typical[i], lambda x: 0.0, *(lambda x, d=d: float(f"{x:.{d}g}") for d in (1, 2, 3)))


def excluded(
    program: StraightLine, relations: tuple[Relation, ...], low: Array, high: Array, most: int = MOST_BOXES
) -> bool:
    """Whether no point of a box satisfies all constraints, after at most so many boxes.

    ``program`` has their expressions, ``relations`` what each has to be; ``low`` and ``high`` (names) are the box.
    """
    whole = np.maximum(high - low, 1e-300)
    lows, highs = low[None], high[None]
    seen = 0
    while len(lows):
        seen += len(lows[-BATCH:])
        if seen > most:
            return False
        first, last = lows[-BATCH:], highs[-BATCH:]
        left = _possible(program, relations, first, last)
        first, last = first[left], last[left]
        widths = (last - first) / whole
        if len(first) and (not first.shape[1] or widths.max(axis=1).min() < _SMALLEST):
            return False
        halves = _halved(first, last, widths)
        lows, highs = (np.concatenate([kept[:-BATCH], new]) for kept, new in ((lows, halves[0]), (highs, halves[1])))
    return True


def _possible(program: StraightLine, relations: tuple[Relation, ...], low: Array, high: Array) -> Array:
    bounds = program.over(low, high)
    equal, strict = _kinds(relations)
    below, above = np.asarray(bounds.low), np.asarray(bounds.high)
    possible = np.where(strict, below < 0, below <= 0) & (~equal | (above >= 0))
    return np.logical_and.reduce(possible)


def _kinds(relations: tuple[Relation, ...]) -> tuple[Array, Array]:
    """Which constraints are equations, and which are strict: columns."""
    kinds: Any = np.array(relations, dtype=str)[:, None]
    return kinds == "= 0", kinds == "< 0"


def _halved(low: Array, high: Array, widths: Array) -> tuple[Array, Array]:
    if not len(low):
        return low, high
    rows, widest = np.arange(len(low)), widths.argmax(axis=1)
    middle = (low[rows, widest] + high[rows, widest]) / 2
    left_high, right_low = high.copy(), low.copy()
    left_high[rows, widest] = middle
    right_low[rows, widest] = middle
    return np.concatenate([low, right_low]), np.concatenate([left_high, high])
