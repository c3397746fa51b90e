"""Systems of linear equations for any number type: dense LU with partial pivoting, for the few states of a mode."""

from __future__ import annotations

from dataclasses import dataclass

from hsdsl.arithmetic import Number

Matrix = list[list[Number]]


class Singular(ValueError):
    """A matrix has no inverse."""


@dataclass(frozen=True)
class Factors:
    """Factors of a matrix with permuted rows: below the diagonal L (its diagonal is 1), on and above it U."""

    rows: Matrix
    order: list[int]

    def solve(self, right: list[Number]) -> list[Number]:
        """Solve for a right-hand side."""
        found = [right[i] for i in self.order]
        for i, row in enumerate(self.rows):
            for j in range(i):
                found[i] = found[i] - row[j] * found[j]
        for i in range(len(found) - 1, -1, -1):
            row = self.rows[i]
            for j in range(i + 1, len(found)):
                found[i] = found[i] - row[j] * found[j]
            found[i] = found[i] / row[i]
        return found


def factored(matrix: Matrix) -> Factors:
    """Factor a square matrix.

    Raises
    ------
    Singular
        A pivot is zero or not a number.
    """
    rows, order = [list(row) for row in matrix], list(range(len(matrix)))
    for k in range(len(rows)):
        pivot = max(range(k, len(rows)), key=lambda i: abs(rows[i][k]))
        rows[k], rows[pivot], order[k], order[pivot] = rows[pivot], rows[k], order[pivot], order[k]
        upper = rows[k]
        if not abs(upper[k]) > 0:
            raise Singular("a matrix without an inverse")
        for row in rows[k + 1 :]:
            if row[k] != 0:
                row[k] = row[k] / upper[k]
                for j in range(k + 1, len(rows)):
                    row[j] = row[j] - row[k] * upper[j]
    return Factors(rows, order)
