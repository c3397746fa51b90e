# pyright: basic, reportArgumentType=false, reportAttributeAccessIssue=false, reportOperatorIssue=false, reportAssignmentType=false, reportIncompatibleMethodOverride=false, reportCallIssue=false
"""Expressions -> the tape that Taylor coefficients are computed from: one elementary operation a line.

A function of one argument u is a line of the kind z' = g u', with its derivative g a line of its own (which may use z:
the coefficient k of z needs g up to k - 1 only), and u' another, which all functions of u share. Other kinds have the
recurrences of products, quotients and powers. What is a polynomial of time alone is known as such, so that sums along
it are short. Equal operations are one line.

See A. Griewank and A. Walther, *Evaluating Derivatives*, Sec. 13.2 (doi:10.1137/1.9780898717761).
"""

from __future__ import annotations

from collections.abc import Mapping
from math import inf
from typing import NamedTuple

import sympy as sp

from hsdsl.base.functions import replaced
from hsdsl.language.system import TIME
from hsdsl.mathematics.lower.straight import Cut, Definition, Shape, print_routines
from hsdsl.mathematics.program import Operation, Tape

_ONE = sp.Integer(1)
_WITHOUT_SUM = ("constant", "add", "sub", "neg", "offset", "scale", "slope", "square", "sqrt", "pow", "atan2", "below")
_POLYNOMIAL = ("constant", "add", "sub", "neg", "offset", "scale", "slope", "mul")  # of polynomials


class Kinked(Exception):
    """An expression has a function without Taylor series everywhere; the message names it."""


def make_tape(flow, surfaces, states, data) -> Tape | None:
    """Write the tape of a mode whose flow and surfaces are expressions of TIME, ``states`` and ``data``.

    Returns None where the flow is kinked (`abs`, `sign`, `min`, `max`, `floor`); a kinked surface has no line.
    """
    writer = _Writer(states)
    try:
        rows = tuple(writer.whole(f) for f in flow)
    except Kinked:
        return None
    needed, count = len(writer.operations), len(writer.constants)
    lines = tuple(writer.line_or_none(r) for r in surfaces)
    first, further = tuple(writer.constants[:count]), tuple(writer.constants[count:])
    constants = print_routines([Definition("flow", (), first), Definition("surfaces", (), further)], data)
    return Tape(constants, count, len(further), tuple(writer.operations), rows, lines, needed)


