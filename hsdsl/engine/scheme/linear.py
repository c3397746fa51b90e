"""Systems of linear equations: dense, sparse, and of states with derivatives of them.

Dense LU has partial pivoting: a pivot is the largest number of its column relative to the scale of its row's unknown,
so that it does not depend on the units of the unknowns. Sparse LU keeps to a pattern known before and to the pivots of
the diagonal: a step whose matrix has none is too long, as one whose iteration does not converge. A matrix of states and
derivatives has the same block for the states and for each column of derivatives, and below the first one how these
vary with the states: a solution is one of the states, then one for each column. Complex numbers are pairs of real ones.
"""

from __future__ import annotations

from dataclasses import dataclass

from hsdsl.base.graphs import Elimination, Variation
from hsdsl.base.numbers.arithmetic import Number
from hsdsl.engine.scheme.primitives import IndexRoom, Indices, Room, Vector, inline


@dataclass(frozen=True)
class Blocks:
    """What a step solves for: ``n`` of ``width`` states that flow, of which the ``own`` ones have a matrix.

    Where the states are ``varied`` the others are derivatives of these, in columns; ``whole`` says that each column has
    derivatives of all own states. The own matrix is dense or has a ``pattern``. The flow has ``entries`` derivatives
    that are not zero, at ``places`` of width * width, row by row; the first ``inside`` are those of the own matrix.
    """

    n: int
    own: int
    width: int
    entries: int
    inside: int
    places: Indices
    varied: Variation | None
    pattern: Elimination | None
    whole: bool


def is_larger(a: Number, of_a: Number, b: Number, of_b: Number) -> bool:
    """Return whether a is larger than b, each relative to the scale of its row's unknown; without scales, than 0."""
    return a * of_b > b * of_a if of_a > 0 and of_b > 0 else b == 0 and a > 0


@inline
def exchange_rows(a: Room, n: int, i: int, k: int) -> None:
    """Exchange two rows of a matrix."""
    for j in range(n):
        kept = a[i * n + j]
        a[i * n + j] = a[k * n + j]
        a[k * n + j] = kept


@inline
def exchange_places(order: IndexRoom, i: int, k: int) -> None:
    """Exchange two places of an order."""
    kept = order[i]
    order[i] = order[k]
    order[k] = kept


@inline
def factored(n: int, a: Room, order: IndexRoom, scales: Vector, of: Variation | None) -> bool:
    """Factor a square matrix in place, inverse pivots on its diagonal; return whether it has an inverse.

    Its rows, as its columns, belong to unknowns of these scales. Of varied states only rows of one group exchange
    places.
    """
    for i in range(n):
        order[i] = i
    for k in range(n):
        pivot = k
        for i in range(k + 1, n):
            if (of is None or of.groups[i] == of.groups[k]) and is_larger(
                abs(a[i * n + k]), scales[order[i]], abs(a[pivot * n + k]), scales[order[pivot]]
            ):
                pivot = i
        if pivot != k:
            exchange_rows(a, n, k, pivot)
            exchange_places(order, k, pivot)
        if not abs(a[k * n + k]) > 0:
            return False
        a[k * n + k] = 1 / a[k * n + k]
        for i in range(k + 1, n):
            if a[i * n + k] != 0:
                share = a[i * n + k] * a[k * n + k]
                a[i * n + k] = share
                for j in range(k + 1, n):
                    a[i * n + j] = a[i * n + j] - share * a[k * n + j]
    return True


@inline
def solve(n: int, a: Vector, order: Indices, right: Vector, found: Room) -> None:
    """Solve for a right-hand side: below the diagonal is L (its diagonal is 1), above it U."""
    for i in range(n):
        left = right[order[i]]
        for j in range(i):
            left = left - a[i * n + j] * found[j]
        found[i] = left
    for i in range(n - 1, -1, -1):
        left = found[i]
        for j in range(i + 1, n):
            left = left - a[i * n + j] * found[j]
        found[i] = left * a[i * n + i]


@inline
def factored_complex(n: int, re: Room, im: Room, order: IndexRoom, scales: Vector, of: Variation | None) -> bool:
    """Factor a complex matrix as `factored` does; the size of a pivot is the sum of the sizes of its two parts."""
    for i in range(n):
        order[i] = i
    for k in range(n):
        pivot = k
        for i in range(k + 1, n):
            if (of is None or of.groups[i] == of.groups[k]) and is_larger(
                abs(re[i * n + k]) + abs(im[i * n + k]),
                scales[order[i]],
                abs(re[pivot * n + k]) + abs(im[pivot * n + k]),
                scales[order[pivot]],
            ):
                pivot = i
        if pivot != k:
            exchange_rows(re, n, k, pivot)
            exchange_rows(im, n, k, pivot)
            exchange_places(order, k, pivot)
        size = re[k * n + k] * re[k * n + k] + im[k * n + k] * im[k * n + k]
        if not size > 0:
            return False
        c, d = re[k * n + k] / size, -im[k * n + k] / size
        re[k * n + k] = c
        im[k * n + k] = d
        for i in range(k + 1, n):
            a, b = re[i * n + k], im[i * n + k]
            if not (a == 0 and b == 0):
                p, q = c * a - d * b, c * b + d * a
                re[i * n + k] = p
                im[i * n + k] = q
                for j in range(k + 1, n):
                    u, v = re[k * n + j], im[k * n + j]
                    re[i * n + j] = re[i * n + j] - (p * u - q * v)
                    im[i * n + j] = im[i * n + j] - (p * v + q * u)
    return True


