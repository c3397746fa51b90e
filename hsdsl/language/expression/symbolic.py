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
    CONDITIONS,
    Call,
    Comparison,
    ExpressionError,
    Logic,
    Name,
    Negative,
    Not,
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
_DECIMAL, _SIMPLIFY = "write its value as a decimal", "make it a state or simplify it"
_NOT_REAL = frozenset((sp.zoo, sp.nan, sp.oo, -sp.oo, sp.I))
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
    builder = _Builder(scope, text)
    builder.refuse_deep(tree)
    return builder.number(tree)


def condition(tree: Tree, scope: Scope, text: str) -> Any:
    """The SymPy Boolean of a condition whose names the scope has; errors as for :func:`number`."""
    return _Builder(scope, text).condition(tree)


class _Builder:
    """One expression in one scope."""

    def __init__(self, scope: Scope, text: str) -> None:
        self.scope = scope
        self.text = text

    def refuse_deep(self, tree: Tree) -> None:
        """Raise where functions and powers are nested too deep, before SymPy is given any of them."""
        waiting = [(tree, 0)]
        while waiting:
            node, depth = waiting.pop()
            depth += isinstance(node, (Call, Power))
            if depth > numeric.MOST_LEVELS:
                raise self.too_deep(tree)
            waiting.extend((child, depth) for child in children(node))

    def number(self, tree: Tree) -> Value:
        """The value of a node that must be a number."""
        if isinstance(tree, CONDITIONS):
            from hsdsl.language.diagnosis.expressions import CASES

            hint = f"write {int(tree.value)}" if isinstance(tree, Truth) else CASES
            message = f"expected a number, got the condition `{self.text_of(tree)}`"
            raise ExpressionError.at(tree, "HS114", message, hint)
        match tree:
            case Number():
                expr: Any = sp.Rational(tree.value.numerator, tree.value.denominator)
                return Value(expr, numeric.of_rational(expr), True, bits=numeric.bits(expr))
            case Name():
                return self.name(tree)
            case Negative():
                inner = self.number(tree.operand)
                return self.value(tree, -inner.expr, numeric.product([inner.number, -1]), [inner])
            case Sum():
                return self.sum(tree)
            case Product():
                return self.product(tree)
            case Power():
                return self.power(tree)
            case Call():
                return self.call(tree)
        raise AssertionError(tree)

    def name(self, tree: Name) -> Value:
        """A constant, or a name of the scope."""
        if tree.name in CONSTANTS:
            return Value(CONSTANTS[tree.name], numeric.PI, True)
        value = self.scope.values[tree.name]
        assert isinstance(value, Value)
        return value

    def sum(self, tree: Sum) -> Value:
        """Terms added; the common denominator is measured first."""
        values = [self.number(term) for _, term in tree.terms]
        terms = [-v.expr if minus else v.expr for v, (minus, _) in zip(values, tree.terms, strict=True)]
        if numeric.sum_bits(terms) > numeric.MOST_BITS:
            raise self.too_long(tree)
        signed = zip(values, tree.terms, strict=True)
        numbers = [v.number if v.number is None or not minus else -v.number for v, (minus, _) in signed]
        return self.value(tree, self.made(tree, sp.Add, *terms), numeric.total(numbers), values)

    def product(self, tree: Product) -> Value:
        """Factors multiplied; the length of their exact numbers is measured first."""
        values = [self.number(factor) for _, factor in tree.factors]
        for value, (divided, factor) in zip(values, tree.factors, strict=True):
            if divided and value.expr.is_zero and value.expr.is_number:
                text = self.text_of(factor)
                message = "nothing can be divided by 0" + (f", and `{text}` is 0" if text != "0" else "")
                raise ExpressionError.at(factor, "HS118", message)
        divided = [d for d, _ in tree.factors]
        numbers = [numeric.inverse(v.number) if d else v.number for v, d in zip(values, divided, strict=True)]
        number = numeric.product(numbers)
        if all(v.constant for v in values):
            self.refuse_unless_finite(tree, number)
        if sum(numeric.bits(v.expr) for v in values) > numeric.MOST_BITS:
            raise self.too_long(tree)
        factors = [1 / v.expr if d else v.expr for v, d in zip(values, divided, strict=True)]
        return self.value(tree, self.made(tree, sp.Mul, *factors), number, values)

    def power(self, tree: Power) -> Value:
        """A power; the work that it gives SymPy is measured first."""
        base, exponent = self.number(tree.base), self.number(tree.exponent)
        if numeric.large_exponent(exponent.expr):
            text = self.text_of(tree.exponent)
            message = f"the exponent `{text}` is above {numeric.LARGEST_EXPONENT:,} in magnitude"
            raise ExpressionError.at(tree.exponent, "HS119", message)
        number = numeric.power(base.number, exponent.number)
        if base.constant and exponent.constant:
            self.refuse_unless_finite(tree, number)
        if numeric.power_bits(base.expr, exponent.expr) > numeric.MOST_BITS:
            raise self.too_long(tree)
        return self.value(tree, self.made(tree, functions.power, base.expr, exponent.expr), number, [base, exponent])

    def call(self, tree: Call) -> Value:
        """A function of the language or of the file. min and max of many are taken in pairs."""
        values = [self.number(argument) for argument in tree.arguments]
        own = self.scope.values.get(tree.function)
        if isinstance(own, Function):
            return self.written_out(tree, own, tuple(values))
        number = numeric.apply(tree.function, [v.number for v in values])
        if all(v.constant for v in values):
            self.refuse_unless_finite(tree, number)
        exprs = [v.expr for v in values]
        if tree.function == "exp" and numeric.large_exponent(exprs[0]):
            sentence = f"is a power with an exponent above {numeric.LARGEST_EXPONENT:,} in magnitude"
            raise ExpressionError.at(tree, "HS119", f"`{self.text_of(tree)}` {sentence}")
        if tree.function == "select":
            return self.value(tree, self.made(tree, chosen, *exprs), number, values)
        function: Any = FUNCTIONS[tree.function][0]
        pairwise = tree.function in ("min", "max")
        expr = self.made(tree, _pairwise, function, exprs) if pairwise else self.made(tree, function, *exprs)
        return self.value(tree, expr, number, values)

    def written_out(self, tree: Call, function: Function, values: tuple[Value, ...]) -> Value:
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
            raise ExpressionError.at(tree, error.code, message, error.hint) from None
        if value.depth > numeric.MOST_LEVELS:
            raise self.too_deep(tree)
        return function.made.setdefault(values, value)

    def made(self, tree: Tree, function: Any, *arguments: Any) -> Any:
        """What SymPy makes of arguments; its own failures (a sine of 1e308, exactly) are an error of the expression."""
        try:
            return function(*arguments)
        except (TypeError, AttributeError, ValueError, NotImplementedError, ArithmeticError, RecursionError):
            message = f"`{self.text_of(tree)}` cannot be worked out exactly"
            raise ExpressionError.at(tree, "HS120", message, _DECIMAL) from None

    def value(self, tree: Tree, expr: Any, number: Any, parts: list[Value]) -> Value:
        """A value made of parts, checked."""
        constant = all(part.constant for part in parts)
        expr = _with_our_functions(expr)
        if _not_real(expr) or numeric.beyond_floats(expr):
            raise self.not_finite(tree)
        if numeric.bits(expr) > numeric.MOST_BITS:
            raise self.too_long(tree)
        if expr.is_Rational:
            number = numeric.of_rational(expr)
        if constant:
            self.refuse_unless_finite(tree, number)
        uses = frozenset().union(*(part.uses for part in parts))
        size, depth = 1 + sum(p.size for p in parts), _levels(tree, expr, parts)
        if size > numeric.MOST_NODES:
            message = "the expression grows too large once the names of `let` and inputs are written out"
            raise ExpressionError.at(tree, "HS120", message, _SIMPLIFY)
        if constant and not expr.is_Rational:  # SymPy would compute it for ever
            sentence = None
            if size > numeric.MOST_NODES_OF_A_CONSTANT:
                sentence = f"is a constant of more than {numeric.MOST_NODES_OF_A_CONSTANT} operations"
            elif depth > numeric.MOST_LEVELS_OF_A_CONSTANT:
                most = numeric.MOST_LEVELS_OF_A_CONSTANT
                sentence = f"is a constant whose functions are nested more than {most} deep"
            if sentence:
                raise ExpressionError.at(tree, "HS120", f"`{self.text_of(tree)}` {sentence}", _DECIMAL)
        within = _bits_within(tree, parts)
        most = numeric.MOST_BITS_WITHIN_A_POWER if isinstance(tree, Power) else numeric.MOST_BITS_WITHIN
        if within > most:
            message = "the exact numbers in the expression grow too long once its powers are multiplied out"
            raise ExpressionError.at(tree, "HS120", message, _SIMPLIFY)
        if depth > numeric.MOST_LEVELS:
            raise self.too_deep(tree)
        return Value(expr, number, constant, uses, size, depth, within)

    def refuse_unless_finite(self, tree: Tree, number: Any) -> None:
        """Raise where a constant has no finite real value."""
        if number is not None and not numeric.finite(number):
            raise self.not_finite(tree)

    def too_deep(self, tree: Tree) -> ExpressionError:
        """The error for a nest that SymPy would need too long for."""
        message = f"functions, powers and sums in products are nested more than {numeric.MOST_LEVELS} deep"
        return ExpressionError.at(tree, "HS120", message, "this counts what is written under `let`")

    def not_finite(self, tree: Tree) -> ExpressionError:
        """The error for something like 1/0 or sqrt(-1)."""
        return ExpressionError.at(tree, "HS118", f"`{self.text_of(tree)}` has no finite real value")

    def too_long(self, tree: Tree) -> ExpressionError:
        """The error for an exact number that would fill the memory."""
        message = f"`{self.text_of(tree)}` contains an exact number of more than {numeric.MOST_BITS:,} bits"
        return ExpressionError.at(tree, "HS120", message, "write it as a decimal")

    def condition(self, tree: Tree) -> Any:
        """The Boolean of a node that must be a condition."""
        match tree:
            case Truth():
                return sp.true if tree.value else sp.false
            case Not():
                return sp.Not(self.condition(tree.operand))
            case Logic():
                parts = [self.condition(operand) for operand in tree.operands]
                return sp.And(*parts) if tree.operator == "and" else sp.Or(*parts)
            case Comparison():
                values = [self.number(operand).expr for operand in tree.operands]
                pairs = zip(tree.operators, values, values[1:], strict=False)
                return sp.And(*(_RELATIONS[operator](a, b, evaluate=False) for operator, a, b in pairs))
        hint = f"compare it with something: {self.text_of(tree)} > 0"
        if isinstance(tree, Number) and tree.value in (0, 1):
            hint = f"write {'true' if tree.value else 'false'}"
        raise ExpressionError.at(tree, "HS115", f"expected a condition, got the number `{self.text_of(tree)}`", hint)

    def text_of(self, tree: Tree) -> str:
        """The text of a node, cut for a sentence."""
        return shown(self.text[tree.start : tree.end], 40)


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


def _not_real(expr: Any) -> bool:
    """Whether an expression is infinite for SymPy, or not real."""
    parts = (expr, *(expr.args if expr.is_Mul or expr.is_Add else ()))
    roots = [(p.base, p.exp) for p in parts if p.is_Pow and p.base.is_Rational and p.exp.is_Rational]
    return any(p in _NOT_REAL for p in parts) or any(base < 0 and not exp.is_Integer for base, exp in roots)


def _with_our_functions(expr: Any) -> Any:
    if expr.is_Atom or expr.is_Add or not expr.has(*_FOREIGN):
        return expr
    for theirs, ours in _FOREIGN.items():
        expr = expr.replace(theirs, ours)
    return expr