class _Writer:
    """Lines 0 to n are time and the states; every operation is the next line."""

    def __init__(self, states) -> None:
        self._states = states
        self._known = {TIME: 0} | {s: i for i, s in enumerate(states, 1)}
        self._moving = set(self._known)
        self._traces: dict[tuple, _Trace | None] = {}
        self.calls: list[tuple[str, tuple[int, ...], sp.Expr | None, int]] = []
        self._constant: dict[sp.Basic, bool] = {}
        self._first = len(self._known)
        self._numbers: dict[sp.Expr, int] = {}
        self._written: dict[Operation, int] = {}
        self._degrees: list[int | None] = [1, *(None for _ in states)]
        self.constants: list[sp.Expr] = []
        self.operations: list[Operation] = []

    def whole(self, expr) -> int:
        """The line of an expression; from its second one on a shape is looked through once."""
        shape = Shape((expr,))
        if shape.key not in self._traces:
            self._traces[shape.key] = None
            return self.line(expr)
        trace = self._traces[shape.key] = self._traces[shape.key] or _Trace.of(_Writer(self._states), expr, shape)
        return trace.written(self, expr, shape)

    def line_or_none(self, expr) -> int | None:
        """The line of an expression; None where it is kinked, with nothing written."""
        before = len(self.operations), len(self.constants)
        tables = self._known, self._written, self._numbers
        sizes = list(map(len, tables))
        try:
            return self.whole(expr)
        except Kinked:
            del self.operations[before[0] :], self._degrees[self._first + before[0] :], self.constants[before[1] :]
            for table, size in zip(tables, sizes, strict=True):
                while len(table) > size:  # the last that was put in
                    table.popitem()
            return None

    def line(self, expr) -> int:
        """The line whose values are the expression's."""
        if expr not in self._known:
            self._known[expr] = self._write(expr)
        return self._known[expr]

    def _write(self, expr) -> int:
        if self._is_constant(expr):
            return self.operation("constant", constant=expr)
        if expr.is_Add:
            return self._sum(expr)
        if expr.is_Mul:
            return self._product(expr)
        if expr.is_Pow:
            return self._power(expr.base, expr.exp)
        name = type(expr).__name__
        if name == "solution":
            return self._solution(expr)
        if name == "below":
            number, bound, one, other = expr.args
            return self.operation("below", self.line(number), self.line(one), self.line(other), constant=bound)
        if name not in _DERIVATIVES:
            raise Kinked(name)
        return _DERIVATIVES[name](self, *map(self.line, expr.args))

    def _solution(self, expr) -> int:
        """The line of an unknown of linear equations: the statements that solve them are lines."""
        cut, fixed = Cut(f"solved {len(self._known)} "), {}
        unknown = cut.down(expr)
        for symbol, value in cut.statements:
            value = value.xreplace(fixed)
            if self._is_constant(value):
                fixed[symbol] = value
            else:
                self._known[symbol] = self.line(value)
                self._moving.add(symbol)
        return self.line(unknown.xreplace(fixed))

    def _is_constant(self, expr) -> bool:
        if not expr.args:
            return expr not in self._moving
        if expr not in self._constant:
            self._constant[expr] = all(map(self._is_constant, expr.args))
        return self._constant[expr]

    def operation(self, kind: str, *lines: int, constant=None) -> int:
        """The line of an operation on lines; the same one is written once."""
        number = None
        if constant is not None:
            if constant not in self._numbers:
                self._numbers[constant] = len(self.constants)
                self.constants.append(constant)
            number = self._numbers[constant]
        operation = self._shortest(kind, lines, number)
        if operation not in self._written:
            self._written[operation] = self._first + len(self.operations)
            self.operations.append(operation)
            self._degrees.append(self._degree(operation))
        line = self._written[operation]
        self.calls.append((kind, lines, constant, line))
        return line

    def _shortest(self, kind: str, lines: tuple[int, ...], constant: int | None) -> Operation:
        """Choose how an operation is summed: along a polynomial of time where there is one."""
        if kind == "mul":
            degrees = {line: inf if self._degrees[line] is None else self._degrees[line] for line in lines}
            shorter, longer = sorted(lines, key=lambda line: (degrees[line], line))
            lines = shorter, longer
            if shorter == longer and self._degrees[shorter] is None:
                return Operation("square", lines[:1], constant)
        if kind in _WITHOUT_SUM:
            return Operation(kind, lines, constant)
        along = self._degrees[lines[1 if kind == "div" else 0]]
        return Operation(kind, lines, constant, None if along is None else max(1, along))

    def _degree(self, operation: Operation) -> int | None:
        """The degree of a line that is a polynomial of time; None for others."""
        if operation.kind not in _POLYNOMIAL:
            return None
        degrees = [d for line in operation.lines if (d := self._degrees[line]) is not None]
        if len(degrees) < len(operation.lines):
            return None
        return sum(degrees) if operation.kind == "mul" else max(degrees, default=0)

    def _sum(self, expr) -> int:
        terms = expr.as_ordered_terms()
        moving = [t for t in terms if not self._is_constant(t)]
        total = self.line(moving[0])
        for term in moving[1:]:
            negative = term.could_extract_minus_sign()
            total = self.operation("sub" if negative else "add", total, self.line(-term if negative else term))
        constant = sp.Add(*(t for t in terms if self._is_constant(t)))
        return total if constant == 0 else self.operation("offset", total, constant=constant)

    def _product(self, expr) -> int:
        constant = sp.Mul(*(f for f in expr.args if self._is_constant(f)))
        moving = [f for f in expr.args if not self._is_constant(f)]
        below = [1 / f for f in moving if f.is_Pow and f.exp.is_Number and f.exp < 0]
        above = [f for f in moving if not (f.is_Pow and f.exp.is_Number and f.exp < 0)]
        if not above:
            return self.operation("under", self._factors(below), constant=constant)
        line = self._factors(above)
        if below:
            line = self.operation("div", line, self._factors(below))
        if constant == -1:
            return self.operation("neg", line)
        return line if constant == 1 else self.operation("scale", line, constant=constant)

    def _factors(self, factors) -> int:
        line = self.line(factors[0])
        for factor in factors[1:]:
            line = self.operation("mul", line, self.line(factor))
        return line

    def _power(self, base, exponent) -> int:
        if self._is_constant(base):
            return self.line(sp.exp(exponent * sp.log(base), evaluate=False))
        if not self._is_constant(exponent):
            return self.line(sp.exp(exponent * sp.log(base, evaluate=False), evaluate=False))
        if exponent.is_Number and exponent < 0:
            return self.operation("under", self.line(base**-exponent), constant=_ONE)
        if exponent == sp.Rational(1, 2):
            return self.operation("sqrt", self.line(base))
        if exponent.is_Integer:
            return self._whole_power(self.line(base), int(exponent))
        return self.operation("pow", self.line(base), constant=exponent)

    def _whole_power(self, base: int, exponent: int) -> int:
        """By squaring: exact where the base is zero, too."""
        result: int | None = None
        while exponent:
            if exponent & 1:
                result = base if result is None else self.operation("mul", result, base)
            exponent >>= 1
            if exponent:
                base = self.operation("mul", base, base)
        assert result is not None
        return result

    def chain(self, name: str, u: int, derivative: int) -> int:
        """The function ``name`` of line u, whose derivative by u is a line."""
        return self.operation(name, u, self.slope(u), derivative)

    def slope(self, u: int) -> int:
        """The line of u', which a function of u needs; written once."""
        return self.operation("slope", u)

    def ahead(self, lines: int) -> int:
        """The number of the line that follows ``lines`` further lines, after the lines of slopes."""
        return self._first + len(self.operations) + lines

    def exp(self, u: int) -> int:
        """Z' = z u'."""
        self.slope(u)
        return self.chain("exp", u, self.ahead(0))

    def pair(self, first: str, second: str, u: int, turn: bool) -> int:
        """Two functions that are each other's derivative; with ``turn`` that of the second one up to sign.

        The second one is the next line.
        """
        key = (first, u)
        if key not in self._known:
            self.slope(u)
            self._known[key] = one = self.chain(first, u, self.ahead(1))
            self.chain(second, u, self.ahead(1) if turn else one)
            if turn:
                self.operation("neg", one)
        return self._known[key]

    def tangent(self, name: str, u: int, negative: bool) -> int:
        """Z' = (1 + z**2) u', or (1 - z**2) u'."""
        self.slope(u)
        z = self.chain(name, u, self.ahead(3 if negative else 2))
        square = self.operation("mul", z, z)
        if negative:
            square = self.operation("neg", square)
        self.operation("offset", square, constant=_ONE)
        return z

    def reciprocal(self, u: int) -> int:
        return self.operation("under", u, constant=_ONE)

    def algebraic(self, name: str, u: int, sign: int, offset: int, root: bool, scale: int = 1) -> int:
        """Z' = scale u' / (offset + sign u**2), or with the square root of that."""
        line = self.operation("mul", u, u)
        if sign < 0:
            line = self.operation("neg", line)
        line = self.operation("offset", line, constant=sp.Integer(offset))
        if root:
            line = self.operation("sqrt", line)
        return self.chain(name, u, self.operation("under", line, constant=sp.Integer(scale)))

    def atan2(self, y: int, x: int) -> int:
        """Z' = (x y' - y x') / (x**2 + y**2)."""
        radius = self.operation("add", self.operation("mul", x, x), self.operation("mul", y, y))
        by_y = self.operation("div", x, radius)
        by_x = self.operation("neg", self.operation("div", y, radius))
        return self.operation("atan2", y, x, by_y, by_x, self.slope(y), self.slope(x))


