"""Structures and enumerations of the runtime's C headers, read from the headers, as ctypes sees them.

``hs_task`` is the class :data:`Task`, a pointer in it an address, ``hs_arc`` also the NumPy type :data:`ARC`, and
``hs_reason`` the tuple :data:`REASONS` of its names in words: ``HS_UNTIL_IN_STRIP`` is "until in strip".
:data:`STOPPED` has for each the word that an execution stops with. Methods and interpolations are written into them as
numbers instead of fractions, in rows without their zeros.
"""

from __future__ import annotations

import ctypes
import re
from collections.abc import Iterable, Iterator, Sequence
from ctypes import c_double, c_int, c_int32, c_int64, c_void_p
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from hsdsl.base.numbers.arithmetic import FLOAT64
from hsdsl.engine import integrators
from hsdsl.engine.integrators.tableau import Row as Terms
from hsdsl.engine.integrators.tableau import table_numbers

HEADERS = ("hs.h", "hs_simulate.h", "hs_lanes.h", "hs_screen.h")
FOLDER = Path(__file__).parent / "c"
COMMENT = re.compile(r"/\*.*?\*/", re.DOTALL)
ENUMERATION = re.compile(r"typedef enum \{([^}=]*)\} (\w+);")  # those that count from 0
REASON = re.compile(r"\breason\(([A-Z_]+), (\w+)\)")  # of `HS_REASONS`
STRUCTURE = re.compile(r"typedef struct(?: \w+)? \{([^}]*)\} (\w+);")
CALLBACK = re.compile(r"int \(\*(\w+)\)\(([^)]*)\)")
DECLARATOR = re.compile(r"(\**)(?:const )?(\**)(\w+)((?:\[\d+\])*)")


def _fields(text: str, types: dict[str, Any]) -> Iterator[tuple[str, Any]]:
    """The fields of a structure: numbers, arrays of them, structures, callbacks, and addresses."""
    for declaration in filter(None, (part.strip() for part in text.split(";"))):
        if callback := CALLBACK.fullmatch(declaration):
            yield callback[1], ctypes.CFUNCTYPE(c_int, *(c_void_p for _ in callback[2].split(",")))
            continue
        kind, declarators = declaration.removeprefix("const ").split(" ", 1)
        for declarator in declarators.split(","):
            found = DECLARATOR.fullmatch(declarator.strip())
            assert found is not None, declaration
            field = c_void_p if found[1] or found[2] else types[kind]
            for length in reversed(re.findall(r"\d+", found[4])):
                field = field * int(length)
            yield found[3], field


def _words(names: Iterable[str]) -> tuple[Any, ...]:
    return tuple(name.strip().removeprefix("HS_").lower().replace("_", " ") for name in names)


def _read() -> tuple[dict[str, Any], dict[str, tuple[Any, ...]], tuple[str, ...]]:
    """Structures and enumerations by their names in C, and the words of :data:`STOPPED`."""
    text = COMMENT.sub("", "".join((FOLDER / name).read_text() for name in HEADERS))
    names, stopped = zip(*REASON.findall(text), strict=True)
    types: dict[str, Any] = {"int": c_int, "int32_t": c_int32, "int64_t": c_int64}
    types |= dict.fromkeys(("double", "hs_real", "hs_time"), c_double)
    structures: dict[str, Any] = {}
    for body, name in STRUCTURE.findall(text):
        structure = type(name, (ctypes.Structure,), {"_fields_": [*_fields(body, types)]})
        types[name] = structures[name] = structure
    words = {name: _words(body.split(",")) for body, name in ENUMERATION.findall(text)}
    return structures, words | {"hs_reason": _words(names)}, stopped


