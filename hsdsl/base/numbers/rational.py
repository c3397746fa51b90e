"""Affine maps and inequalities in rational numbers: linear programs and orthogonal parts without rounding.

Arrays hold fractions. An affine function of n coordinates is a vector of its constant and its n slopes, a map of them a
matrix of such rows; inequalities are functions that are at most 0. What floating point cannot decide is decided here:
whether a guard is empty, whether an inequality is an equation in disguise, whether a passage can be of use.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from fractions import Fraction
from math import sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray

Exact = NDArray[np.object_]


def matrix(rows: Iterable[Any], width: int) -> Exact:
    """Rows of a width as one array."""
    rows = list(rows)
    return np.array(rows, dtype=object).reshape(len(rows), width)


def zeros(*shape: int) -> Exact:
    """An array of zeros."""
    return np.full(shape, Fraction(0), dtype=object)


def axes(size: int) -> Exact:
    """The unit vectors."""
    found = zeros(size, size)
    np.fill_diagonal(found, Fraction(1))
    return found


def after(outer: Exact, inner: Exact) -> Exact:
    """One map after another."""
    found = outer[:, 1:] @ inner
    found[:, 0] += outer[:, 0]
    return found


def about(x: Sequence[Fraction] | Exact) -> Fraction:
    """The Euclidean length, to rounding; 0 for 0 alone."""
    largest = max((abs(v) for v in x), default=Fraction(0))
    return largest * Fraction(sqrt(sum(float(v / largest) ** 2 for v in x))) if largest else largest


def orthogonal(vectors: Exact, given: Sequence[Exact] = ()) -> list[Exact]:
    """What vectors add to the span of orthogonal ``given`` ones: an orthogonal basis of it, of any lengths."""
    basis = list(given)
    for vector in vectors:
        rest = without(vector, basis)
        if rest.any():
            basis.append(rest)
    return basis[len(given) :]


def without(vector: Exact, basis: Sequence[Exact]) -> Exact:
    """A vector's part orthogonal to an orthogonal basis."""
    for b in basis:
        vector = vector - b * ((vector @ b) / (b @ b))
    return vector


def plane(equations: Exact) -> Exact | None:
    """Where equations hold, as a map of coordinates; None where they contradict.

    The base is the point nearest to 0, the frame orthogonal and of unit length to rounding, exactly in the plane.
    """
    size = equations.shape[1] - 1
    across: list[Exact] = []
    point = zeros(size)
    for equation in equations:
        rest, missing = without(equation[1:], across), equation[0] + equation[1:] @ point
        if rest.any():
            across.append(rest)
            point = point - rest * (missing / (rest @ rest))
        elif missing:
            return None
    along = orthogonal(axes(size), across)
    frame = [without(np.array([Fraction(float(v / about(d))) for v in d], dtype=object), across) for d in along]
    return np.column_stack([point, *frame])


def maximise(cost: Exact, rows: Exact, start: Exact) -> tuple[Exact, Exact] | None:
    """Maximise ``cost . x`` where all rows are at most 0, from a point where they are.

    Returns a maximiser and a weight for each row, None where there is no maximum. Weights are not negative, the slopes
    of rows so weighted add up to the cost, and rows of positive weight are 0 at every maximiser.
    """
    size = len(start)
    # A line for each basic variable: its value, and its change with each other one; the last is the goal's. Names: x
    # is 0 to n, then the rows.
    table = np.vstack([-rows, np.append(zeros(1), cost)])
    table[:, 0] += table[:, 1:] @ start
    basic, other = [size + i for i in range(len(rows))], list(range(size))
    while (column := _entering(table[-1], other, size)) is not None:
        change = table[:-1, column] * (1 if table[-1, column] > 0 else -1)
        stops = [i for i, name in enumerate(basic) if name >= size and change[i] < 0]
        if not stops:
            return None
        leaving = min(stops, key=lambda i: (-table[i, 0] / change[i], basic[i]))
        line = table[leaving] / -table[leaving, column]
        line[column] = 1 / table[leaving, column]
        factors = table[:, column].copy()
        table[:, column] = factors * 0
        table += np.outer(factors, line)
        table[leaving] = line
        basic[leaving], other[column - 1] = other[column - 1], basic[leaving]
    point, weights = start.copy(), zeros(len(rows))
    for name, value in zip(basic, table[:, 0], strict=False):
        if name < size:
            point[name] += value
    for name, value in zip(other, table[-1, 1:], strict=True):
        if name >= size:
            weights[name - size] = -value
    return point, weights


def _entering(goal: Exact, other: list[int], size: int) -> int | None:
    """The column of the first variable whose change raises the goal (Bland's rule); one of x may go either way."""
    raising = [k for k, name in enumerate(other, 1) if goal[k] > 0 or (goal[k] and name < size)]
    return min(raising, key=lambda k: other[k - 1], default=None)


def deepest(rows: Exact) -> tuple[Fraction, Exact, Exact]:
    """The depth of the point farthest inside all rows, that point, and weights of the rows.

    Depth is at most their largest number, and negative where no point satisfies all rows. Where it is 0, rows of
    positive weight are equations.
    """
    lengths: Exact = np.array([about(row[1:]) for row in rows], dtype=object)
    distances = -rows[:, 0] / lengths
    goal = axes(rows.shape[1])[-1]
    wider = np.vstack([np.column_stack([rows, lengths]), np.append(zeros(1), goal)])
    wider[-1, 0] = -(max(abs(distances)) or Fraction(1))
    found = maximise(goal, wider, goal * min(distances))
    assert found is not None  # the last row bounds it
    return found[0][-1], found[0][:-1], found[1][:-1]


def never_negative(form: Exact) -> bool:
    """Whether a symmetric matrix has no negative eigenvalue, by elimination."""
    while len(form):
        k = int(np.argmax(form.diagonal()))
        if form[k, k] <= 0:
            return not form.any()
        kept = np.arange(len(form)) != k
        form = form[np.ix_(kept, kept)] - np.outer(form[kept, k], form[k, kept]) / form[k, k]
    return True
