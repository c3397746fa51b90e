"""Routines as operations on the results of others, one list for each mode, in tables (``hs_screen.h``).

Registers hold time, the states, data, constants and then the result of each operation, those on data alone first. Of a
function that the screen of verdicts does not know nothing is concluded.
"""

from __future__ import annotations

import ast
import ctypes
import math
import re
import sys
from collections.abc import Callable, Mapping, Sequence
from fractions import Fraction
from functools import reduce
from typing import Any, NamedTuple

import numpy as np

from hsdsl.base.numbers.arithmetic import FLOAT64
from hsdsl.base.numbers.roundoff import BEYOND
from hsdsl.engine.runtime import structures
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


CONSTANT = re.compile(r"q_(m?)(\d+)_(\d+)")
SIGNS: Mapping[type[ast.operator], str] = {ast.Add: "add", ast.Sub: "sub", ast.Mult: "mul", ast.Div: "div"}
PLAIN = ("abs", "sqrt", "exp", "log", "sin", "cos", "tanh", "atan", "sign", "floor")
FOLLOWED = ("asin", "acos", "sinh", "cosh", "asinh", "acosh", "atanh", "atan2", "below")  # round-off of which is
MOST_POWER = 1 << 20


class Node(NamedTuple):
    """A value: where it comes from, its number there, and its degree as a polynomial in time and the states."""

    source: str
    number: int
    degree: float


Operation = tuple[str, tuple[Node | int, ...]]


class Operations:
    """The operations of one mode, while they are collected."""

    def __init__(self, states: int, data: Sequence[str]) -> None:
        self.names = {"t": Node("state", 0, 1)} | {f"x{i}": Node("state", i + 1, 1) for i in range(states)}
        self.names |= {name: Node("data", i, 0) for i, name in enumerate(data)}
        self.constants: dict[tuple[float, float, float, float], Node] = {}
        self.fixed: list[Operation] = []
        self.moving: list[Operation] = []
        self._known: dict[Operation, Node] = {}

    def formula(self, definition: ast.FunctionDef) -> tuple[int, int, list[Node]]:
        """Collect one routine: its first operation, the one after its last, and its results."""
        self._known = {key: node for key, node in self._known.items() if node.source == "fixed"}
        names, first, results = dict(self.names), len(self.moving), list[Node]()
        for statement in definition.body:
            match statement:
                case ast.Assign(value=ast.Subscript()):
                    pass  # a datum under its own name
                case ast.Assign(targets=[ast.Name(id=name)], value=value):
                    names[name] = self._node(value, names)
                case ast.Return(value=ast.Tuple(elts=elements)):
                    results = [self._node(element, names) for element in elements]
                case _:
                    raise ValueError(f"no statement of a routine: {ast.unparse(statement)}")
        return first, len(self.moving), results

    def _node(self, tree: ast.expr, names: dict[str, Node]) -> Node:
        match tree:
            case ast.Name(id=name):
                return names[name] if name in names else self._constant(name)
            case ast.UnaryOp(op=ast.USub(), operand=operand):
                return self._made("neg", self._node(operand, names))
            case ast.BinOp(left=left, op=sign, right=right) if type(sign) in SIGNS:
                one, other = self._node(left, names), self._node(right, names)
                if isinstance(sign, ast.Mult) and one == other:
                    return self._made("square", one)
                return self._made(SIGNS[type(sign)], one, other)
            case ast.Call(func=ast.Name(id=name), args=arguments):
                return self._called(name, arguments, names)
            case _:
                return self._unknown()

    def _called(self, name: str, arguments: list[ast.expr], names: dict[str, Node]) -> Node:
        if name == "pow":
            return self._power(*arguments, names=names)
        nodes = [self._node(argument, names) for argument in arguments]
        if name in PLAIN or name in FOLLOWED:
            return self._made(name, *nodes)
        if name in ("min", "max"):
            return reduce(lambda one, other: self._made(name, one, other), nodes)
        if name == "tan":
            return self._made("div", self._made("sin", nodes[0]), self._made("cos", nodes[0]))
        if name == "heaviside":
            half, one = self._kept(0.5, 0.5, 0.5), self._kept(1.0, 1.0, 1.0)
            return self._made("mul", half, self._made("add", one, self._made("sign", nodes[0])))
        return self._unknown()

    def _power(self, base: ast.expr, exponent: ast.expr, *, names: dict[str, Node]) -> Node:
        found = CONSTANT.fullmatch(exponent.id) if isinstance(exponent, ast.Name) else None
        whole = int(found[2]) if found and not found[1] and found[3] == "1" else 0
        if 0 < whole < MOST_POWER:
            return self._made("power", self._node(base, names), whole)
        return self._made("pow", self._node(base, names), self._node(exponent, names))

    def _constant(self, name: str) -> Node:
        if found := CONSTANT.fullmatch(name):
            exact = Fraction(int(found[2]) * (-1 if found[1] else 1), int(found[3]))
            if abs(exact) > sys.float_info.max:
                return self._unknown()
            nearest = float(exact)
            return self._around(nearest, float(exact - Fraction(nearest)))
        nearest = FLOAT64.functions.get(name)
        if isinstance(nearest, float) and math.isfinite(nearest):
            return self._around(nearest, BEYOND[name])
        return self._unknown()

    def _around(self, nearest: float, error: float) -> Node:
        if not error:
            return self._kept(nearest, nearest, nearest)
        return self._kept(math.nextafter(nearest, -math.inf), math.nextafter(nearest, math.inf), nearest, error)

    def _kept(self, low: float, high: float, nearest: float, error: float = 0.0) -> Node:
        return self.constants.setdefault((low, high, nearest, error), Node("constant", len(self.constants), 0))

    def _unknown(self) -> Node:
        """Give what may be anything; its operand does not matter."""
        return self._made("unknown", self.names["t"])

    def _made(self, kind: str, *operands: Node | int) -> Node:
        key = kind, operands
        if key not in self._known:
            nodes = [node for node in operands if isinstance(node, Node)]
            fixed = all(node.source in ("data", "constant", "fixed") for node in nodes)
            operations = self.fixed if fixed else self.moving
            operations.append(key)
            made = Node("fixed" if fixed else "moving", len(operations) - 1, _degree(kind, nodes))
            self._known[key] = made
        return self._known[key]


def _degree(kind: str, nodes: Sequence[Node]) -> float:
    degrees = [node.degree for node in nodes]
    if kind in ("add", "sub", "neg"):
        return max(degrees)
    if kind == "mul":
        return sum(degrees)
    if kind == "div" and degrees[1] == 0:
        return degrees[0]
    return 0 if max(degrees) == 0 and kind != "unknown" else math.inf
