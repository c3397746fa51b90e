"""The pattern of a sparse elimination: which entries the factors of c I - h J have, for the places of J's entries.

Rows and columns are taken in one order, pivots are the diagonal ones, and the pattern is symmetric: the matrices of an
implicit step tend to a multiple of the identity as the step becomes short. See T. A. Davis, Direct Methods for Sparse
Linear Systems, SIAM 2006, Ch. 4 (doi:10.1137/1.9780898718881).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import accumulate


@dataclass(frozen=True)
class Elimination:
    """Entries of the factors, row by row, rows and columns numbered in the order of elimination.

    Attributes
    ----------
    order : list of int
        The unknown of each row.
    start, column, diagonal : list of int
        Row i has the entries from ``start[i]`` to ``start[i + 1]``, in these columns, which go up; ``diagonal[i]`` is
        the one of its own.
    place : list of int
        For each entry of J the entry of the factors where it goes.
    own : list of int
        For each unknown which entry of J is the derivative of its flow by itself, -1 for none.
    """

    order: list[int]
    start: list[int]
    column: list[int]
    diagonal: list[int]
    place: list[int]
    own: list[int]

    @property
    def size(self) -> int:
        """How many entries the factors have."""
        return len(self.column)


@lru_cache(maxsize=64)
def elimination(places: tuple[int, ...], order: tuple[int, ...]) -> Elimination:
    """The pattern for entries of J at ``places`` of its n * n, row by row, and unknowns in an order."""
    n = len(order)
    position = [0] * n
    for i, unknown in enumerate(order):
        position[unknown] = i
    above = _above([(position[k // n], position[k % n]) for k in places], n)
    below: list[list[int]] = [[] for _ in range(n)]
    for k, columns in enumerate(above):
        for i in columns:
            below[i].append(k)
    rows = [[*below[i], i, *sorted(above[i])] for i in range(n)]
    start = [0, *accumulate(map(len, rows))]
    where = [{column: start[i] + at for at, column in enumerate(row)} for i, row in enumerate(rows)]
    own = [-1] * n
    for index, k in enumerate(places):
        if k // n == k % n:
            own[k // n] = index
    return Elimination(
        order=list(order),
        start=start,
        column=[column for row in rows for column in row],
        diagonal=[where[i][i] for i in range(n)],
        place=[where[position[k // n]][position[k % n]] for k in places],
        own=own,
    )


def filled(places: Sequence[tuple[int, int]], n: int) -> int:
    """How many entries the factors have, for entries at these rows and columns."""
    return n + 2 * sum(map(len, _above(places, n)))


def _above(places: Sequence[tuple[int, int]], n: int) -> list[set[int]]:
    """The columns behind the diagonal of each row: what a row leaves goes on to the first row that it has."""
    above: list[set[int]] = [set() for _ in range(n)]
    for i, j in places:
        if i != j:
            above[min(i, j)].add(max(i, j))
    for k in range(n):
        if above[k]:
            parent = min(above[k])
            above[parent] |= above[k] - {parent}
    return above
