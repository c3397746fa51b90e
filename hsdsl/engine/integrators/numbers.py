"""Tables of explicit methods in float64: rows without their zeros, as programs in other languages take them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

from hsdsl.base.numbers.arithmetic import FLOAT64
from hsdsl.engine.integrators.tableau import ButcherTableau

Row = tuple[tuple[int, float], ...]  # stages and their weights


@dataclass(frozen=True)
class TableNumbers:
    """A method with ``stages`` stages to evaluate in a step.

    Stage number ``stages`` is the flow at the step's end; those behind it are evaluated for the dense output alone.
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
