# pyright: basic, reportArgumentType=false, reportAttributeAccessIssue=false, reportOperatorIssue=false, reportAssignmentType=false, reportIncompatibleMethodOverride=false, reportCallIssue=false
"""SymPy expressions as the text of generated Python: fixed order of operations, exact constants, mangled names.

Every number but an integer exponent becomes ``q_N_D`` (the fraction N/D), so each number type supplies its own value.
Integer powers up to 8 are left-to-right products, which any language of control flow can repeat to the last bit.
"""

from __future__ import annotations

from fractions import Fraction

import sympy as sp
from sympy.printing.precedence import PRECEDENCE, precedence
from sympy.printing.pycode import PythonCodePrinter

from hsdsl.base.functions import FUNCTIONS

LARGEST_PRODUCT = 8

_NAMES = {
    "absolute": "abs",
    "Abs": "abs",
    "minimum": "min",
    "maximum": "max",
    "below": "below",
    "Min": "min",
    "Max": "max",
    **{name: name for name in FUNCTIONS if name not in ("abs", "min", "max", "sqrt", "select")},
}

# SymPy makes these by itself: tan(pi/3 - x) becomes cot(x + pi/6)
_RECIPROCALS = {"cot": "tan", "sec": "cos", "csc": "sin", "coth": "tanh", "sech": "cosh", "csch": "sinh"}


class KernelPrinter(PythonCodePrinter):
    """Printer of the operations of a kernel; it refuses all others."""

    def __init__(self) -> None:
        super().__init__({"fully_qualified_modules": False, "allow_unknown_functions": False})

    def doprint(self, expr):
        """Print an expression; SymPy's own method loads what prints assignments."""
        return self._print(sp.sympify(expr))

    def written(self, value: Fraction) -> str:
        """Print an exact constant."""
        return f"q_{'m' if value < 0 else ''}{abs(value.numerator)}_{value.denominator}"

    def call(self, name: str, arguments: list[str]) -> str:
        """Print a call of a function of kernels."""
        return f"{name}({', '.join(arguments)})"

    def _print_Rational(self, expr):
        return self.written(Fraction(int(expr.p), int(expr.q)))

    _print_Integer = _print_Rational

    def _print_Pi(self, expr):
        return "pi"

    def _print_Exp1(self, expr):
        return "e"

    def _print_NaN(self, expr):
        return "nan"

    # what differentiation leaves where there is no real value: log(-1) in the derivative of (-1)**x
    _print_ImaginaryUnit = _print_ComplexInfinity = _print_Infinity = _print_NegativeInfinity = _print_NaN

    def _print_Function(self, expr):
        if type(expr).__name__ in _RECIPROCALS:
            inverse = self.call(_RECIPROCALS[type(expr).__name__], [self._print(expr.args[0])])
            return f"({self.written(Fraction(1))}/{inverse})"
        return self.call(_NAMES[type(expr).__name__], [self._print(a) for a in expr.args])

    _print_Abs = _print_sign = _print_floor = _print_log = _print_Min = _print_Max = _print_Function

    def _print_Heaviside(self, expr):
        return self.call("heaviside", [self._print(expr.args[0])])

    def _print_Pow(self, expr, rational=False):
        base, exponent = expr.base, expr.exp
        if exponent == sp.Rational(1, 2):
            return self.call("sqrt", [self._print(base)])
        if exponent.is_Integer and 2 <= exponent <= LARGEST_PRODUCT:
            return "(" + "*".join([self.parenthesize(base, PRECEDENCE["Pow"])] * int(exponent)) + ")"
        if exponent.is_Number and exponent < 0:
            return f"({self.written(Fraction(1))}/{self.parenthesize(base**-exponent, PRECEDENCE['Pow'])})"
        return self.call("pow", [self._print(base), self._print(exponent)])

    def _print_Mul(self, expr):
        """Left-to-right: sign, then numerator factors, then one division by the product of the denominators."""
        coefficient, rest = expr.as_coeff_Mul()
        factors = list(sp.Mul.make_args(rest)) if rest is not sp.S.One else []
        below = [f for f in factors if f.is_Pow and f.exp.is_Number and f.exp < 0]
        above = [f for f in factors if f not in below]
        text = self._product(([coefficient] if abs(coefficient) != 1 else []), above, negative=coefficient == -1)
        if below:
            under = [1 / f for f in below]
            divisor = "*".join(self.parenthesize(f, precedence(expr)) for f in under)
            text += f"/({divisor})" if len(under) > 1 else f"/{self.parenthesize(under[0], PRECEDENCE['Pow'])}"
        return text

    def _product(self, coefficients, factors, negative):
        terms = [self._print(c) for c in coefficients]
        terms += [self.parenthesize(f, PRECEDENCE["Mul"]) for f in factors]
        return ("-" if negative else "") + ("*".join(terms) if terms else self.written(Fraction(1)))

    def _print_Add(self, expr, order=None):
        text = ""
        for term in self._as_ordered_terms(expr, order=order):
            piece = self._print(term)
            if not text:
                text = piece
            elif piece.startswith("-"):
                text += f" - {piece[1:]}"
            elif piece.startswith("q_m"):
                text += f" - q_{piece[3:]}"
            else:
                text += f" + {piece}"
        return text

    def _print_And(self, expr):
        word = " and " if isinstance(expr, sp.And) else " or "
        return "(" + word.join(self._print(a) for a in sorted(expr.args, key=sp.default_sort_key)) + ")"

    _print_Or = _print_And

    def _print_Not(self, expr):
        return f"(not {self._print(expr.args[0])})"

    def _print_Relational(self, expr):
        return f"({self._print(expr.lhs)} {expr.rel_op} {self._print(expr.rhs)})"