@inline
def solve_complex(
    n: int, re: Vector, im: Vector, order: Indices, real: Vector, imaginary: Vector, a: Room, b: Room
) -> None:
    """Solve for a complex right-hand side: the solution is a + i b."""
    for i in range(n):
        u, v = real[order[i]], imaginary[order[i]]
        for j in range(i):
            c, d, p, q = re[i * n + j], im[i * n + j], a[j], b[j]
            u = u - (c * p - d * q)
            v = v - (c * q + d * p)
        a[i] = u
        b[i] = v
    for i in range(n - 1, -1, -1):
        u, v = a[i], b[i]
        for j in range(i + 1, n):
            c, d, p, q = re[i * n + j], im[i * n + j], a[j], b[j]
            u = u - (c * p - d * q)
            v = v - (c * q + d * p)
        c, d = re[i * n + i], im[i * n + i]
        a[i] = c * u - d * v
        b[i] = c * v + d * u


def sparse_factored(n: int, of: Elimination, a: Room, row: Room) -> bool:
    """Factor a matrix in place, given by all entries of the pattern, inverse pivots on its diagonal.

    Return whether every pivot has an inverse; ``row`` is room for n numbers.
    """
    for i in range(n):
        for at in range(of.start[i], of.start[i + 1]):
            row[of.column[at]] = a[at]
        for at in range(of.start[i], of.diagonal[i]):
            k = of.column[at]
            share = row[k] * a[of.diagonal[k]]
            row[k] = share
            for above in range(of.diagonal[k] + 1, of.start[k + 1]):
                row[of.column[above]] = row[of.column[above]] - share * a[above]
        for at in range(of.start[i], of.start[i + 1]):
            a[at] = row[of.column[at]]
        if not abs(row[i]) > 0:
            return False
        a[of.diagonal[i]] = 1 / row[i]
    return True


def sparse_solve(n: int, of: Elimination, values: Vector, right: Vector, y: Room, found: Room) -> None:
    """Solve for a right-hand side; ``y`` is room for n numbers."""
    for i in range(n):
        left = right[of.order[i]]
        for at in range(of.start[i], of.diagonal[i]):
            left = left - values[at] * y[of.column[at]]
        y[i] = left
    for i in range(n - 1, -1, -1):
        left = y[i]
        for at in range(of.diagonal[i] + 1, of.start[i + 1]):
            left = left - values[at] * y[of.column[at]]
        y[i] = left * values[of.diagonal[i]]
        found[of.order[i]] = y[i]


def sparse_factored_complex(n: int, of: Elimination, re: Room, im: Room, c: Room, d: Room) -> bool:
    """Factor a complex matrix as `sparse_factored` does; c and d are room for n numbers each."""
    for i in range(n):
        for at in range(of.start[i], of.start[i + 1]):
            c[of.column[at]] = re[at]
            d[of.column[at]] = im[at]
        for at in range(of.start[i], of.diagonal[i]):
            k = of.column[at]
            p, q, u, v = c[k], d[k], re[of.diagonal[k]], im[of.diagonal[k]]
            r, s = u * p - v * q, u * q + v * p
            c[k] = r
            d[k] = s
            for above in range(of.diagonal[k] + 1, of.start[k + 1]):
                j = of.column[above]
                c[j] = c[j] - (r * re[above] - s * im[above])
                d[j] = d[j] - (r * im[above] + s * re[above])
        for at in range(of.start[i], of.start[i + 1]):
            re[at] = c[of.column[at]]
            im[at] = d[of.column[at]]
        size = c[i] * c[i] + d[i] * d[i]
        if not size > 0:
            return False
        re[of.diagonal[i]] = c[i] / size
        im[of.diagonal[i]] = -d[i] / size
    return True


