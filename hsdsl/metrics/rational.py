"""Vectors and inequalities in rational numbers: linear programs and orthogonal parts without rounding.

What floating point cannot decide is decided here: whether a guard is empty, whether an inequality is an equation in
disguise, whether a passage can be of use.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from math import sqrt

Vector = tuple[Fraction, ...]
Row = tuple[Vector, Fraction]  # normal . x <= level, or = level

ZERO = Fraction(0)


def dot(a: Sequence[Fraction], b: Sequence[Fraction]) -> Fraction:
    """The inner product."""
    return sum((x * y for x, y in zip(a, b, strict=True) if x and y), ZERO)


def times(matrix: Sequence[Vector], x: Sequence[Fraction]) -> Vector:
    """A matrix, by rows, times a vector."""
    return tuple(dot(row, x) for row in matrix)


def plus(a: Sequence[Fraction], b: Sequence[Fraction], factor: Fraction = Fraction(1)) -> Vector:
    """A + factor b."""
    return tuple(x + factor * y for x, y in zip(a, b, strict=True))


def about(x: Sequence[Fraction]) -> Fraction:
    """The Euclidean length, to rounding; 0 for 0 alone."""
    largest = max((abs(v) for v in x), default=ZERO)
    if not largest:
        return ZERO
    return largest * Fraction(sqrt(sum(float(v / largest) ** 2 for v in x)))


def orthogonal(vectors: Sequence[Vector], given: Sequence[Vector] = ()) -> list[Vector]:
    """What vectors add to the span of orthogonal ``given`` ones: an orthogonal basis of it, of any lengths."""
    basis = list(given)
    for vector in vectors:
        rest = without(vector, basis)
        if any(rest):
            basis.append(rest)
    return basis[len(given) :]


def without(vector: Vector, basis: Sequence[Vector]) -> Vector:
    """A vector's part orthogonal to an orthogonal basis."""
    for b in basis:
        vector = plus(vector, b, -dot(vector, b) / dot(b, b))
    return vector


def axes(size: int) -> list[Vector]:
    """The unit vectors."""
    return [tuple(Fraction(int(i == j)) for j in range(size)) for i in range(size)]


class Plane:
    """The points where equations hold: an orthogonal basis of what they fix, and the point nearest to 0."""

    def __init__(self, size: int, equations: Sequence[Row]) -> None:
        self.across: list[Vector] = []
        self.point: Vector = (ZERO,) * size
        self.empty = False
        for normal, level in equations:
            rest = without(normal, self.across)
            missing = level - dot(normal, self.point)
            if any(rest):
                self.across.append(rest)
                self.point = plus(self.point, rest, missing / dot(rest, rest))
            elif missing:
                self.empty = True

    def along(self) -> list[Vector]:
        """Directions in it: orthogonal and of unit length to rounding, exactly in the plane."""
        found = orthogonal(axes(len(self.point)), self.across)
        near = (tuple(Fraction(float(v / about(d))) for v in d) for d in found)
        return [without(d, self.across) for d in near]


def maximise(cost: Sequence[Fraction], rows: Sequence[Row], start: Sequence[Fraction]) -> tuple[Vector, Vector] | None:
    """Maximise ``cost . x`` where ``normal . x <= level`` for every row, from a point where that holds.

    Returns a maximiser and a weight for each row, None where there is no maximum. Weights are not negative, their sum
    is the cost, and rows of positive weight hold as equations at every maximiser.
    """
    size = len(start)
    # A line for each basic variable: its value, and its change with each other one. Names: x is 0 to n, then the rows.
    table = [[level - dot(normal, start), *(-v for v in normal)] for normal, level in rows]
    goal = [ZERO, *cost]
    basic, other = [size + i for i in range(len(rows))], list(range(size))
    while (entering := _entering(goal, other, size)) is not None:
        column, up = entering
        leaving = _leaving(table, basic, column, up, size)
        if leaving is None:
            return None
        line = _pivoted(table[leaving], column)
        for i, old in enumerate(table):
            if i != leaving and old[column]:
                table[i] = _replaced(old, column, line)
        table[leaving], goal = line, _replaced(goal, column, line)
        basic[leaving], other[column - 1] = other[column - 1], basic[leaving]
    point, weights = list(start), [ZERO] * len(rows)
    for name, line in zip(basic, table, strict=True):
        if name < size:
            point[name] += line[0]
    for name, value in zip(other, goal[1:], strict=True):
        if name >= size:
            weights[name - size] = -value
    return tuple(point), tuple(weights)


def _entering(goal: list[Fraction], other: list[int], size: int) -> tuple[int, bool] | None:
    """The first variable whose change raises the goal (Bland's rule); one without a sign may go either way."""
    best: tuple[int, int, bool] | None = None
    for column, name in enumerate(other, start=1):
        value = goal[column]
        if (value > 0 or (value and name < size)) and (best is None or name < best[0]):
            best = name, column, value > 0
    return None if best is None else best[1:]


def _leaving(table: list[list[Fraction]], basic: list[int], column: int, up: bool, size: int) -> int | None:
    """The row that stops the change first."""
    best: tuple[Fraction, int, int] | None = None
    for i, (name, line) in enumerate(zip(basic, table, strict=True)):
        change = line[column] if up else -line[column]
        if name >= size and change < 0:
            found = (-line[0] / change, name, i)
            best = found if best is None or found < best else best
    return None if best is None else best[2]


def _pivoted(line: list[Fraction], column: int) -> list[Fraction]:
    """A line solved for the variable of a column, whose place the line's own takes."""
    factor = line[column]
    solved = [-v / factor for v in line]
    solved[column] = 1 / factor
    return solved


def _replaced(line: list[Fraction], column: int, by: list[Fraction]) -> list[Fraction]:
    factor = line[column]
    if not factor:
        return line
    found = [v + factor * w for v, w in zip(line, by, strict=True)]
    found[column] = factor * by[column]
    return found


def deepest(rows: Sequence[Row]) -> tuple[Fraction, Vector, Vector]:
    """The depth of the point farthest inside all rows, that point, and weights of the rows.

    Depth is at most their largest number, and negative where no point satisfies all rows. Where it is 0, rows of
    positive weight are equations.
    """
    size = len(rows[0][0])
    lengths = [about(normal) for normal, _ in rows]
    distances = [level / length for (_, level), length in zip(rows, lengths, strict=True)]
    most = max(map(abs, distances)) or Fraction(1)
    wider = [((*normal, length), level) for (normal, level), length in zip(rows, lengths, strict=True)]
    wider.append(((ZERO,) * size + (Fraction(1),), most))
    found = maximise((ZERO,) * size + (Fraction(1),), wider, (ZERO,) * size + (min(distances),))
    assert found is not None  # the last row bounds it
    (*point, depth), weights = found
    return depth, tuple(point), weights[:-1]


def never_negative(form: Sequence[Sequence[Fraction]]) -> bool:
    """Whether a symmetric matrix has no negative eigenvalue, by elimination."""
    left: list[list[Fraction]] = [list(row) for row in form]
    while left:
        k = max(range(len(left)), key=lambda i: left[i][i])
        pivot = left[k][k]
        if pivot <= 0:
            return not any(any(row) for row in left)
        across = left[k]
        left = [
            [v - row[k] * w / pivot for j, (v, w) in enumerate(zip(row, across, strict=True)) if j != k]
            for i, row in enumerate(left)
            if i != k
        ]
    return True
