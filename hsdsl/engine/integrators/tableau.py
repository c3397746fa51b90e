"""Runge-Kutta methods as tables of exact fractions that check themselves at birth.

The order conditions (one for each rooted tree, Hairer, Norsett, Wanner, *Solving Ordinary Differential Equations I*,
II.2, doi:10.1007/978-3-540-78862-1) are evaluated in exact arithmetic, for the method, its embedded method and its
dense output. A wrong digit does not survive the loading of its file. A table whose coefficients are known as decimals
only says to how many digits its conditions hold; it is checked to those. `table_numbers` writes one in float64, rows
without their zeros, as programs in other languages take it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from decimal import Context, Decimal, localcontext
from fractions import Fraction
from functools import cache
from itertools import combinations_with_replacement
from math import lcm, prod
from typing import Any, ClassVar, Literal, NamedTuple

from hsdsl.base.numbers.arithmetic import FLOAT64, Arithmetic, Number

Vector = tuple[Fraction, ...]
Tree = tuple["Tree", ...]  # a rooted tree is the multiset of its root's subtrees


def fractions(text: str) -> Vector:
    """Read a row of a table: fractions or decimals between blanks."""
    return tuple(Fraction(word) for word in text.split())


@dataclass(frozen=True, eq=False)
class ButcherTableau:
    """An explicit Runge-Kutta method.

    Attributes
    ----------
    name, title : str
        Short name for models and the command line; a line for people.
    order : int
        Order of ``b``, checked.
    a : tuple of Vector
        Strictly lower triangle: row i has i entries.
    b : Vector
        Weights, one a stage.
    embedded : Vector or None
        Weights of the embedded method; with it the method is adaptive.
    embedded_order : int
        Order of the embedded method, checked; 0 means ``order - 1``.
    coarse : Vector or None
        Weights of a second embedded method, two orders below the first. With e and c the differences of the two to the
        method, the error estimate is then e**2 / sqrt(e**2 + c**2 / 100), of order ``order``.
    dense : tuple of Vector or None
        Row i are the coefficients of s, s**2, ... in the weight b_i(s) of the dense output.
    dense_order : int
        Order of the dense output, checked.
    extra : tuple of Vector
        Further rows of a, for stages that the dense output alone uses. Before them is the flow at the step's end,
        so the first has one entry more than there are stages.
    digits : int or None
        Decimal digits to which the conditions hold; None for exact fractions.
    source : str
        Where the table comes from.

    Raises ValueError: the shapes disagree or an order condition fails.
    """

    name: str
    title: str
    order: int
    a: tuple[Vector, ...]
    b: Vector
    source: str
    embedded: Vector | None = None
    embedded_order: int = 0
    coarse: Vector | None = None
    dense: tuple[Vector, ...] | None = None
    dense_order: int = 0
    extra: tuple[Vector, ...] = ()
    digits: int | None = None

    def __post_init__(self) -> None:
        if [len(row) for row in self.rows] != list(range(len(self.rows))):
            raise ValueError(f"{self.name}: a must be a strictly lower triangle of {self.stages} rows")
        with localcontext(Context(prec=(self.digits or 0) + 20)):
            weights = _Weights(self.rows, self.digits)
            self._check("b", (self.b,), self.order, weights)
            if self.embedded is not None:
                self._check("embedded", (self.embedded,), self.estimated_order, weights)
            if self.coarse is not None:
                self._check("coarse", (self.coarse,), self.estimated_order - 2, weights)
            if self.dense is not None:
                self._check("dense", tuple(zip(*self.dense, strict=True)), self.dense_order, weights)

    def __str__(self) -> str:
        return self.name

    def places(
        self, flow: Callable[..., Sequence[Any]], t: Any, x: Sequence[Any], h: Any
    ) -> Iterator[tuple[Any, tuple[Any, ...]]]:
        """The times and states at which a step evaluates the flow, up to round-off; each is given before it does."""
        slopes: list[Sequence[Any]] = []
        for row in self.a:
            weights = [float(w) for w in row]
            moved = [sum(w * k[i] for w, k in zip(weights, slopes, strict=True)) for i in range(len(x))]
            place = t + h * sum(weights), tuple(a + h * d for a, d in zip(x, moved, strict=True))
            yield place
            slopes.append(flow(place[0], *place[1]))

    def _check(self, what: str, powers: tuple[Vector, ...], order: int, weights: _Weights) -> None:
        """Check weights sum_m s**m powers[m-1]: at s = 1 alone if there is one power, else for every s."""
        if any(len(row) != (self.stages if len(powers) == 1 else len(self.rows)) for row in powers):
            raise ValueError(f"{self.name}: {what} must have {self.stages} weights")
        rows = [weights.numbers(row) for row in powers]
        for size in range(1, order + 1):
            for tree in trees(size):
                for m, row in enumerate(rows, 1):
                    expected = Fraction(1, density(tree)) if len(powers) == 1 or m == size else Fraction(0)
                    if not weights.satisfy(row, tree, expected):
                        raise ValueError(f"{self.name}: {what} fails the order condition of tree {tree}")

    kind: ClassVar[Literal["table"]] = "table"
    implicit: ClassVar[bool] = False
    is_series: ClassVar[bool] = False

    def for_tolerance(self, tolerance: Number | None, arithmetic: Arithmetic) -> ButcherTableau:
        """Return the method for a tolerance: itself."""
        return self

    @property
    def rows(self) -> tuple[Vector, ...]:
        """All rows of a: of the stages, then of the dense output."""
        return (*self.a, self.b, *self.extra) if self.extra else self.a

    @property
    def estimated_order(self) -> int:
        """Order of the embedded method."""
        return self.embedded_order or self.order - 1

    @property
    def error_order(self) -> int:
        """The power of h that the error estimate falls with."""
        return self.order

    @property
    def stages(self) -> int:
        """Number of stages."""
        return len(self.b)

    @property
    def c(self) -> Vector:
        """Nodes: the row sums of ``a``."""
        return tuple(sum(row, Fraction(0)) for row in self.a)

    @property
    def adaptive(self) -> bool:
        """Whether the method estimates its own error."""
        return self.embedded is not None

    @property
    def last_is_next(self) -> bool:
        """Whether the last stage is the flow at the step's end (first same as last)."""
        return (*self.a[-1], Fraction(0)) == self.b

    @property
    def interpolant(self) -> Literal["secant", "hermite", "dense"]:
        """The curve between the samples: none may be of lower order than the method's global error."""
        if self.dense is not None:
            return "dense"
        return "hermite" if self.order > 2 else "secant"

    @property
    def degree(self) -> int:
        """Degree of the interpolant in s; 0 for the straight line, which needs no coefficients."""
        if self.dense is not None:
            return len(self.dense[0])
        return 3 if self.order > 2 else 0


