# pyright: basic
"""Trees to SymPy, by whitelist. Names are looked up in a scope: nothing is substituted afterwards."""

from __future__ import annotations

from typing import Any

import sympy as sp

from hsdsl.base import functions
from hsdsl.base.functions import CONSTANTS, FUNCTIONS
from hsdsl.base.names import shown
from hsdsl.language.expression import numeric
from hsdsl.language.expression.algebra import chosen
from hsdsl.language.expression.parse import (
    Call,
    Comparison,
    ExpressionError,
    Logic,
    Name,
    Number,
    Power,
    Product,
    Sum,
    Tree,
    Truth,
    children,
)
from hsdsl.language.expression.scope import Function, Scope, Value

_RELATIONS = {"<": sp.Lt, "<=": sp.Le, ">": sp.Gt, ">=": sp.Ge, "==": sp.Eq, "!=": sp.Ne}
# functions that SymPy makes by itself (tan(x + pi/2) is a cotangent), against those the rest of the house knows
_FOREIGN: dict[Any, Any] = {
    sp.Abs: functions.absolute,
    sp.sign: functions.sign,
    sp.floor: functions.floor,
    sp.cot: lambda x: 1 / sp.tan(x),
    sp.sec: lambda x: 1 / sp.cos(x),
    sp.csc: lambda x: 1 / sp.sin(x),
    sp.coth: lambda x: 1 / functions.tanh(x),
    sp.sech: lambda x: 1 / functions.cosh(x),
    sp.csch: lambda x: 1 / functions.sinh(x),
    sp.Heaviside: lambda x, *_: (sp.S.One + functions.sign(x)) / 2,
}


def number(tree: Tree, scope: Scope, text: str) -> Value:
    """The value of an expression whose names the scope has.

    Raises ExpressionError: a condition in place of a number, a constant without a finite real value, or an expression
    that is too large.
    """
    waiting = [(tree, 0)]
    while waiting:  # before SymPy is given any of them
        node, depth = waiting.pop()
        depth += isinstance(node, (Call, Power))
        if depth > numeric.MOST_LEVELS:
            raise ExpressionError(*numeric.TOO_DEEP[:2], tree.start, tree.end, numeric.TOO_DEEP[2])
        waiting.extend((child, depth) for child in children(node))
    return _Builder(scope, text).number(tree)


def condition(tree: Tree, scope: Scope, text: str) -> Any:
    """The SymPy Boolean of a condition whose names the scope has; errors as for :func:`number`."""
    return _Builder(scope, text).condition(tree)