def sparse_solve_complex(
    n: int, of: Elimination, re: Vector, im: Vector, real: Vector, imaginary: Vector, a: Room, b: Room, one: Room,
    two: Room,
) -> None:  # fmt: skip
    """Solve for a right-hand side: the solution is ``one`` + i ``two``; a and b are room for n numbers each."""
    for i in range(n):
        u, v = real[of.order[i]], imaginary[of.order[i]]
        for at in range(of.start[i], of.diagonal[i]):
            c, d, p, q = re[at], im[at], a[of.column[at]], b[of.column[at]]
            u = u - (c * p - d * q)
            v = v - (c * q + d * p)
        a[i] = u
        b[i] = v
    for i in range(n - 1, -1, -1):
        u, v = a[i], b[i]
        for at in range(of.diagonal[i] + 1, of.start[i + 1]):
            c, d, p, q = re[at], im[at], a[of.column[at]], b[of.column[at]]
            u = u - (c * p - d * q)
            v = v - (c * q + d * p)
        c, d = re[of.diagonal[i]], im[of.diagonal[i]]
        a[i] = c * u - d * v
        b[i] = c * v + d * u
        one[of.order[i]] = a[i]
        two[of.order[i]] = b[i]


@dataclass
class Factors:
    """Factors of a real matrix and of a complex one, with the ``order`` of their rows.

    Of varied states ``links`` are what right-hand sides of columns have of the changes of the own states. The rest is
    room: ``scratch`` of sparse systems, ``spread`` of columns.
    """

    real: Room
    re: Room
    im: Room
    order: IndexRoom
    turned: IndexRoom
    links: Room
    scratch: list[Room]
    spread: list[Room]


@inline
def solve_own(of: Blocks, by: Factors, right: Vector, found: Room) -> None:
    """Solve for a right-hand side of the own states."""
    pattern = of.pattern
    if pattern is None:
        solve(of.own, by.real, by.order, right, found)
    else:
        sparse_solve(of.own, pattern, by.real, right, by.scratch[0], found)


@inline
def solve_own_complex(of: Blocks, by: Factors, real: Vector, imaginary: Vector, a: Room, b: Room) -> None:
    """Solve for a right-hand side of the own states with the factors of the complex matrix."""
    pattern = of.pattern
    if pattern is None:
        solve_complex(of.own, by.re, by.im, by.turned, real, imaginary, a, b)
    else:
        sparse_solve_complex(of.own, pattern, by.re, by.im, real, imaginary, by.scratch[0], by.scratch[1], a, b)


@inline
def add_links(v: Variation, by: Factors, own: Vector, right: Room) -> None:
    """Add to the right-hand sides of the columns what the changes of the own states contribute."""
    for e in range(v.links):
        right[v.linked[e]] = right[v.linked[e]] + by.links[e] * own[v.linking[e]]


@inline
def spread_column(of: Blocks, v: Variation, k: int, all: Vector, column: Room) -> None:
    """Take a column out as a vector of the own states, zero for derivatives that it does not have."""
    if of.whole:
        for i in range(of.own):
            column[i] = all[(k + 1) * of.own + i]
    else:
        for i in range(of.own):
            column[i] = 0
        for i in range(v.columns[k], v.columns[k + 1]):
            column[v.rows[i - of.own]] = all[i]


@inline
def place_column(of: Blocks, v: Variation, k: int, column: Vector, all: Room) -> None:
    """Put a vector of the own states back as a column; what the column does not have is left out."""
    if of.whole:
        for i in range(of.own):
            all[(k + 1) * of.own + i] = column[i]
    else:
        for i in range(v.columns[k], v.columns[k + 1]):
            all[i] = column[v.rows[i - of.own]]


@inline
def solve_columns(of: Blocks, by: Factors, right: Room, found: Room) -> None:
    """Solve for the columns, where ``found`` has the solution for the own states; the right-hand sides are changed.

    What does not flow stays as it is.
    """
    v = of.varied
    if v is not None:
        add_links(v, by, found, right)
        for k in range(v.count):
            spread_column(of, v, k, right, by.spread[0])
            solve_own(of, by, by.spread[0], by.spread[1])
            place_column(of, v, k, by.spread[1], found)


@inline
def solve_all(of: Blocks, by: Factors, right: Room, found: Room) -> None:
    """Solve for the own states and all columns with the factors of the real matrix."""
    solve_own(of, by, right, found)
    solve_columns(of, by, right, found)


@inline
def solve_all_complex(of: Blocks, by: Factors, real: Room, imaginary: Room, a: Room, b: Room) -> None:
    """Solve for the own states and all columns with the factors of the complex matrix: the solution is a + i b."""
    v = of.varied
    solve_own_complex(of, by, real, imaginary, a, b)
    if v is not None:
        add_links(v, by, a, real)
        add_links(v, by, b, imaginary)
        for k in range(v.count):
            spread_column(of, v, k, real, by.spread[0])
            spread_column(of, v, k, imaginary, by.spread[1])
            solve_own_complex(of, by, by.spread[0], by.spread[1], by.spread[2], by.spread[3])
            place_column(of, v, k, by.spread[2], a)
            place_column(of, v, k, by.spread[3], b)
