"""Systems of linear equations for any number type whose matrix has few entries: LU in a pattern known before.

Pivots are those of the diagonal. The dense factors of `linear` exchange rows; here a step whose matrix has none is
too long, as one whose iteration does not converge. Complex numbers are pairs of real ones, as there.
"""

from __future__ import annotations

from dataclasses import dataclass

from hsdsl.base.graphs import Elimination
from hsdsl.base.numbers.arithmetic import Number
from hsdsl.engine.integrators.linear import Singular, Vector


@dataclass(frozen=True)
class SparseFactors:
    """Factors in a pattern: below the diagonal L (its diagonal is 1), above it U; the diagonal has inverse pivots."""

    of: Elimination
    values: Vector

    def solve(self, right: Vector) -> Vector:
        """Solve for a right-hand side."""
        of, values = self.of, self.values
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


def sparse_factored(of: Elimination, entries: Vector) -> SparseFactors:
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
    return SparseFactors(of, values)


@dataclass(frozen=True)
class ComplexSparseFactors:
    """The same of a complex matrix, real and imaginary parts apart."""

    of: Elimination
    real: Vector
    imaginary: Vector

    def solve(self, real: Vector, imaginary: Vector) -> tuple[Vector, Vector]:
        """Solve for a right-hand side; returns the real and the imaginary parts."""
        of = self.of
        a, b = [real[i] for i in of.order], [imaginary[i] for i in of.order]
        for i in range(len(a)):
            self._less(a, b, i, of.start[i], of.diagonal[i])
        one, two = list(a), list(b)
        for i in range(len(a) - 1, -1, -1):
            self._less(a, b, i, of.diagonal[i] + 1, of.start[i + 1])
            c, d = self.real[of.diagonal[i]], self.imaginary[of.diagonal[i]]
            a[i], b[i] = c * a[i] - d * b[i], c * b[i] + d * a[i]
            one[of.order[i]], two[of.order[i]] = a[i], b[i]
        return one, two

    def _less(self, a: Vector, b: Vector, i: int, first: int, end: int) -> None:
        for at in range(first, end):
            c, d, j = self.real[at], self.imaginary[at], self.of.column[at]
            a[i], b[i] = a[i] - (c * a[j] - d * b[j]), b[i] - (c * b[j] + d * a[j])


def sparse_factored_complex(of: Elimination, real: Vector, imaginary: Vector) -> ComplexSparseFactors:
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
    return ComplexSparseFactors(of, re, im)
