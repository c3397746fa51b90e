"""Runge-Kutta methods as tables of exact fractions that check themselves at birth.

The order conditions (one for each rooted tree, Hairer, Norsett, Wanner, *Solving Ordinary Differential Equations I*,
II.2, doi:10.1007/978-3-540-78862-1) are evaluated in exact arithmetic, for the method, its embedded method and its
dense output. A wrong digit does not survive import.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction
from functools import cache
from itertools import combinations_with_replacement
from math import prod
from typing import Literal

Vector = tuple[Fraction, ...]
Tree = tuple["Tree", ...]  # a rooted tree is the multiset of its root's subtrees


def fractions(text: str) -> Vector:
    """Read a row of a table: fractions between blanks."""
    return tuple(Fraction(word) for word in text.split())


@dataclass(frozen=True, eq=False)
class ButcherTableau:
    """An explicit Runge-Kutta method.

    Attributes
    ----------
    name, title : str
        Short name for models and the command line; a line for people.
    order : int
        Order of ``b``, checked up to order 5.
    a : tuple of Vector
        Strictly lower triangle: row i has i entries.
    b : Vector
        Weights, one a stage.
    embedded : Vector or None
        Weights of the embedded method, of order ``order - 1``; with it the method is adaptive.
    dense : tuple of Vector or None
        Row i are the coefficients of s, s**2, ... in the weight b_i(s) of the dense output.
    dense_order : int
        Order of the dense output, checked.
    source : str
        Where the table comes from.

    Raises
    ------
    ValueError
        The shapes disagree or an order condition fails.
    """

    name: str
    title: str
    order: int
    a: tuple[Vector, ...]
    b: Vector
    source: str
    embedded: Vector | None = None
    dense: tuple[Vector, ...] | None = None
    dense_order: int = 0

    def __post_init__(self) -> None:
        if [len(row) for row in self.a] != list(range(self.stages)):
            raise ValueError(f"{self.name}: a must be a strictly lower triangle of {self.stages} rows")
        self._check("b", (self.b,), self.order)
        if self.embedded is not None:
            self._check("embedded", (self.embedded,), self.order - 1)
        if self.dense is not None:
            self._check("dense", tuple(zip(*self.dense, strict=True)), self.dense_order)

    def _check(self, what: str, powers: tuple[Vector, ...], order: int) -> None:
        """Check weights sum_m s**m powers[m-1]: at s = 1 alone if there is one power, else for every s."""
        if any(len(row) != self.stages for row in powers):
            raise ValueError(f"{self.name}: {what} must have {self.stages} weights")
        for size in range(1, order + 1):
            for tree in trees(size):
                weights = self.elementary_weights(tree)
                for m, row in enumerate(powers, 1):
                    wanted = Fraction(1, density(tree)) if len(powers) == 1 or m == size else Fraction(0)
                    if sum(w * g for w, g in zip(row, weights, strict=True)) != wanted:
                        raise ValueError(f"{self.name}: {what} fails the order condition of tree {tree}")

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
        """What stands between the samples: no curve may be of lower order than the method's global error."""
        if self.dense is not None:
            return "dense"
        return "hermite" if self.order > 2 else "secant"

    def elementary_weights(self, tree: Tree) -> Vector:
        """Evaluate the product over subtrees of sum_k a_ik g_k, for each stage i."""
        below = [self.elementary_weights(subtree) for subtree in tree]

        def weighted(row: Vector, values: Vector) -> Fraction:
            return sum((a * g for a, g in zip(row, values, strict=False)), Fraction(0))

        return tuple(prod((weighted(row, values) for values in below), start=Fraction(1)) for row in self.a)


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
