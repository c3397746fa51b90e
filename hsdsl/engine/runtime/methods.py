"""Methods and interpolations as the runtime takes them: numbers instead of fractions, rows without their zeros."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from ctypes import c_double, c_int
from functools import cache
from typing import Any

from hsdsl.base.numbers.arithmetic import FLOAT64
from hsdsl.engine.integrators import ButcherTableau, Method
from hsdsl.engine.integrators.numbers import Row, table_numbers
from hsdsl.engine.runtime import structures
from hsdsl.engine.runtime.structures import address


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
    from hsdsl.engine.integrators.collocation import coefficients  # most runs need none

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
        (c_double * 3)(*known.end_slope),
    )


def _butcher_table(table: ButcherTableau) -> Any:
    """Write a tableau."""
    numbers = table_numbers(table)
    return structures.Method(
        kind=structures.METHOD_KINDS.index(table.kind),
        stages=numbers.stages,
        extra=numbers.extra,
        order=table.order,
        interpolant=structures.INTERPOLANTS.index(table.interpolant),
        degree=table.degree,
        c=address((c_double * len(numbers.nodes))(*numbers.nodes)),
        a=address((structures.Row * len(numbers.a))(*map(_row, numbers.a))),
        b=_row(numbers.b),
        error=_row(numbers.error),
        coarse=_row(numbers.coarse),
        dense=address((structures.Row * max(1, len(numbers.dense)))(*map(_row, numbers.dense))),
        gain=float(sum(map(abs, table.b))),
    )


def _row(terms: Row) -> Any:
    count = max(1, len(terms))
    stages, weights = (c_int * count)(*(i for i, _ in terms)), (c_double * count)(*(w for _, w in terms))
    return structures.Row(len(terms), address(stages), address(weights))
