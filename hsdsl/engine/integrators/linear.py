"""Systems of linear equations for any number type: dense LU with partial pivoting, for the few states of a mode.

A pivot is the largest number of its column relative to the scale of its row's unknown, so that it does not depend on
the units of the unknowns. Complex numbers are pairs of real ones, so that every number type has them, and every engine
the same.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from hsdsl.base.numbers.arithmetic import Number

Matrix = list[list[Number]]
Vector = list[Number]


class Singular(ValueError):
    """A matrix has no inverse."""


@dataclass(frozen=True)
class Factors:
    """Factors of a matrix with permuted rows: below the diagonal L (its diagonal is 1), above it U.

    The diagonal has the inverse pivots.
    """

    rows: Matrix
    order: list[int]

    def solve(self, right: Vector) -> Vector:
        """Solve for a right-hand side."""
        found = [right[i] for i in self.order]
        for i, row in enumerate(self.rows):
            for j in range(i):
                found[i] = found[i] - row[j] * found[j]
        for i in range(len(found) - 1, -1, -1):
            row = self.rows[i]
            for j in range(i + 1, len(found)):
                found[i] = found[i] - row[j] * found[j]
            found[i] = found[i] * row[i]
        return found


def factored(matrix: Matrix, scales: Sequence[Number] | None = None, groups: Sequence[int] | None = None) -> Factors:
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
    return Factors(rows, order)


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


@dataclass(frozen=True)
class ComplexFactors:
    """The same of a complex matrix, real and imaginary parts apart."""

    real: Matrix
    imaginary: Matrix
    order: list[int]

    def solve(self, real: Vector, imaginary: Vector) -> tuple[Vector, Vector]:
        """Solve for a right-hand side; returns the real and the imaginary parts."""
        a, b = [real[i] for i in self.order], [imaginary[i] for i in self.order]
        n = len(a)
        for i in range(n):
            self._less(a, b, i, range(i))
        for i in range(n - 1, -1, -1):
            self._less(a, b, i, range(i + 1, n))
            c, d = self.real[i][i], self.imaginary[i][i]
            a[i], b[i] = c * a[i] - d * b[i], c * b[i] + d * a[i]
        return a, b

    def _less(self, a: Vector, b: Vector, i: int, others: range) -> None:
        """Take the products of row i with what is known off its right-hand side."""
        for j in others:
            c, d = self.real[i][j], self.imaginary[i][j]
            a[i] = a[i] - (c * a[j] - d * b[j])
            b[i] = b[i] - (c * b[j] + d * a[j])


def factored_complex(
    real: Matrix, imaginary: Matrix, scales: Sequence[Number] | None = None, groups: Sequence[int] | None = None
) -> ComplexFactors:
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
    return ComplexFactors(re, im, order)
