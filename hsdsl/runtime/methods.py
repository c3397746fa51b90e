"""Methods and interpolations as the runtime takes them: numbers instead of fractions, rows without their zeros."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from ctypes import c_double, c_int
from fractions import Fraction
from functools import cache
from typing import Any

from hsdsl.arithmetic import FLOAT64
from hsdsl.integrators import ButcherTableau, Method
from hsdsl.runtime import structures
from hsdsl.runtime.structures import address


def interpolation_table(
    nodes: Sequence[float], tests: Sequence[float], matrix: Sequence[Sequence[float]], share: float
) -> Any:
    """Write an interpolation as the runtime takes it."""
    columns = (nodes, tests, [number for line in matrix for number in line])
    numbers = (address((c_double * len(column))(*column)) for column in columns)
    return structures.Interpolation(len(nodes) - 1, *numbers, share)


@cache
def method_table(method: Method) -> Any:
    """Write a method as the runtime takes it."""
    if method.kind == "table":
        return _butcher_table(method)
    return structures.Method(
        kind=structures.METHOD_KINDS.index(method.kind),
        order=method.error_order,
        interpolant=structures.INTERPOLANTS.index("dense"),
        degree=method.degree,
        collocation=address(ctypes.pointer(_collocation())) if method.implicit else None,
    )


def _collocation() -> Any:
    """Write the coefficients of Radau IIA."""
    from hsdsl.integrators.collocation import coefficients  # most runs need none

    known = coefficients(FLOAT64)

    def square(rows: Sequence[Sequence[float]]) -> Any:
        return (c_double * 3 * 3)(*((c_double * 3)(*row) for row in rows))

    return structures.Collocation(
        (c_double * 3)(*known.nodes),
        square(known.powers),
        known.gamma,
        known.alpha,
        known.beta,
        square(known.mix),
        square(known.unmix),
        (c_double * 3)(*known.estimate),
        known.share,
        (c_double * 3)(*known.values),
        (c_double * 3)(*known.slope),
    )


def _butcher_table(table: ButcherTableau) -> Any:
    """Write a tableau: numbers instead of fractions, rows without their zeros."""
    stages = table.stages - table.last_is_next
    end: tuple[Fraction, ...] = ()
    rows = (*table.a[:stages], end, *table.extra)  # the flow at the step's end is between them
    dense = tuple(zip(*table.dense, strict=True)) if table.dense else ()
    return structures.Method(
        kind=structures.METHOD_KINDS.index(table.kind),
        stages=stages,
        extra=len(table.extra),
        order=table.order,
        interpolant=structures.INTERPOLANTS.index(table.interpolant),
        degree=table.degree,
        c=address((c_double * len(rows))(*(_node(table, row) for row in rows))),
        a=address((structures.Row * len(rows))(*map(_row, rows))),
        b=_row(table.b),
        error=_row(_difference(table.b, table.embedded)),
        coarse=_row(_difference(table.b, table.coarse)),
        dense=address((structures.Row * max(1, len(dense)))(*map(_row, dense))),
        gain=float(sum(map(abs, table.b))),
    )


def _node(table: ButcherTableau, row: Sequence[Fraction]) -> float:
    node = sum(row, Fraction(0))
    at_end = abs(node - 1) <= (0 if table.digits is None else Fraction(1, 10**table.digits))
    return 1.0 if at_end else FLOAT64.constant(node)


def _difference(b: Sequence[Fraction], other: Sequence[Fraction] | None) -> Sequence[Fraction]:
    return () if other is None else [v - w for v, w in zip(b, other, strict=True)]


def _row(weights: Sequence[Fraction]) -> Any:
    terms = [(i, FLOAT64.constant(w)) for i, w in enumerate(weights) if w]
    count = max(1, len(terms))
    stages, numbers = (c_int * count)(*(i for i, _ in terms)), (c_double * count)(*(w for _, w in terms))
    return structures.Row(len(terms), address(stages), address(numbers))
