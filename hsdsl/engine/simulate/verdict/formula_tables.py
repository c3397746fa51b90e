"""The formulas of a program as tables of the compiled screen (``hs_screen.h``).

Registers hold time, the states, data, constants and then the result of each operation, those on data alone first.
"""

from __future__ import annotations

import ast
import ctypes
import math
from collections.abc import Callable
from typing import Any

import numpy as np

from hsdsl.engine.runtime import structures
from hsdsl.engine.simulate.verdict.formulas import Node, Operations
from hsdsl.mathematics.program import ModeProgram, Program

MOST_OPERANDS = 4


class FormulaTables:
    """All modes of a program as the screen takes them; ``table`` is their ``hs_formulas``."""

    def __init__(self, program: Program) -> None:
        self._kept: list[Any] = []
        self.registers = 0  # of the mode with most
        found = [self._mode(program, k, mode) for k, mode in enumerate(program.modes)]
        self.table: Any = (structures.Formulas * len(found))(*found)

    def _mode(self, program: Program, index: int, mode: ModeProgram) -> Any:
        data = [f"p{i}" for i in range(len(program.parameters))]
        data += [f"{letter}{i}" for i in range(len(program.inputs)) for letter in "abc"]
        data += [f"k{i}" for i in range(len(program.switches))]
        operations, routines = Operations(len(mode.states), data), _definitions(mode.routines.source)
        surfaces = len(mode.edges) + len(mode.walls)
        names = ["flow", "surfaces", *(f"rate_{k}" for k in range(surfaces))]
        names += [f"reset_{k}" for k in range(len(mode.edges))]
        formulas = [operations.formula(routines[name]) for name in names]
        place = _placed(operations, 1 + len(mode.states) + len(data))
        steps = [
            (structures.OPERATORS.index(kind), *map(place, operands), *(0,) * (MOST_OPERANDS - len(operands)))
            for kind, operands in (*operations.fixed, *operations.moving)
        ]
        self.registers = max(self.registers, 1 + len(mode.states) + len(data) + len(operations.constants) + len(steps))
        flow, values, *others = (self._formula(len(operations.fixed), place, formula) for formula in formulas)
        resets = [results for *_, results in formulas[2 + surfaces :]]
        curved = [len(results) * any(math.isinf(node.degree) for node in results) for results in resets]
        keeps = [_keeps(mode, index, k) for k in range(len(mode.edges))]
        return structures.Formulas(
            constants=len(operations.constants),
            fixed=len(operations.fixed),
            operations=len(steps),
            affine=all(node.degree <= 1 for node in formulas[0][2]),
            steep=mode.steep,
            jumps=mode.jumps,
            constant=self._memory(np.array(list(operations.constants), np.float64)),
            operation=self._memory(np.array(steps, np.int32)),
            flow=flow,
            surfaces=values,
            rate=self._structures(others[:surfaces]),
            reset=self._structures(others[surfaces:]),
            keeps=self._memory(np.array(keeps, np.int32)),
            curved=self._memory(np.array(curved, np.int32)),
        )

    def _memory(self, array: Any) -> int:
        self._kept.append(array)
        return array.ctypes.data

    def _structures(self, each: list[Any]) -> Any:
        self._kept.append((structures.Formula * max(1, len(each)))(*each))
        return ctypes.addressof(self._kept[-1])

    def _formula(self, fixed: int, place: Callable[[Any], int], formula: tuple[int, int, list[Node]]) -> Any:
        first, last, results = formula
        return structures.Formula(first + fixed, last + fixed, self._memory(np.array([*map(place, results)], np.int32)))


def _placed(operations: Operations, data_end: int) -> Callable[[Any], int]:
    """The register of a node; a number is itself."""
    starts = {"state": 0, "data": len(operations.names) - sum(n.source == "data" for n in operations.names.values())}
    starts["constant"] = data_end
    starts["fixed"] = data_end + len(operations.constants)
    starts["moving"] = starts["fixed"] + len(operations.fixed)
    return lambda node: starts[node.source] + node.number if isinstance(node, Node) else node


def _definitions(source: str) -> dict[str, ast.FunctionDef]:
    bind = ast.parse(source).body[0]
    assert isinstance(bind, ast.FunctionDef)
    return {each.name: each for each in bind.body if isinstance(each, ast.FunctionDef)}


def _keeps(mode: ModeProgram, index: int, k: int) -> list[bool]:
    """Say which states the reset of an edge to the mode itself leaves as they are."""
    edge = mode.edges[k]
    if edge.target != index:
        return [False] * len(mode.states)
    return [text == name for name, text in zip(mode.states, edge.reset_texts, strict=True)]