STRUCTURES, ENUMERATIONS, STOPPED = _read()
Mode, Edge, Model, Sparse, Local = (STRUCTURES[f"hs_{name}"] for name in ("mode", "edge", "model", "sparse", "local"))
Row, Collocation, Method = (STRUCTURES[name] for name in ("hs_row", "hs_collocation", "hs_method"))
Timeline, Interpolation, Settings = (STRUCTURES[name] for name in ("hs_timeline", "hs_interpolation", "hs_settings"))
Visited, Tail, Task = (STRUCTURES[f"hs_{name}"] for name in ("visited", "tail", "task"))
Sampling, Ensemble = STRUCTURES["hs_sampling"], STRUCTURES["hs_ensemble"]
Team, LaneProgram = STRUCTURES["hs_team"], STRUCTURES["hs_lane_program"]
Operation, Formula, Formulas = (STRUCTURES[name] for name in ("hs_operation", "hs_formula", "hs_formulas"))
Record, Screen, Correction, Moves = (STRUCTURES[f"hs_{name}"] for name in ("record", "screen", "correction", "moves"))
ARC, TRANSITION, NOTE = (np.dtype(STRUCTURES[name]) for name in ("hs_arc", "hs_transition", "hs_note"))
METHOD_KINDS, INTERPOLANTS, KINDS, COMPILED_SCHEMES, NOTICES, REASONS, FAILURES, OPERATORS, HYPOTHESES = (
    ENUMERATIONS[f"hs_{name}"]
    for name in (
        *("method_kind", "interpolant", "arc_kind", "scheme", "notice"),
        *("reason", "step_failure", "operator", "hypothesis"),
    )
)


def address(memory: Any) -> c_void_p:
    """Where ctypes' memory is, for a field; the field keeps it alive."""
    return ctypes.cast(memory, c_void_p)


def start_of(array: np.ndarray[Any, Any]) -> int:
    """The address of the numbers of a writable array that is not empty, several times as fast as by NumPy."""
    return ctypes.addressof(ctypes.c_char.from_buffer(array.data))


def array_at(kind: Any, start: int | None, count: int) -> Any:
    """An array of numbers, addresses or structures that is in memory already."""
    return (kind * count).from_address(start) if count else ()


def interpolation_table(
    nodes: Sequence[float], tests: Sequence[float], matrix: Sequence[Sequence[float]], share: float
) -> Any:
    """Write an interpolation as the runtime takes it."""
    columns = (nodes, tests, [number for line in matrix for number in line])
    numbers = (address((c_double * len(column))(*column)) for column in columns)
    return Interpolation(len(nodes) - 1, *numbers, share)


@cache
def method_table(method: integrators.Method) -> Any:
    """Write a method as the runtime takes it."""
    if method.kind == "table":
        return _butcher_table(method)
    return Method(
        kind=METHOD_KINDS.index(method.kind),
        order=method.error_order,
        interpolant=INTERPOLANTS.index("dense"),
        degree=method.degree,
        collocation=address(ctypes.pointer(_collocation())) if method.implicit else None,
    )


def _collocation() -> Any:
    """Write the coefficients of Radau IIA."""
    from hsdsl.engine.integrators.radau import coefficients  # most runs need none

    known = coefficients(FLOAT64)
    return Collocation(*(getattr(known, name) for name, _ in Collocation._fields_))


def _butcher_table(table: integrators.ButcherTableau) -> Any:
    """Write a tableau."""
    numbers = table_numbers(table)
    return Method(
        kind=METHOD_KINDS.index(table.kind),
        stages=numbers.stages,
        extra=numbers.extra,
        order=table.order,
        interpolant=INTERPOLANTS.index(table.interpolant),
        degree=table.degree,
        c=address((c_double * len(numbers.nodes))(*numbers.nodes)),
        a=address((Row * len(numbers.a))(*map(_row, numbers.a))),
        b=_row(numbers.b),
        error=_row(numbers.error),
        coarse=_row(numbers.coarse),
        dense=address((Row * max(1, len(numbers.dense)))(*map(_row, numbers.dense))),
        gain=float(sum(map(abs, table.b))),
    )


def _row(terms: Terms) -> Any:
    count = max(1, len(terms))
    stages, weights = (c_int * count)(*(i for i, _ in terms)), (c_double * count)(*(w for _, w in terms))
    return Row(len(terms), address(stages), address(weights))
