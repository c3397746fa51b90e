# pyright: basic
"""The order in which the equations of an implicit step are eliminated, for systems that are large and sparse."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from hsdsl.sparsity import filled

LEAST = 16  # unknowns: of fewer the dense elimination, which exchanges rows, is as fast
SPARSE = 4  # the dense factors have at least so many times as many entries


def ordering(places: Sequence[int], n: int) -> tuple[int, ...]:
    """The order with the fewest entries of the factors among some; empty where the dense elimination is used.

    States that do not flow cost the dense elimination as much as others, and the sparse one nothing.
    """
    flowing = len({k // n for k in places})
    if not flowing or (n < LEAST and 2 * flowing > n) or SPARSE * len(places) > n * n:
        return ()
    fills = {order: filled(_moved(places, order), n) for order in _orders(places, n)}
    best = min(fills, key=fills.__getitem__)
    return best if SPARSE * fills[best] <= n * n else ()


def _moved(places: Sequence[int], order: Sequence[int]) -> list[tuple[int, int]]:
    n, position = len(order), {k: i for i, k in enumerate(order)}
    return [(position[k // n], position[k % n]) for k in places]


def _orders(places: Sequence[int], n: int) -> Iterator[tuple[int, ...]]:
    """Orders of minimum degree and of small bandwidth; SuperLU gives the first as a permutation or its inverse.

    For few unknowns it is the written one and its reverse: to load SciPy would cost more than another order saves.
    """
    if n < LEAST:
        yield from (tuple(range(n)), tuple(reversed(range(n))))
        return
    import numpy as np
    from scipy.sparse import csc_matrix, eye
    from scipy.sparse.csgraph import reverse_cuthill_mckee
    from scipy.sparse.linalg import splu

    rows, columns = np.divmod(np.array(places, int), n)
    pattern = csc_matrix((np.ones(len(places)), (rows, columns)), shape=(n, n))
    both = csc_matrix(pattern + pattern.T + 4 * n * eye(n))
    minimum = splu(both, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True}).perm_c
    for order in (minimum, np.argsort(minimum), reverse_cuthill_mckee(both, symmetric_mode=True)):
        yield tuple(map(int, order))
