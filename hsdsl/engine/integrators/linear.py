"""Systems of linear equations for any number type: dense, sparse, and of states with derivatives of them.

Dense LU has partial pivoting: a pivot is the largest number of its column relative to the scale of its row's unknown,
so that it does not depend on the units of the unknowns. Sparse LU keeps to a pattern known before and to the pivots of
the diagonal: a step whose matrix has none is too long, as one whose iteration does not converge. A matrix of states and
derivatives has the same block for the states and for each column of derivatives, and below the first one how these
vary with the states: a solution is one of the states, then one for each column. Complex numbers are pairs of real ones,
so that every number type has them, and every engine the same.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

from hsdsl.base.graphs import Elimination, Variation
from hsdsl.base.numbers.arithmetic import Number

Matrix = list[list[Number]]
Vector = list[Number]
Solve = Callable[[Vector], Vector]  # for a right-hand side
SolveComplex = Callable[[Vector, Vector], tuple[Vector, Vector]]  # the same, real and imaginary parts


class Singular(ValueError):
    """A matrix has no inverse."""


def factored(matrix: Matrix, scales: Sequence[Number] | None = None, groups: Sequence[int] | None = None) -> Solve:
    """Factor a square matrix; its rows, as its columns, belong to unknowns of these scales, all alike where left out.

    Only rows of one of the ``groups`` exchange places; left out, all rows do.

    Raises Singular: a pivot is zero or not a number.
    """
    rows, order = [list(row) for row in matrix], list(range(len(matrix)))
    scales = scales or [1] * len(rows)
    for k in range(len(rows)):
        among = _among(k, len(rows), groups)
        pivot = among[_pivot([abs(rows[i][k]) for i in among], [scales[order[i]] for i in among])]
        rows[k], rows[pivot], order[k], order[pivot] = rows[pivot], rows[k], order[pivot], order[k]
        upper = rows[k]
        if not abs(upper[k]) > 0:
            raise Singular("a matrix without an inverse")
        upper[k] = 1 / upper[k]
        for row in rows[k + 1 :]:
            if row[k] != 0:
                row[k] = row[k] * upper[k]
                for j in range(k + 1, len(row)):
                    row[j] = row[j] - row[k] * upper[j]

    def solve(right: Vector) -> Vector:
        found = [right[i] for i in order]
        for i, row in enumerate(rows):  # below the diagonal is L (its diagonal is 1), above it U
            for j in range(i):
                found[i] = found[i] - row[j] * found[j]
        for i in range(len(found) - 1, -1, -1):
            row = rows[i]
            for j in range(i + 1, len(found)):
                found[i] = found[i] - row[j] * found[j]
            found[i] = found[i] * row[i]  # an inverse pivot
        return found

    return solve


def _among(k: int, n: int, groups: Sequence[int] | None) -> Sequence[int]:
    """The rows that may be the pivot's for column k."""
    return [i for i in range(k, n) if groups[i] == groups[k]] if groups else range(k, n)


def _pivot(column: Vector, scales: Vector) -> int:
    """The first of the largest numbers relative to their scales; those without a scale only where others are zero."""
    pivot = 0
    for i, a in enumerate(column):
        if scales[i] > 0 and scales[pivot] > 0:
            larger = a * scales[pivot] > column[pivot] * scales[i]
        else:
            larger = column[pivot] == 0 and a > 0
        pivot = i if larger else pivot
    return pivot