class _Builder:
    """One expression in one scope."""

    def __init__(self, scope: Scope, text: str) -> None:
        self.scope = scope
        self.text = text

    def number(self, tree: Tree) -> Value:
        """The value of a node that must be a number; what refuses it says why, and here it gets its place."""
        match tree:
            case Number():
                expr: Any = sp.Rational(tree.value.numerator, tree.value.denominator)
                return Value(expr, numeric.of_rational(expr), True, bits=numeric.bits(expr))
            case Name() if tree.name in CONSTANTS:
                return Value(CONSTANTS[tree.name], numeric.PI, True)
            case Name():
                value = self.scope.values[tree.name]
                assert isinstance(value, Value)
                return value
            case Sum() | Product() | Power() | Call():
                parts = [self.number(part) for part in children(tree)]
                try:
                    return self.of_parts(tree, parts)
                except numeric.Refused as fault:
                    node, message = tree if fault.of is None else children(tree)[fault.of], fault.message
                    message = message.replace("{it}", self.text_of(node)).removesuffix(", and `0` is 0")
                    raise ExpressionError(fault.code, message, node.start, node.end, fault.hint) from None
        from hsdsl.language.diagnosis.expressions import CASES

        hint = f"write {int(tree.value)}" if isinstance(tree, Truth) else CASES
        message = f"expected a number, got the condition `{self.text_of(tree)}`"
        raise ExpressionError("HS114", message, tree.start, tree.end, hint)

    def of_parts(self, tree: Tree, parts: list[Value]) -> Value:
        """The value of a node whose parts have these; the work that it gives SymPy is measured first."""
        own = self.scope.values.get(tree.function) if isinstance(tree, Call) else None
        if isinstance(own, Function):
            return self.written_out(own, tuple(parts))
        constant, exprs = all(part.constant for part in parts), [part.expr for part in parts]
        number = numeric.of_node(tree, [part.number for part in parts])
        numeric.refuse_work(tree, exprs, number if constant else None)
        try:
            expr = _made(tree, exprs)
        except (TypeError, AttributeError, ValueError, NotImplementedError, ArithmeticError, RecursionError):
            raise numeric.Refused("HS120", "`{it}` cannot be worked out exactly", numeric.DECIMAL) from None
        expr = _with_our_functions(expr)
        number = numeric.of_rational(expr) if expr.is_Rational else number
        uses, size = frozenset().union(*(part.uses for part in parts)), 1 + sum(part.size for part in parts)
        value = Value(expr, number, constant, uses, size, _levels(tree, expr, parts), _bits_within(tree, parts))
        numeric.refuse_value(value, isinstance(tree, Power))
        return value

    def written_out(self, function: Function, values: tuple[Value, ...]) -> Value:
        """A function of the file with values for its arguments; its faults are faults of the call."""
        if values in function.made:
            return function.made[values]
        scope = function.scope(dict(zip(function.arguments, values, strict=True)))
        assert function.tree is not None
        try:
            if faults := scope.faults(function.tree):
                raise faults[0]
            value = _Builder(scope, function.text).number(function.tree)
        except ExpressionError as error:
            message = error.message if error.message.startswith("in `") else f"in `{function.name}`: {error.message}"
            raise numeric.Refused(error.code, message, error.hint) from None
        if value.depth > numeric.MOST_LEVELS:
            raise numeric.Refused(*numeric.TOO_DEEP)
        return function.made.setdefault(values, value)

    def condition(self, tree: Tree) -> Any:
        """The Boolean of a node that must be a condition."""
        match tree:
            case Truth():
                return sp.true if tree.value else sp.false
            case Logic():
                joined = {"and": sp.And, "or": sp.Or, "not": sp.Not}[tree.operator]
                return joined(*(self.condition(operand) for operand in tree.operands))
            case Comparison():
                values = [self.number(operand).expr for operand in tree.operands]
                pairs = zip(tree.operators, values, values[1:], strict=False)
                return sp.And(*(_RELATIONS[operator](a, b, evaluate=False) for operator, a, b in pairs))
        hint = f"compare it with something: {self.text_of(tree)} > 0"
        if isinstance(tree, Number) and tree.value in (0, 1):
            hint = f"write {'true' if tree.value else 'false'}"
        message = f"expected a condition, got the number `{self.text_of(tree)}`"
        raise ExpressionError("HS115", message, tree.start, tree.end, hint)

    def text_of(self, tree: Tree) -> str:
        """The text of a node, cut for a sentence."""
        return shown(self.text[tree.start : tree.end], 40)


def _made(tree: Tree, exprs: list[Any]) -> Any:
    """What SymPy makes of the parts of a node; it may fail (a sine of 1e308, exactly)."""
    match tree:
        case Sum():
            return sp.Add(*(-expr if minus else expr for expr, (minus, _) in zip(exprs, tree.terms, strict=True)))
        case Product():
            return sp.Mul(*(1 / expr if below else expr for expr, (below, _) in zip(exprs, tree.factors, strict=True)))
        case Power():
            return functions.power(*exprs)
        case Call(function="select"):
            return chosen(*exprs)
        case Call():
            function: Any = FUNCTIONS[tree.function][0]
            return _pairwise(function, exprs) if tree.function in ("min", "max") else function(*exprs)
    raise AssertionError(tree)


def _pairwise(function: Any, exprs: list[Any]) -> Any:
    """A function of two, of many: in a tree that is as flat as it can be."""
    while len(exprs) > 1:
        pairs = [function(*exprs[i : i + 2]) for i in range(0, len(exprs) - 1, 2)]
        exprs = pairs + exprs[2 * len(pairs) :]
    return exprs[0]


def _levels(tree: Tree, expr: Any, parts: list[Value]) -> int:
    """How deep the parentheses are nested when a node is written out."""
    if isinstance(tree, (Call, Power)):
        return 1 + max(part.depth for part in parts)
    if isinstance(tree, Product) and not expr.is_Add:
        return max(part.depth + part.expr.is_Add for part in parts)
    return max(part.depth for part in parts)


def _bits_within(tree: Tree, parts: list[Value]) -> int:
    if isinstance(tree, Call) and tree.function != "sqrt":
        return 0
    if isinstance(tree, Power):
        exponent = parts[1].expr
        return parts[0].bits * max(1, abs(int(exponent))) if exponent.is_Rational else 0
    return sum(part.bits for part in parts)


def _with_our_functions(expr: Any) -> Any:
    if expr.is_Atom or expr.is_Add or not expr.has(*_FOREIGN):
        return expr
    for theirs, ours in _FOREIGN.items():
        expr = expr.replace(theirs, ours)
    return expr
