# pyright: basic
"""Bounds on the work of SymPy: constants as numbers, exact numbers of millions of digits, expressions without end.

SymPy folds numbers wherever they meet, also inside symbolic powers, so every operation is measured before it is done.
Nothing here grows with a value.
"""

from __future__ import annotations

from typing import Any

import mpmath
import sympy as sp

from hsdsl.language.expression.parse import Call, Power, Product, Sum, Tree
from hsdsl.language.expression.scope import Value

_BITS = 200  # far beyond both doubles and the fifty digits of a precise run
_context: Any = mpmath.mp.clone()
_context.prec = _BITS
_LARGEST = _context.mpf(2) ** 1024 * (1 - _context.mpf(2) ** -54)
NAN = _context.nan
PI = +_context.pi

_FUNCTIONS = {
    "abs": abs,
    "sign": _context.sign,
    "floor": _context.floor,
    "min": min,
    "max": max,
    "select": lambda number, one, other: one if number > 0 else other,
}


class Refused(Exception):
    """A node without a value: in ``message`` `{it}` stands for its text, or for that of its part number ``of``."""

    def __init__(self, code: str, message: str, hint: str | None = None, of: int | None = None) -> None:
        super().__init__(message)
        self.code, self.message, self.hint, self.of = code, message, hint, of


def finite(number: Any) -> bool:
    """Whether a number is real and in the range of a double."""
    return bool(abs(number) < _LARGEST)


def of_rational(value: sp.Rational) -> Any:
    """An exact number, rounded."""
    return _context.mpf(value.p) / value.q


def total(numbers: list[Any]) -> Any:
    """A sum; None where a term is unknown."""
    return None if any(n is None for n in numbers) else _guarded(_context.fsum, [numbers])


def product(numbers: list[Any]) -> Any:
    """A product; None where a factor is unknown."""
    return None if any(n is None for n in numbers) else _guarded(_context.fprod, [numbers])


def inverse(number: Any) -> Any:
    """1/x; NaN for 0."""
    if number is None:
        return None
    return _real(1 / number) if number else NAN


def power(base: Any, exponent: Any) -> Any:
    """A real power; NaN where there is none."""
    if base is None or exponent is None:
        return None
    return NAN if not base and exponent < 0 else _guarded(_context.power, [base, exponent])


def apply(function: str, arguments: list[Any]) -> Any:
    """A function of the language; NaN outside its real domain."""
    if any(a is None for a in arguments):
        return None
    return _guarded(_FUNCTIONS.get(function) or getattr(_context, function), arguments)


def of_node(tree: Tree, numbers: list[Any]) -> Any:
    """The number of a node whose parts have these; None where one is unknown, NaN where it has none."""
    match tree:
        case Sum():
            signed = zip(numbers, tree.terms, strict=True)
            return total([n if n is None or not minus else -n for n, (minus, _) in signed])
        case Product():
            return product([inverse(n) if below else n for n, (below, _) in zip(numbers, tree.factors, strict=True)])
        case Power():
            return power(*numbers)
        case Call():
            return apply(tree.function, numbers)
    raise AssertionError(tree)


def _guarded(function: Any, arguments: list[Any]) -> Any:
    numbers = arguments[0] if isinstance(arguments[0], list) else arguments
    if not all(finite(n) for n in numbers):
        return NAN
    try:
        return _real(function(*arguments))
    except (ZeroDivisionError, OverflowError, ValueError):
        return NAN


def _real(number: Any) -> Any:
    number = _context.convert(number)
    return number if isinstance(number, _context.mpf) and finite(number) else NAN


LARGEST_EXPONENT = 1000
MOST_BITS = 6_000  # of one exact number: the product of two must still print as a decimal (4,300 digits)
MOST_BITS_WITHIN = 1_000_000  # of the numbers SymPy meets when it brings sums to a common denominator
MOST_BITS_WITHIN_A_POWER = 12_000  # of those it meets in powers of sums: now and then it asks whether one is prime
MOST_NODES = 100_000
MOST_NODES_OF_A_CONSTANT = 500  # SymPy computes one as often as it asks for its sign
MOST_LEVELS_OF_A_CONSTANT = 12  # and computes it anew at each of its levels
MOST_LEVELS = 100  # SymPy's time grows with the cube of it
LARGEST_NUMBER = 2**1024  # no float is as large
DECIMAL, _SIMPLIFY = "write its value as a decimal", "make it a state or simplify it"
TOO_DEEP = (
    "HS120",
    f"functions, powers and sums in products are nested more than {MOST_LEVELS} deep",
    "this counts what is written under `let`",
)
_NOT_FINITE = ("HS118", "`{it}` has no finite real value")
_TOO_LONG = (
    "HS120", f"`{{it}}` contains an exact number of more than {MOST_BITS:,} bits", "write it as a decimal"
)  # fmt: skip
_NOT_REAL = frozenset((sp.zoo, sp.nan, sp.oo, -sp.oo, sp.I))