def factored_complex(
    real: Matrix, imaginary: Matrix, scales: Sequence[Number] | None = None, groups: Sequence[int] | None = None
) -> SolveComplex:
    """Factor a square matrix of complex numbers; the size of a pivot is the sum of its parts' sizes.

    Raises Singular: a pivot is zero or not a number.
    """
    re, im, order = [list(row) for row in real], [list(row) for row in imaginary], list(range(len(real)))
    n = len(order)
    scales = scales or [1] * n
    for k in range(n):
        among = _among(k, n, groups)
        pivot = among[_pivot([abs(re[i][k]) + abs(im[i][k]) for i in among], [scales[order[i]] for i in among])]
        for rows in (re, im):
            rows[k], rows[pivot] = rows[pivot], rows[k]
        order[k], order[pivot] = order[pivot], order[k]
        size = re[k][k] * re[k][k] + im[k][k] * im[k][k]
        if not size > 0:
            raise Singular("a matrix without an inverse")
        c, d = re[k][k], im[k][k] = re[k][k] / size, -im[k][k] / size
        for i in range(k + 1, n):
            p, q = re[i][k], im[i][k]
            if p == 0 and q == 0:
                continue
            p, q = re[i][k], im[i][k] = c * p - d * q, c * q + d * p
            for j in range(k + 1, n):
                re[i][j] = re[i][j] - (p * re[k][j] - q * im[k][j])
                im[i][j] = im[i][j] - (p * im[k][j] + q * re[k][j])

    def solve(real: Vector, imaginary: Vector) -> tuple[Vector, Vector]:
        a, b = [real[i] for i in order], [imaginary[i] for i in order]
        for i in range(n):
            less(a, b, i, range(i))
        for i in range(n - 1, -1, -1):
            less(a, b, i, range(i + 1, n))
            c, d = re[i][i], im[i][i]
            a[i], b[i] = c * a[i] - d * b[i], c * b[i] + d * a[i]
        return a, b

    def less(a: Vector, b: Vector, i: int, others: range) -> None:
        for j in others:
            c, d = re[i][j], im[i][j]
            a[i] = a[i] - (c * a[j] - d * b[j])
            b[i] = b[i] - (c * b[j] + d * a[j])

    return solve


def sparse_factored(of: Elimination, entries: Vector) -> Solve:
    """Factor a matrix, given by all entries of the pattern.

    Raises Singular: a pivot is zero or not a number.
    """
    values = list(entries)
    row = [entries[0] * 0] * len(of.order)
    for i in range(len(of.order)):
        for at in range(of.start[i], of.start[i + 1]):
            row[of.column[at]] = values[at]
        for at in range(of.start[i], of.diagonal[i]):
            k = of.column[at]
            share = row[k] = row[k] * values[of.diagonal[k]]
            for above in range(of.diagonal[k] + 1, of.start[k + 1]):
                row[of.column[above]] = row[of.column[above]] - share * values[above]
        for at in range(of.start[i], of.start[i + 1]):
            values[at] = row[of.column[at]]
        if not abs(row[i]) > 0:
            raise Singular("a matrix without a pivot on its diagonal")
        values[of.diagonal[i]] = 1 / row[i]

    def solve(right: Vector) -> Vector:
        y = [right[i] for i in of.order]
        for i in range(len(y)):
            for at in range(of.start[i], of.diagonal[i]):
                y[i] = y[i] - values[at] * y[of.column[at]]
        found = list(y)
        for i in range(len(y) - 1, -1, -1):
            for at in range(of.diagonal[i] + 1, of.start[i + 1]):
                y[i] = y[i] - values[at] * y[of.column[at]]
            y[i] = y[i] * values[of.diagonal[i]]
            found[of.order[i]] = y[i]
        return found

    return solve


