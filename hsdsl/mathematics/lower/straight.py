# pyright: basic, reportArgumentType=false, reportAttributeAccessIssue=false, reportOperatorIssue=false, reportAssignmentType=false, reportIncompatibleMethodOverride=false, reportCallIssue=false, reportReturnType=false
"""Expressions cut into statements that are each small, and derivatives of such statements by the chain rule.

SymPy's expressions are graphs, but it walks, differentiates and prints them as trees: what is written in a few lines
(a product of a thousand factors, a name of `let` that uses the one before it twice, twenty times) can have a
derivative or a text without end. After the cut every one of these costs as much as the graph has nodes.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import accumulate

import sympy as sp

from hsdsl.base.functions import rebuilt, solution
from hsdsl.language.expression.algebra import derivative, moving
from hsdsl.mathematics.lower.elimination import solved
from hsdsl.mathematics.lower.printer import LARGEST_PRODUCT
from hsdsl.mathematics.lower.sharing import Statement, shared

LARGEST = 80  # nodes of one statement
WIDEST = 16  # terms or factors of one statement


class Cut:
    """Expressions cut down to statements of bounded size, in the order of computation.

    With ``powers`` the base of a power that is printed as a product is a name, which can be repeated at no cost. With
    ``whole`` each unknown of linear equations is a statement, which is left to a later cut to solve.
    """

    def __init__(self, letter: str, powers: bool = False, whole: bool = False) -> None:
        self._powers, self._whole = powers, whole
        self.statements: list[Statement] = []
        self._letter = letter
        self._names: dict[sp.Basic, sp.Symbol] = {}
        self._done: dict[sp.Basic, tuple[sp.Basic, int]] = {}
        self._solutions: dict[tuple, list[sp.Basic]] = {}

    def name(self, expr: sp.Basic) -> sp.Basic:
        """Give an expression a name of its own, unless it is a name or a number."""
        if expr.is_Atom:
            return expr
        if expr not in self._names:
            real = {"real": True} if isinstance(expr, sp.Expr) else {}
            self._names[expr] = sp.Symbol(f"{self._letter}{len(self.statements)}", **real)
            self.statements.append((self._names[expr], expr))
        return self._names[expr]

    def define(self, symbol: sp.Symbol, expr: sp.Basic) -> None:
        """Add a statement; the parts of it that are too large come before it."""
        self.statements.append((symbol, self.down(expr)))

    def down(self, expr: sp.Basic) -> sp.Basic:
        """Return the same expression with names for parts that are too large to be written out."""
        return self._cut(expr)[0]

    def _cut(self, expr: sp.Basic) -> tuple[sp.Basic, int]:
        if expr.is_Atom or not expr.args:
            return expr, 1
        if expr not in self._done:
            self._done[expr] = self._node(expr)
        return self._done[expr]

    def _node(self, expr: sp.Basic) -> tuple[sp.Basic, int]:
        parts = [self._cut(a) for a in expr.args]
        if isinstance(expr, solution):
            unknown = expr.func(*(self.name(part) for part, _ in parts))
            return self.name(unknown) if self._whole else self._solved(unknown), 1
        if self._powers and expr.is_Pow and expr.exp.is_Integer and abs(expr.exp) <= LARGEST_PRODUCT:
            parts = [(self.name(part), 1) if abs(expr.exp) > 1 else (part, size) for part, size in parts]
        if expr.is_Pow and expr.base.is_Pow:
            parts = [(self.name(parts[0][0]), 1), parts[1]]  # see `power`
        if isinstance(expr, sp.Tuple):
            return sp.Tuple(*(part for part, _ in parts), sympify=False), 1
        if 1 + sum(size for _, size in parts) > LARGEST:
            parts = [(self.name(part), 1) if size > LARGEST // 4 else (part, size) for part, size in parts]
        if isinstance(expr, (sp.Add, sp.Mul, sp.And, sp.Or)):
            parts = self._narrow(expr.func, parts)
        args = tuple(part for part, _ in parts)
        if args == expr.args:
            return expr, 1 + sum(size for _, size in parts)
        return rebuilt(expr, args), 1 + sum(size for _, size in parts)

    def _solved(self, expr: sp.Basic) -> sp.Basic:
        """The name of an unknown of linear equations, which are solved by statements once for all unknowns."""
        place, rows, constants = expr.system
        if (rows, constants) not in self._solutions:
            self._solutions[rows, constants] = solved(rows, constants, self.name)
        return self._solutions[rows, constants][place]

    def _narrow(self, operation: type, parts: list[tuple[sp.Basic, int]]) -> list[tuple[sp.Basic, int]]:
        """Name the first operands together, as long as the rest is too wide or too large."""
        while len(parts) > WIDEST or (len(parts) > 2 and sum(size for _, size in parts) > LARGEST):
            sizes = accumulate(size for _, size in parts[:WIDEST])
            fit = max(2, sum(size < LARGEST for size in sizes))
            parts = [(self.name(operation(*(part for part, _ in parts[:fit]))), 1), *parts[fit:]]
        return parts


class Gradient:
    """First derivatives of expressions, and the statements that they are written with.

    For each expression, ``sparse`` has its derivatives by those arguments where they are not zero, in the arguments'
    order, and ``rows`` those by all arguments. ``statements`` are the names in them, in the order of computation; none
    where the expressions are small. With ``whole`` unknowns of linear equations, and their derivatives, are left to a
    later cut to solve.
    """

    def __init__(
        self, expressions: Iterable[sp.Expr], arguments: Sequence[sp.Symbol], letter: str = "g", whole: bool = False
    ) -> None:
        self._arguments = arguments
        self._order = {argument: i for i, argument in enumerate(arguments)}
        given = tuple(expressions)
        self._cut = Cut(letter, whole=whole)
        small = [self._cut.down(e) for e in given]
        if self._cut.statements:  # what comes more than once is differentiated once
            common, small = shared(given, f"{letter}_")
            self._cut = Cut(letter, whole=whole)
            for symbol, expr in common:
                self._cut.define(symbol, expr)
            small = [self._cut.down(e) for e in small]
        self._slopes: dict[sp.Symbol, dict[sp.Symbol, sp.Expr]] = {}
        for symbol, expr in tuple(self._cut.statements):
            self._slopes[symbol] = {a: self._cut.name(d) for a, d in self._row(expr).items()}
        self.sparse = tuple(self._row(e) for e in small)
        self.statements = self._cut.statements

    @property
    def rows(self) -> tuple[tuple[sp.Expr, ...], ...]:
        return tuple(tuple(row.get(a, sp.S.Zero) for a in self._arguments) for row in self.sparse)

    def _row(self, expr: sp.Expr) -> dict[sp.Symbol, sp.Expr]:
        if isinstance(expr, solution):
            return self._row_of_solution(expr)
        present = moving(expr)
        direct = {a: derivative(expr, a) for a in present & self._order.keys()}
        through = present & self._slopes.keys()
        for symbol in sorted(through, key=lambda s: s.name):
            slope = self._cut.name(derivative(expr, symbol))
            for argument, inner in self._slopes[symbol].items():
                direct[argument] = direct.get(argument, sp.S.Zero) + slope * inner
        return {a: direct[a] for a in sorted(direct, key=self._order.__getitem__) if direct[a] != 0}

    def _row_of_solution(self, expr: solution) -> dict[sp.Symbol, sp.Expr]:
        """The derivatives of an unknown of A x = b: those of x solve A x' = b' - A' x."""
        place, rows, constants = expr.system
        unknowns = [self._cut.name(solution(sp.Integer(c), *expr.args[1:])) for c in range(len(rows))]
        moved = [[self._row(entry) for entry in (*row, b)] for row, b in zip(rows, constants, strict=True)]
        present = set[sp.Symbol]().union(*(slopes for row in moved for slopes in row))
        found: dict[sp.Symbol, sp.Expr] = {}
        for a in sorted(present, key=self._order.__getitem__):
            right: list[sp.Expr] = []
            for *entries, b in moved:
                through = (slopes[a] * x for slopes, x in zip(entries, unknowns, strict=True) if a in slopes)
                right.append(self._cut.name(b.get(a, sp.S.Zero) - sp.Add(*through)))
            if any(right):
                found[a] = solution(sp.Integer(place), *expr.args[1 : -len(rows)], *right)
        return found


def in_order(statements: Iterable[Statement], results: sp.Basic) -> list[Statement]:
    """The statements that the results need, each behind those it uses."""
    known = dict(statements)
    ordered: dict[sp.Symbol, sp.Basic] = {}

    def visit(expr: sp.Basic) -> None:
        for symbol in sorted(expr.free_symbols & known.keys(), key=lambda s: s.name):
            if symbol not in ordered:
                visit(known[symbol])
                ordered[symbol] = known[symbol]

    visit(results)
    return list(ordered.items())
