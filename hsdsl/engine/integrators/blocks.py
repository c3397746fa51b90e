"""Systems of linear equations of states and their derivatives, solved by the factors of the states' own matrix.

The matrix has the same block for the states and for each column of derivatives, and below the first one how these vary
with the states. So a solution is one of the states, then one for each column. What does not flow stays as it is.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from hsdsl.base.graphs import Variation
from hsdsl.base.numbers.arithmetic import Number
from hsdsl.engine.integrators.linear import ComplexFactors, Factors, Matrix, Vector
from hsdsl.engine.integrators.sparse import ComplexSparseFactors, SparseFactors


@dataclass(frozen=True)
class _Blocks:
    """What a column's right-hand sides have of the states' changes: h times the derivatives ``of.links``."""

    of: Variation
    linked: Vector

    def _linked(self, right: Vector, own: Vector) -> Vector:
        """Right-hand sides with what the changes of the states add."""
        found = list(right)
        for i, j, d in zip(self.of.linked, self.of.linking, self.linked, strict=True):
            found[i] = found[i] + d * own[j]
        return found

    def _ranges(self) -> Iterable[tuple[range, list[int]]]:
        """Where each column is, and which states it has derivatives of."""
        of = self.of
        for begin, end in zip(of.columns, of.columns[1:], strict=False):
            yield range(begin, end), of.rows[begin - of.own : end - of.own]

    def _spread(self, values: Vector, rows: list[int]) -> Vector:
        """The right-hand side of a column, zero for derivatives that it does not have."""
        spread = [values[0] * 0] * self.of.own
        for row, value in zip(rows, values, strict=True):
            spread[row] = value
        return spread


@dataclass(frozen=True)
class BlockFactors(_Blocks):
    """A real matrix of this kind."""

    factors: Factors | SparseFactors

    def solve(self, right: Vector) -> Vector:
        """Solve for a right-hand side."""
        return self.solve_columns(self.factors.solve(right[: self.of.own]), right)

    def solve_columns(self, own: Vector, right: Vector) -> Vector:
        """Solve for the columns, where the solution for the states is known."""
        rest, found = self._linked(right, own), [*own, *(r * 0 for r in right[self.of.own :])]
        for places, rows in self._ranges():
            column = self.factors.solve(self._spread([rest[i] for i in places], rows))
            for i, row in zip(places, rows, strict=True):
                found[i] = column[row]
        return found


@dataclass(frozen=True)
class ComplexBlockFactors(_Blocks):
    """The same of a complex matrix, real and imaginary parts apart."""

    factors: ComplexFactors | ComplexSparseFactors

    def solve(self, real: Vector, imaginary: Vector) -> tuple[Vector, Vector]:
        """Solve for a right-hand side; returns the real and the imaginary parts."""
        n = self.of.own
        own = self.factors.solve(real[:n], imaginary[:n])
        rest = [self._linked(part, a) for part, a in zip((real, imaginary), own, strict=True)]
        a, b = ([*known, *(r * 0 for r in real[n:])] for known in own)
        for places, rows in self._ranges():
            column = self.factors.solve(*(self._spread([part[i] for i in places], rows) for part in rest))
            for i, row in zip(places, rows, strict=True):
                a[i], b[i] = column[0][row], column[1][row]
        return a, b


def linked(of: Variation, h: Number, rows: Matrix) -> Vector:
    """What a column's right-hand sides have of the changes of the states."""
    return [h * rows[i][j] for i, j in zip(of.linked, of.linking, strict=True)]