def sparse_factored_complex(of: Elimination, real: Vector, imaginary: Vector) -> SolveComplex:
    """Factor a complex matrix, likewise.

    Raises Singular: a pivot is zero or not a number.
    """
    re, im = list(real), list(imaginary)
    zero: Number = real[0] * 0
    c, d = [zero] * len(of.order), [zero] * len(of.order)
    for i in range(len(of.order)):
        for at in range(of.start[i], of.start[i + 1]):
            c[of.column[at]], d[of.column[at]] = re[at], im[at]
        for at in range(of.start[i], of.diagonal[i]):
            k = of.column[at]
            p, q, u, v = c[k], d[k], re[of.diagonal[k]], im[of.diagonal[k]]
            c[k], d[k] = u * p - v * q, u * q + v * p
            for above in range(of.diagonal[k] + 1, of.start[k + 1]):
                j = of.column[above]
                c[j] = c[j] - (c[k] * re[above] - d[k] * im[above])
                d[j] = d[j] - (c[k] * im[above] + d[k] * re[above])
        for at in range(of.start[i], of.start[i + 1]):
            re[at], im[at] = c[of.column[at]], d[of.column[at]]
        size = c[i] * c[i] + d[i] * d[i]
        if not size > 0:
            raise Singular("a matrix without a pivot on its diagonal")
        re[of.diagonal[i]], im[of.diagonal[i]] = c[i] / size, -d[i] / size

    def solve(real: Vector, imaginary: Vector) -> tuple[Vector, Vector]:
        a, b = [real[i] for i in of.order], [imaginary[i] for i in of.order]
        for i in range(len(a)):
            less(a, b, i, of.start[i], of.diagonal[i])
        one, two = list(a), list(b)
        for i in range(len(a) - 1, -1, -1):
            less(a, b, i, of.diagonal[i] + 1, of.start[i + 1])
            c, d = re[of.diagonal[i]], im[of.diagonal[i]]
            a[i], b[i] = c * a[i] - d * b[i], c * b[i] + d * a[i]
            one[of.order[i]], two[of.order[i]] = a[i], b[i]
        return one, two

    def less(a: Vector, b: Vector, i: int, first: int, end: int) -> None:
        for at in range(first, end):
            c, d, j = re[at], im[at], of.column[at]
            a[i], b[i] = a[i] - (c * a[j] - d * b[j]), b[i] - (c * b[j] + d * a[j])

    return solve


def linked(of: Variation, h: Number, rows: Matrix) -> Vector:
    """What right-hand sides of columns have of the changes of the states: h times the derivatives ``of.links``."""
    return [h * rows[i][j] for i, j in zip(of.linked, of.linking, strict=True)]


def solve_all(of: Variation, links: Vector, solve: Solve, right: Vector) -> Vector:
    """Solve for states and columns of derivatives, ``solve`` being that for the states' own matrix."""
    return solve_columns(of, links, solve, solve(right[: of.own]), right)


def solve_columns(of: Variation, links: Vector, solve: Solve, own: Vector, right: Vector) -> Vector:
    """Solve for the columns, where the solution for the states is known. What does not flow stays as it is."""
    rest, found = _with_links(of, links, right, own), [*own, *(r * 0 for r in right[of.own :])]
    for places, rows in _columns(of):
        column = solve(_whole(of, rest, places, rows))
        for i, row in zip(places, rows, strict=True):
            found[i] = column[row]
    return found


def solve_all_complex(
    of: Variation, links: Vector, solve: SolveComplex, real: Vector, imaginary: Vector
) -> tuple[Vector, Vector]:
    """The same of a complex matrix."""
    n = of.own
    own = solve(real[:n], imaginary[:n])
    rest = [_with_links(of, links, part, a) for part, a in zip((real, imaginary), own, strict=True)]
    a, b = ([*known, *(r * 0 for r in real[n:])] for known in own)
    for places, rows in _columns(of):
        column = solve(*(_whole(of, part, places, rows) for part in rest))
        for i, row in zip(places, rows, strict=True):
            a[i], b[i] = column[0][row], column[1][row]
    return a, b


def _with_links(of: Variation, links: Vector, right: Vector, own: Vector) -> Vector:
    """Right-hand sides with what the changes of the states add."""
    found = list(right)
    for i, j, d in zip(of.linked, of.linking, links, strict=True):
        found[i] = found[i] + d * own[j]
    return found


def _columns(of: Variation) -> Iterator[tuple[range, list[int]]]:
    """Where each column is, and which states it has derivatives of."""
    for begin, end in zip(of.columns, of.columns[1:], strict=False):
        yield range(begin, end), of.rows[begin - of.own : end - of.own]


def _whole(of: Variation, values: Vector, places: range, rows: list[int]) -> Vector:
    """The right-hand side of a column, zero for derivatives that it does not have."""
    found = [values[0] * 0] * of.own
    for row, i in zip(rows, places, strict=True):
        found[row] = values[i]
    return found
