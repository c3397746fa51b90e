# pyright: basic, reportArgumentType=false, reportAttributeAccessIssue=false, reportOperatorIssue=false, reportAssignmentType=false, reportIncompatibleMethodOverride=false, reportCallIssue=false
"""Expressions -> the tape that Taylor coefficients are computed from: one elementary operation a line.

A function of one argument u is a line of the kind z' = g u', with its derivative g a line of its own (which may use z:
the coefficient k of z needs g up to k - 1 only), and u' another, which all functions of u share. Other kinds have the
recurrences of products, quotients and powers. What is a polynomial of time alone is known as such, so that sums along
it are short. Equal operations are one line.

See A. Griewank and A. Walther, *Evaluating Derivatives*, Sec. 13.2 (doi:10.1137/1.9780898717761).
"""

from __future__ import annotations

from math import inf

import sympy as sp

from hsdsl.language.system import TIME
from hsdsl.mathematics.lower.straight import Cut, Definition, print_routines
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
        rows = tuple(writer.line(f) for f in flow)
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
        self._known = {TIME: 0} | {s: i for i, s in enumerate(states, 1)}
        self._moving = set(self._known)
        self._constant: dict[sp.Basic, bool] = {}
        self._first = len(self._known)
        self._numbers: dict[sp.Expr, int] = {}
        self._written: dict[Operation, int] = {}
        self._degrees: list[int | None] = [1, *(None for _ in states)]
        self.constants: list[sp.Expr] = []
        self.operations: list[Operation] = []

    def line_or_none(self, expr) -> int | None:
        """The line of an expression; None where it is kinked, with nothing written."""
        before = len(self.operations), len(self.constants)
        tables = self._known, self._written, self._numbers
        sizes = list(map(len, tables))
        try:
            return self.line(expr)
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
            return self._operation("constant", constant=expr)
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
            return self._operation("below", self.line(number), self.line(one), self.line(other), constant=bound)
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

    def _operation(self, kind: str, *lines: int, constant=None) -> int:
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
        return self._written[operation]

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
            total = self._operation("sub" if negative else "add", total, self.line(-term if negative else term))
        constant = sp.Add(*(t for t in terms if self._is_constant(t)))
        return total if constant == 0 else self._operation("offset", total, constant=constant)

    def _product(self, expr) -> int:
        constant = sp.Mul(*(f for f in expr.args if self._is_constant(f)))
        moving = [f for f in expr.args if not self._is_constant(f)]
        below = [1 / f for f in moving if f.is_Pow and f.exp.is_Number and f.exp < 0]
        above = [f for f in moving if not (f.is_Pow and f.exp.is_Number and f.exp < 0)]
        if not above:
            return self._operation("under", self._factors(below), constant=constant)
        line = self._factors(above)
        if below:
            line = self._operation("div", line, self._factors(below))
        if constant == -1:
            return self._operation("neg", line)
        return line if constant == 1 else self._operation("scale", line, constant=constant)

    def _factors(self, factors) -> int:
        line = self.line(factors[0])
        for factor in factors[1:]:
            line = self._operation("mul", line, self.line(factor))
        return line

    def _power(self, base, exponent) -> int:
        if self._is_constant(base):
            return self.line(sp.exp(exponent * sp.log(base), evaluate=False))
        if not self._is_constant(exponent):
            return self.line(sp.exp(exponent * sp.log(base, evaluate=False), evaluate=False))
        if exponent.is_Number and exponent < 0:
            return self._operation("under", self.line(base**-exponent), constant=_ONE)
        if exponent == sp.Rational(1, 2):
            return self._operation("sqrt", self.line(base))
        if exponent.is_Integer:
            return self._whole_power(self.line(base), int(exponent))
        return self._operation("pow", self.line(base), constant=exponent)

    def _whole_power(self, base: int, exponent: int) -> int:
        """By squaring: exact where the base is zero, too."""
        result: int | None = None
        while exponent:
            if exponent & 1:
                result = base if result is None else self._operation("mul", result, base)
            exponent >>= 1
            if exponent:
                base = self._operation("mul", base, base)
        assert result is not None
        return result

    def chain(self, name: str, u: int, derivative: int) -> int:
        """The function ``name`` of line u, whose derivative by u is a line."""
        return self._operation(name, u, self.slope(u), derivative)

    def slope(self, u: int) -> int:
        """The line of u', which a function of u needs; written once."""
        return self._operation("slope", u)

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
                self._operation("neg", one)
        return self._known[key]

    def tangent(self, name: str, u: int, negative: bool) -> int:
        """Z' = (1 + z**2) u', or (1 - z**2) u'."""
        self.slope(u)
        z = self.chain(name, u, self.ahead(3 if negative else 2))
        square = self._operation("mul", z, z)
        if negative:
            square = self._operation("neg", square)
        self._operation("offset", square, constant=_ONE)
        return z

    def reciprocal(self, u: int) -> int:
        return self._operation("under", u, constant=_ONE)

    def algebraic(self, name: str, u: int, sign: int, offset: int, root: bool, scale: int = 1) -> int:
        """Z' = scale u' / (offset + sign u**2), or with the square root of that."""
        line = self._operation("mul", u, u)
        if sign < 0:
            line = self._operation("neg", line)
        line = self._operation("offset", line, constant=sp.Integer(offset))
        if root:
            line = self._operation("sqrt", line)
        return self.chain(name, u, self._operation("under", line, constant=sp.Integer(scale)))

    def atan2(self, y: int, x: int) -> int:
        """Z' = (x y' - y x') / (x**2 + y**2)."""
        squares = (self._operation("mul", x, x), self._operation("mul", y, y))
        radius = self._operation("add", *squares)
        by_y = self._operation("div", x, radius)
        by_x = self._operation("neg", self._operation("div", y, radius))
        return self._operation("atan2", y, x, by_y, by_x, self.slope(y), self.slope(x))


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