def refuse_work(tree: Tree, exprs: list[Any], number: Any) -> None:
    """Raise where the node of these parts has no value, or too long a one; ``number`` is that of a constant."""
    if isinstance(tree, Product):
        for k, (expr, (below, _)) in enumerate(zip(exprs, tree.factors, strict=True)):
            if below and expr.is_zero and expr.is_number:
                raise Refused("HS118", "nothing can be divided by 0, and `{it}` is 0", of=k)
    elif isinstance(tree, Power) and large_exponent(exprs[1]):
        raise Refused("HS119", f"the exponent `{{it}}` is above {LARGEST_EXPONENT:,} in magnitude", of=1)
    if number is not None and not finite(number):
        raise Refused(*_NOT_FINITE)
    match tree:
        case Sum():
            length = sum_bits(exprs)
        case Product():
            length = sum(map(bits, exprs))
        case Power():
            length = bits(exprs[0]) * _constant_part(exprs[1])
        case Call(function="exp") if large_exponent(exprs[0]):
            raise Refused("HS119", f"`{{it}}` is a power with an exponent above {LARGEST_EXPONENT:,} in magnitude")
        case _:
            return
    if length > MOST_BITS:
        raise Refused(*_TOO_LONG)


def refuse_value(value: Value, of_power: bool) -> None:
    """Raise where a value is not finite, or SymPy would need too long for it; ``of_power`` says that it is a power."""
    expr = value.expr
    coefficients: list[Any] = [term.as_coeff_Mul()[0] for term in sp.Add.make_args(expr)]
    if _not_real(expr) or any(c.is_Rational and abs(c.p) >= LARGEST_NUMBER * c.q for c in coefficients):
        raise Refused(*_NOT_FINITE)
    if bits(expr) > MOST_BITS:
        raise Refused(*_TOO_LONG)
    if value.constant and value.number is not None and not finite(value.number):
        raise Refused(*_NOT_FINITE)
    if value.size > MOST_NODES:
        message = "the expression grows too large once the names of `let` and inputs are written out"
        raise Refused("HS120", message, _SIMPLIFY)
    if value.constant and not expr.is_Rational:  # SymPy would compute it for ever
        if value.size > MOST_NODES_OF_A_CONSTANT:
            message = f"`{{it}}` is a constant of more than {MOST_NODES_OF_A_CONSTANT} operations"
            raise Refused("HS120", message, DECIMAL)
        if value.depth > MOST_LEVELS_OF_A_CONSTANT:
            most = MOST_LEVELS_OF_A_CONSTANT
            message = f"`{{it}}` is a constant whose functions are nested more than {most} deep"
            raise Refused("HS120", message, DECIMAL)
    if value.bits > (MOST_BITS_WITHIN_A_POWER if of_power else MOST_BITS_WITHIN):
        message = "the exact numbers in the expression grow too long once its powers are multiplied out"
        raise Refused("HS120", message, _SIMPLIFY)
    if value.depth > MOST_LEVELS:
        raise Refused(*TOO_DEEP)


def _not_real(expr: Any) -> bool:
    """Whether an expression is infinite for SymPy, or not real."""
    parts = (expr, *(expr.args if expr.is_Mul or expr.is_Add else ()))
    roots = [(p.base, p.exp) for p in parts if p.is_Pow and p.base.is_Rational and p.exp.is_Rational]
    return any(p in _NOT_REAL for p in parts) or any(base < 0 and not exp.is_Integer for base, exp in roots)


def bits(expr: Any) -> int:
    """The length of the exact numbers that are factors of an expression."""
    if expr.is_Rational:
        return max(int(expr.p).bit_length(), int(expr.q).bit_length())
    if expr.is_Mul:
        return sum(bits(factor) for factor in expr.args if factor.is_Rational or factor.is_Pow)
    if expr.is_Pow and expr.args[0].is_Rational:
        return bits(expr.args[0]) * _constant_part(expr.args[1])
    return 0


def _constant_part(exponent: Any) -> int:
    constant = exponent if exponent.is_Rational else exponent.as_coeff_Add()[0]
    return int(abs(constant)) + 1 if constant.is_Rational else 1


def sum_bits(terms: list[Any]) -> int:
    """How long the common denominator of like terms of a sum can get."""
    denominators: dict[Any, set[int]] = {}
    for term in terms:
        for part in sp.Add.make_args(term):
            split: tuple[Any, Any] = part.as_coeff_Mul()
            coefficient, rest = split
            if coefficient.is_Rational and coefficient.q != 1:
                denominators.setdefault(rest, set()).add(int(coefficient.q))
    return max((sum(q.bit_length() for q in group) for group in denominators.values()), default=0)


def large_exponent(exponent: Any) -> bool:
    """Whether a numeric exponent is above the cap, also one hidden in a logarithm: ``exp(10**9*log(3))``."""
    if exponent.is_Rational:
        return abs(exponent) > LARGEST_EXPONENT
    return any(_large_logarithm(term) for term in sp.Add.make_args(exponent))


def _large_logarithm(term: Any) -> bool:
    coefficient, rest = term.as_coeff_Mul()
    logarithms = [f for f in sp.Mul.make_args(rest) if isinstance(f, sp.log)]
    if not logarithms:
        return False
    return abs(coefficient) * max([1, *(bits(f.args[0]) // 64 for f in logarithms)]) > LARGEST_EXPONENT