class _Weights:
    """The elementary weights of rooted trees, in integers or in decimals with guard digits.

    Integers are rows times a common denominator, several times as fast as fractions; so a tree's weights are theirs
    times that denominator for each of its nodes but the root.
    """

    def __init__(self, rows: tuple[Vector, ...], digits: int | None) -> None:
        self._digits = digits
        self._scale = lcm(*(weight.denominator for row in rows for weight in row)) if digits is None else 1
        self._rows = tuple(self.numbers(row) for row in rows)
        self._known: dict[Tree, tuple[Any, ...]] = {}

    def satisfy(self, row: tuple[Any, ...], tree: Tree, expected: Fraction) -> bool:
        """Whether sum_i row_i g_i(tree) is the expected number."""
        total = sum(w * g for w, g in zip(row, self._of(tree), strict=False))
        if self._digits is None:
            return total == expected * self._scale ** nodes(tree)
        return abs(total - self._number(expected)) <= Decimal(10) ** -self._digits

    def _of(self, tree: Tree) -> tuple[Any, ...]:
        """Evaluate the product over subtrees of sum_k a_ik g_k, for each stage i."""
        if tree not in self._known:
            below = [self._of(subtree) for subtree in tree]
            sums = [[sum(a * g for a, g in zip(row, v, strict=False)) for v in below] for row in self._rows]
            self._known[tree] = tuple(map(prod, sums))
        return self._known[tree]

    def _number(self, value: Fraction) -> Any:
        if self._digits is not None:
            return Decimal(value.numerator) / Decimal(value.denominator)
        scaled = value * self._scale
        return scaled.numerator if scaled.denominator == 1 else scaled

    def numbers(self, row: Vector) -> tuple[Any, ...]:
        """Convert a row to the kind of number that is computed with."""
        return tuple(map(self._number, row))


