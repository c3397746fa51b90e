"""The order in which the equations of an implicit step are eliminated, for systems that are large and sparse."""

from __future__ import annotations

from collections.abc import Sequence
from heapq import heapify, heappop, heappush

from hsdsl.base.graphs import filled

LEAST = 16  # unknowns: of fewer the dense elimination, which exchanges rows, is as fast
SPARSE = 4  # the dense factors have at least so many times as many entries


def ordering(places: Sequence[int], n: int) -> tuple[int, ...]:
    """An order with few entries of the factors; empty where the dense elimination is used.

    States that do not flow cost the dense elimination as much as others, and the sparse one nothing.
    """
    flowing = len({k // n for k in places})
    if not flowing or (n < LEAST and 2 * flowing > n) or SPARSE * len(places) > n * n:
        return ()
    order = _minimum_degree(places, n)
    position = {k: i for i, k in enumerate(order)}
    fill = filled([(position[k // n], position[k % n]) for k in places], n)
    return order if SPARSE * fill <= n * n else ()


def _minimum_degree(places: Sequence[int], n: int) -> tuple[int, ...]:
    """The order that takes an unknown with the fewest neighbours next; all that it leaves are then neighbours.

    Of several it takes the one behind the fewest others in turn, for all of which a processor must wait.
    See A. George and J. W. H. Liu, The evolution of the minimum degree ordering algorithm, SIAM Review 31, 1989
    (doi:10.1137/1031001).
    """
    near: list[set[int]] = [set() for _ in range(n)]
    for i, j in (divmod(k, n) for k in places):
        if i != j:
            near[i].add(j)
            near[j].add(i)
    waiting = [(len(others), 0, i) for i, others in enumerate(near)]
    heapify(waiting)
    behind = [0] * n
    order = dict[int, None]()
    while waiting:
        degree, _, i = heappop(waiting)
        if i in order or degree != len(near[i]):  # it has lost or won neighbours since
            continue
        order[i] = None
        for j in near[i]:
            near[j] |= near[i]
            near[j] -= {i, j}
            behind[j] = max(behind[j], behind[i] + 1)
            heappush(waiting, (len(near[j]), behind[j], j))
    return tuple(order)