_PLAIN = frozenset(("constant", "add", "sub", "neg", "offset", "scale", "mul", "div", "under", "sqrt", "pow", "below"))


class _Trace(NamedTuple):
    """The operations that write expressions of one shape, None where one of them names lines that follow it.

    Of each the kind, the lines, and the constant. A line is the place of a symbol among the parts of the shape, or one
    of the operations, from -1 down; ``symbols`` are those of the expression that it was made of.
    """

    operations: tuple[tuple[str, tuple[int, ...], sp.Expr | None], ...] | None
    result: int
    symbols: Mapping[int, sp.Symbol]
    constants: dict[tuple, sp.Expr]

    @classmethod
    def of(cls, writer: _Writer, expr, shape: Shape) -> _Trace:
        """Trace how a writer without lines writes an expression."""
        places = {writer.line(symbol): place for symbol, place in shape.symbols.items() if symbol in writer._moving}
        end = writer.line(expr)
        plain = all(kind in _PLAIN for kind, *_ in writer.calls)
        found = []
        for k, (kind, lines, constant, line) in enumerate(writer.calls if plain else ()):
            found.append((kind, tuple(map(places.__getitem__, lines)), constant))
            places.setdefault(line, -1 - k)
        symbols = {place: symbol for symbol, place in shape.symbols.items()}
        return cls(tuple(found) if plain else None, places.get(end, 0), symbols, {})

    def written(self, writer: _Writer, expr, shape: Shape) -> int:
        """The line of another expression of the shape."""
        if not self.operations:
            return writer.line(expr)
        symbols = {place: symbol for symbol, place in shape.symbols.items()}
        now = {symbol: symbols[place] for place, symbol in self.symbols.items()}
        lines: list[int] = []
        for kind, operands, constant in self.operations:
            given = (lines[-1 - place] if place < 0 else writer.line(symbols[place]) for place in operands)
            lines.append(writer.operation(kind, *given, constant=self._constant(constant, now)))
        return lines[-1 - self.result]

    def _constant(self, constant: sp.Expr | None, now: Mapping[sp.Symbol, sp.Symbol]) -> sp.Expr | None:
        if constant is None or constant.is_Atom:
            return now.get(constant, constant)
        key = constant, *(now[symbol] for symbol in self.symbols.values() if symbol in constant.free_symbols)
        if key not in self.constants:
            self.constants[key] = replaced(constant, now, {})
        return self.constants[key]


_DERIVATIVES = {
    "exp": _Writer.exp,
    "log": lambda w, u: w.chain("log", u, w.reciprocal(u)),
    "sin": lambda w, u: w.pair("sin", "cos", u, turn=True),
    "cos": lambda w, u: w.pair("sin", "cos", u, turn=True) + 1,
    "sinh": lambda w, u: w.pair("sinh", "cosh", u, turn=False),
    "cosh": lambda w, u: w.pair("sinh", "cosh", u, turn=False) + 1,
    "tan": lambda w, u: w.tangent("tan", u, negative=False),
    "tanh": lambda w, u: w.tangent("tanh", u, negative=True),
    "atan2": _Writer.atan2,
    "atan": lambda w, u: w.algebraic("atan", u, 1, 1, root=False),
    "atanh": lambda w, u: w.algebraic("atanh", u, -1, 1, root=False),
    "asin": lambda w, u: w.algebraic("asin", u, -1, 1, root=True),
    "acos": lambda w, u: w.algebraic("acos", u, -1, 1, root=True, scale=-1),
    "asinh": lambda w, u: w.algebraic("asinh", u, 1, 1, root=True),
    "acosh": lambda w, u: w.algebraic("acosh", u, 1, -1, root=True),
}
