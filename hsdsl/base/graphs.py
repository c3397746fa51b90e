"""Directed graphs, and patterns of the matrices c I - h J of implicit steps.

A graph is given by what follows each node: what can be reached, and cycles. Of a matrix there are the entries that its
factors have, and which of its blocks are equal. In a sparse elimination rows and columns are taken in one order, pivots
are the diagonal ones, and the pattern is symmetric: the matrices tend to a multiple of the identity as the step becomes
short. See T. A. Davis, Direct Methods for Sparse Linear Systems, SIAM 2006, Ch. 4 (doi:10.1137/1.9780898718881).
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from graphlib import CycleError, TopologicalSorter
from itertools import accumulate
from typing import TypeVar

T = TypeVar("T", bound=Hashable)


def closure(starts: Iterable[T], following: Callable[[T], Iterable[T]]) -> set[T]:
    """Everything that is reached from some nodes, and they themselves."""
    found: set[T] = set()
    waiting = list(starts)
    while waiting:
        node = waiting.pop()
        if node not in found:
            found.add(node)
            waiting.extend(following(node))
    return found


def cycle(following: Mapping[T, Iterable[T]]) -> list[T] | None:
    """A cycle among the nodes of a mapping: each is followed by the next, the last by the first; None without one."""
    inner = {node: [other for other in others if other in following] for node, others in following.items()}
    try:
        TopologicalSorter(inner).prepare()
    except CycleError as error:
        found: list[T] = error.args[1][:0:-1]  # each is followed by the one before it there, and the last is the first
        at = found.index(min(found, key=list(following).index))
        return found[at:] + found[:at]
    return None


@dataclass(frozen=True)
class Elimination:
    """Entries of the factors, row by row, rows and columns numbered in the order of elimination."""

    size: int  # how many entries there are
    order: list[int]  # the unknown of each row
    start: list[int]  # row i has the entries from start[i] to start[i + 1],
    column: list[int]  # in these columns, which go up;
    diagonal: list[int]  # diagonal[i] is the one of its own
    place: list[int]  # for each entry of J the entry of the factors where it goes


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
    return Elimination(
        size=sum(map(len, rows)),
        order=list(order),
        start=start,
        column=[column for row in rows for column in row],
        diagonal=[where[i][i] for i in range(n)],
        place=[where[position[k // n]][position[k % n]] for k in places],
    )


@dataclass(frozen=True)
class Variation:
    """The blocks of J where states are derivatives of others: x' = f(x), and S' = f_x S + f_p for each column S.

    J is f_x for x and again for each column, next to which it has how f_x S + f_p varies with x. So the factors of
    c I - h f_x serve every column: each is a right-hand side more. What does not flow has no equation.

    ``groups`` are numbers of states of x that depend on each other, where f_x is dense. Rows of one group exchange
    places in an elimination, and no others: what no other group moves stays exactly zero.
    """

    own: int  # how many states x has; they are the first ones
    count: int  # of columns
    columns: list[int]  # where each column begins, and where the last one ends: after it states do not flow
    rows: list[int]  # for each state of a column, from columns[0] on, which state of x it is the derivative of
    entries: int  # how many entries of J are those of f_x for x; they are the first ones
    links: int  # how many derivatives of columns by x there are,
    link: list[int]  # which entries of J they are;
    linked: list[int]  # for each of them which state it is the derivative of,
    linking: list[int]  # and by which
    groups: list[int]
    elimination: Elimination | None  # the pattern for f_x, where it is sparse


@lru_cache(maxsize=64)
def variation(
    places: tuple[int, ...], n: int, own: int, varied: tuple[tuple[int, ...], ...], order: tuple[int, ...]
) -> Variation:
    """The blocks of J with entries at ``places``; ``varied`` has for each column the states of x it has derivatives of.

    ``order`` is that in which f_x is eliminated, empty where it is dense.
    """
    inside = [k for k in places if k // n < own]
    links = [index for index, k in enumerate(places) if k // n >= own > k % n]
    return Variation(
        own=own,
        count=len(varied),
        columns=list(accumulate(map(len, varied), initial=own)),
        rows=[row for column in varied for row in column],
        entries=len(inside),
        links=len(links),
        link=links,
        linked=[places[index] // n for index in links],
        linking=[places[index] % n for index in links],
        groups=[] if order else _groups([(k // n, k % n) for k in inside], own),
        elimination=elimination(tuple(k // n * own + k % n for k in inside), order) if order else None,
    )


def _groups(places: Sequence[tuple[int, int]], n: int) -> list[int]:
    """For each unknown the first one that it depends on, through others or not, and that depends on it."""
    reached = [1 << i for i in range(n)]
    for i, j in places:
        reached[i] |= 1 << j
    for k in range(n):
        for i in range(n):
            if reached[i] >> k & 1:
                reached[i] |= reached[k]
    return [next(j for j in range(n) if reached[i] >> j & reached[j] >> i & 1) for i in range(n)]


def filled(places: Sequence[tuple[int, int]], n: int) -> int:
    """How many entries the factors have, for entries at these rows and columns."""
    return n + 2 * sum(map(len, _above(places, n)))


def _above(places: Sequence[tuple[int, int]], n: int) -> list[set[int]]:
    """The columns right of the diagonal of each row: what a row leaves goes on to the first row that it has."""
    above: list[set[int]] = [set() for _ in range(n)]
    for i, j in places:
        if i != j:
            above[min(i, j)].add(max(i, j))
    for k in range(n):
        if above[k]:
            parent = min(above[k])
            above[parent] |= above[k] - {parent}
    return above