@cache
def trees(size: int) -> tuple[Tree, ...]:
    """All rooted trees of ``size`` nodes (1, 1, 2, 4, 9, ... of them)."""
    return tuple(sorted(set(_forests(size - 1, size - 1)), key=repr))


def _forests(size: int, largest: int) -> Iterator[Tree]:
    """Multisets of trees with ``size`` nodes together and none of more than ``largest``."""
    if size == 0:
        yield ()
    for root in range(min(size, largest), 0, -1):
        for count in range(size // root, 0, -1):
            for rest in _forests(size - count * root, root - 1):
                for chosen in combinations_with_replacement(trees(root), count):
                    yield (*chosen, *rest)


def nodes(tree: Tree) -> int:
    """Count a tree's nodes."""
    return 1 + sum(nodes(subtree) for subtree in tree)


def density(tree: Tree) -> int:
    """The density gamma(tree): its order condition is sum_i b_i g_i = 1/gamma."""
    return nodes(tree) * prod(density(subtree) for subtree in tree)


Row = tuple[tuple[int, float], ...]  # stages and their weights


class TableNumbers(NamedTuple):
    """A method with ``stages`` stages to evaluate in a step.

    Stage number ``stages`` is the flow at the step's end; those after it are evaluated for the dense output alone.
    ``nodes`` and ``a`` have a row for each of them; that of the flow at the end is empty. ``error`` has the weights
    less those of the embedded method, ``coarse`` less those of a second one, ``dense`` those of the powers of s.
    """

    stages: int
    extra: int
    nodes: tuple[float, ...]
    a: tuple[Row, ...]
    b: Row
    error: Row
    coarse: Row
    dense: tuple[Row, ...]


def table_numbers(table: ButcherTableau) -> TableNumbers:
    """Write a tableau in numbers."""
    stages = table.stages - table.last_is_next
    end: tuple[Fraction, ...] = ()
    rows = (*table.a[:stages], end, *table.extra)  # the flow at the step's end is between them
    return TableNumbers(
        stages=stages,
        extra=len(table.extra),
        nodes=tuple(_node(table, row) for row in rows),
        a=tuple(map(_row, rows)),
        b=_row(table.b),
        error=_row(_difference(table.b, table.embedded)),
        coarse=_row(_difference(table.b, table.coarse)),
        dense=tuple(map(_row, zip(*table.dense, strict=True))) if table.dense else (),
    )


def _node(table: ButcherTableau, row: Sequence[Fraction]) -> float:
    node = sum(row, Fraction(0))
    at_end = abs(node - 1) <= (0 if table.digits is None else Fraction(1, 10**table.digits))
    return 1.0 if at_end else FLOAT64.constant(node)


def _difference(b: Sequence[Fraction], other: Sequence[Fraction] | None) -> Sequence[Fraction]:
    return () if other is None else [v - w for v, w in zip(b, other, strict=True)]


def _row(weights: Sequence[Fraction]) -> Row:
    return tuple((i, FLOAT64.constant(w)) for i, w in enumerate(weights) if w)
