"""Methods and interpolations as C initialisers, from the numbers that the runtime is given."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from typing import Any

from hsdsl.base.numbers.arithmetic import Number
from hsdsl.engine.backends.c.printer import constant
from hsdsl.engine.runtime import structures
from hsdsl.engine.runtime.structures import Row, array_at
from hsdsl.engine.simulate.interpolation import Interpolation


def method_text(table: Any) -> str:
    """The definition of ``problem_method``."""
    rows = _Rows()
    count = table.stages + 1 + table.extra if table.c else 0
    own = table.dense and structures.INTERPOLANTS[table.interpolant] == "dense"
    c = _numbers(array_at(ctypes.c_double, table.c, count))
    parts = [f"static const hs_real method_c[] = {{{c or '0'}}};\n"]
    for name, length in (("a", count), ("dense", table.degree if own else 0)):
        listed = ",\n  ".join(rows.row(row) for row in array_at(Row, getattr(table, name), length))
        parts.append(f"static const hs_row method_{name}[] = {{\n  {listed or '{0, 0, 0}'}}};\n")
    single = ", ".join(rows.row(getattr(table, name)) for name in ("b", "error", "coarse"))
    collocation = _collocation(table)
    numbers = f"{table.kind}, {table.stages}, {table.extra}, {table.order}, {table.interpolant}, {table.degree}"
    last = f"method_dense, {constant(table.gain)}, {'&method_collocation' if collocation else 0}"
    method = f"const hs_method problem_method = {{\n  {numbers}, method_c, method_a, {single}, {last}}};\n"
    return "".join([*rows.tables, *parts, collocation, method])


class _Rows:
    """Rows of a table; ``tables`` are the arrays that they point into."""

    def __init__(self) -> None:
        self.tables: list[str] = []

    def row(self, row: Any) -> str:
        """The initialiser of one row."""
        if not row.terms:
            return "{0, 0, 0}"
        number = len(self.tables) // 2
        stages = ", ".join(map(str, array_at(ctypes.c_int, row.stage, row.terms)))
        weights = _numbers(array_at(ctypes.c_double, row.weight, row.terms))
        self.tables.append(f"static const int stages_{number}[] = {{{stages}}};\n")
        self.tables.append(f"static const hs_real weights_{number}[] = {{{weights}}};\n")
        return f"{{{row.terms}, stages_{number}, weights_{number}}}"


def _collocation(table: Any) -> str:
    if not table.collocation:
        return ""
    known = structures.Collocation.from_address(table.collocation)
    fields = ", ".join(_nested(getattr(known, name)) for name, _ in structures.Collocation._fields_)
    return f"static const hs_collocation method_collocation = {{\n  {fields}}};\n"


def _nested(value: Any) -> str:
    return constant(value) if isinstance(value, float) else f"{{{', '.join(map(_nested, value))}}}"


def _numbers(values: Sequence[Number]) -> str:
    return ", ".join(map(constant, values))


def interpolation_text(by: Interpolation, share: Number) -> str:
    """The definition of ``problem_interpolation``: how surfaces along steps are interpolated."""
    columns = {"nodes": by.nodes, "tests": by.tests, "matrix": [number for line in by.matrix for number in line]}
    tables = "".join(f"static const hs_real {name}[] = {{{_numbers(list(c))}}};\n" for name, c in columns.items())
    row = f"{len(by.nodes) - 1}, nodes, tests, matrix, {constant(share + by.rounding)}"
    return f"{tables}const hs_interpolation problem_interpolation = {{{row}}};\n"
