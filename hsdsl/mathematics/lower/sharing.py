# pyright: basic, reportArgumentType=false, reportAttributeAccessIssue=false, reportOperatorIssue=false, reportReturnType=false
"""Expressions with names for what comes in them more than once: parts, and pairs of factors or terms.

SymPy's `cse` does as much in a time that grows faster than the expressions do.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Sequence
from heapq import heapify, heappop, heappush
from itertools import combinations

import sympy as sp

Statement = tuple[sp.Symbol, sp.Basic]


def shared(expressions: Sequence[sp.Basic], letter: str) -> tuple[list[Statement], list[sp.Basic]]:
    """Statements that give names, and the expressions written with them."""
    found = _Shared(expressions, letter)
    return found.statements, found.expressions


class _Shared:
    def __init__(self, expressions: Iterable[sp.Basic], letter: str) -> None:
        self._letter = letter
        self._uses: Counter[sp.Basic] = Counter()
        self._operands: dict[sp.Basic, tuple[sp.Basic, ...]] = {}
        self._written: dict[sp.Basic, sp.Basic] = {}
        self.statements: list[Statement] = []
        given = tuple(expressions)
        for expr in given:
            self._count(expr)
        for operation in (sp.Mul, sp.Add):
            self._pair(operation)
        self.expressions = [self._new(expr) for expr in given]

    def _count(self, expr: sp.Basic) -> None:
        """Count the uses of an expression and of its parts, each once; those of the negative of one are its own."""
        if expr.is_Atom:
            return
        expr = self._known(expr)
        self._uses[expr] += 1
        if self._uses[expr] == 1:
            self._operands[expr] = _operands(expr)
            for part in self._operands[expr]:
                self._count(part)

    def _known(self, expr: sp.Basic) -> sp.Basic:
        """The expression or its negative: of products the positive one, of sums the one that came first."""
        if expr.is_Mul:
            return -expr if expr.args[0].is_Number and expr.args[0] < 0 else expr
        if expr.is_Add and expr not in self._operands and (negative := -expr) in self._operands:
            return negative
        return expr

    def _pair(self, operation: type) -> None:
        """Give names to pairs of operands, those first that most have in common."""
        wholes = [expr for expr in self._operands if isinstance(expr, operation)]
        for pair, owners in _pairs([self._operands[expr] for expr in wholes], operation):
            others = [wholes[i] for i in owners if wholes[i] != pair]
            self._operands[pair] = pair.args
            self._uses[pair] += len(others)
            for part in pair.args:
                self._uses[self._known(part)] -= len(owners) - 1
            for whole in others:
                rest = [part for part in self._operands[whole] if part not in pair.args]
                self._operands[whole] = (*(x for x in rest if x.is_Number), pair, *(x for x in rest if not x.is_Number))

    def _new(self, expr: sp.Basic) -> sp.Basic:
        if expr.is_Atom:
            return expr
        if expr not in self._operands:
            inner = self._new(self._known(expr))
            return -inner if inner.is_Mul else sp.Mul._from_args((sp.S.NegativeOne, inner))
        if expr not in self._written:
            written = self._rebuilt(expr)
            if self._uses[expr] > 1:
                real = {"real": True} if isinstance(expr, sp.Expr) else {}
                name = sp.Symbol(f"{self._letter}{len(self.statements)}", **real)
                self.statements.append((name, written))
                written = name
            self._written[expr] = written
        return self._written[expr]

    def _rebuilt(self, expr: sp.Basic) -> sp.Basic:
        parts = [self._new(part) for part in self._operands[expr]]
        if _is_quotient(expr):
            return sp.Pow(parts[0], -1, evaluate=False)
        if expr.is_Add or expr.is_Mul:
            return expr.func._from_args(parts)
        if tuple(parts) == expr.args:
            return expr
        return sp.Pow(*parts, evaluate=False) if expr.is_Pow else expr.func(*parts)


def _is_quotient(expr: sp.Basic) -> bool:
    return expr.is_Pow and expr.exp.is_Number and expr.exp < 0


def _operands(expr: sp.Basic) -> tuple[sp.Basic, ...]:
    return (expr.base**-expr.exp,) if _is_quotient(expr) else expr.args


def _pairs(lists: Sequence[Sequence[sp.Basic]], operation: type) -> Iterator[tuple[sp.Basic, list[int]]]:
    """The pairs that most of some lists have in common, until no two have one, and in which lists each is."""
    numbers: dict[sp.Basic, int] = {}
    own = [[numbers.setdefault(operand, len(numbers)) for operand in each] for each in lists]
    operands, where = list(numbers), defaultdict[tuple[int, int], set[int]](set)
    for i, each in enumerate(own):
        for pair in combinations(sorted(each), 2):
            where[pair].add(i)
    waiting = [(-len(owners), pair) for pair, owners in where.items() if len(owners) > 1]
    heapify(waiting)
    while waiting:
        count, pair = heappop(waiting)
        owners = sorted(where.pop(pair, ()))
        if len(owners) < 2:
            continue
        if len(owners) < -count:
            where[pair] = set(owners)
            heappush(waiting, (-len(owners), pair))
            continue
        made = operation._from_args([operands[k] for k in own[owners[0]] if k in pair])
        yield made, owners
        for i in owners:
            own[i] = [k for k in own[i] if k not in pair]
            for k in own[i]:
                for old in pair:
                    where[min(k, old), max(k, old)].discard(i)
                where[k, len(operands)].add(i)
        new = [(k, len(operands)) for k in dict.fromkeys(k for i in owners for k in own[i])]
        for i in owners:
            own[i].append(len(operands))
        operands.append(made)
        for each in new:
            if len(where[each]) > 1:
                heappush(waiting, (-len(where[each]), each))
