"""Routines as operations on the results of others, for the compiled screen: one list for each mode.

Operations on data alone are apart from those that move with time and states. Of a function that the screen does not
know nothing is concluded.
"""

from __future__ import annotations

import ast
import math
import re
import sys
from collections.abc import Mapping, Sequence
from fractions import Fraction
from functools import reduce
from typing import NamedTuple

from hsdsl.arithmetic import FLOAT64

CONSTANT = re.compile(r"q_(m?)(\d+)_(\d+)")
SIGNS: Mapping[type[ast.operator], str] = {ast.Add: "add", ast.Sub: "sub", ast.Mult: "mul", ast.Div: "div"}
PLAIN = ("abs", "sqrt", "exp", "log", "sin", "cos", "tanh", "atan", "sign", "floor")
MOST_POWER = 1 << 20


class Node(NamedTuple):
    """A value: where it comes from, its number there, and its degree as a polynomial in time and the states."""

    source: str
    number: int
    degree: float


class Operations:
    """The operations of one mode, while they are collected."""

    def __init__(self, states: int, data: Sequence[str]) -> None:
        self.names = {"t": Node("state", 0, 1)} | {f"x{i}": Node("state", i + 1, 1) for i in range(states)}
        self.names |= {name: Node("data", i, 0) for i, name in enumerate(data)}
        self.constants: dict[tuple[float, float], Node] = {}
        self.fixed: list[tuple[str, Node, Node | int]] = []
        self.moving: list[tuple[str, Node, Node | int]] = []
        self._known: dict[tuple[str, Node, Node | int], Node] = {}

    def formula(self, definition: ast.FunctionDef) -> tuple[int, int, list[Node]]:
        """Collect one routine: its first operation, the one behind its last, and its results."""
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
        if name in PLAIN:
            return self._made(name, nodes[0])
        if name in ("min", "max"):
            return reduce(lambda one, other: self._made(name, one, other), nodes)
        if name == "tan":
            return self._made("div", self._made("sin", nodes[0]), self._made("cos", nodes[0]))
        if name == "heaviside":
            half, one = self._kept(0.5, 0.5), self._kept(1.0, 1.0)
            return self._made("mul", half, self._made("add", one, self._made("sign", nodes[0])))
        return self._unknown()

    def _power(self, base: ast.expr, exponent: ast.expr, *, names: dict[str, Node]) -> Node:
        found = CONSTANT.fullmatch(exponent.id) if isinstance(exponent, ast.Name) else None
        whole = int(found[2]) if found and not found[1] and found[3] == "1" else 0
        return self._made("power", self._node(base, names), whole) if 0 < whole < MOST_POWER else self._unknown()

    def _constant(self, name: str) -> Node:
        if found := CONSTANT.fullmatch(name):
            exact = Fraction(int(found[2]) * (-1 if found[1] else 1), int(found[3]))
            if abs(exact) > sys.float_info.max:
                return self._unknown()
            nearest = float(exact)
            return self._kept(nearest, nearest) if Fraction(nearest) == exact else self._around(nearest)
        nearest = FLOAT64.functions.get(name)
        if isinstance(nearest, float) and math.isfinite(nearest):
            return self._around(nearest)
        return self._unknown()

    def _around(self, nearest: float) -> Node:
        return self._kept(math.nextafter(nearest, -math.inf), math.nextafter(nearest, math.inf))

    def _kept(self, low: float, high: float) -> Node:
        return self.constants.setdefault((low, high), Node("constant", len(self.constants), 0))

    def _unknown(self) -> Node:
        """Give what may be anything; its operand does not matter."""
        return self._made("unknown", self.names["t"])

    def _made(self, kind: str, one: Node, other: Node | int = 0) -> Node:
        key = kind, one, other
        if key not in self._known:
            nodes = [node for node in (one, other) if isinstance(node, Node)]
            fixed = all(node.source in ("data", "constant", "fixed") for node in nodes)
            operations = self.fixed if fixed else self.moving
            operations.append(key)
            made = Node("fixed" if fixed else "moving", len(operations) - 1, _degree(kind, one, other))
            self._known[key] = made
        return self._known[key]


def _degree(kind: str, one: Node, other: Node | int) -> float:
    degrees = one.degree, other.degree if isinstance(other, Node) else 0
    if kind in ("add", "sub", "neg"):
        return max(degrees)
    if kind == "mul":
        return sum(degrees)
    if kind == "div" and degrees[1] == 0:
        return degrees[0]
    return 0 if max(degrees) == 0 and kind != "unknown" else math.inf
