# pyright: basic, reportArgumentType=false, reportAttributeAccessIssue=false, reportOperatorIssue=false, reportAssignmentType=false, reportIncompatibleMethodOverride=false, reportCallIssue=false
"""The functions of the language, as SymPy functions.

The smooth ones are SymPy's own, but for atan2 and the hyperbolic three: SymPy asks whether they are real by splitting
their argument into real and imaginary parts, which in a nest of them takes for ever; ours are real. The kinked and
jumping ones (abs, sign, min, max, floor) are classes of our own: SymPy's rewrite themselves, and differentiate into
objects no kernel has (DiracDelta, re, im). Ours stay as written, fold fractions, and differentiate almost everywhere:
abs' = sign, sign' = floor' = 0, max' picks the larger side. Other constants are left to the kernel: to tell which of
two sums of roots is larger can take SymPy for ever.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import sympy as sp
from sympy.core.cache import cacheit


class _Kinked(sp.Function):
    """A function of ours: it folds fractions by one of SymPy's, and its derivative holds almost everywhere."""

    is_real = is_extended_real = is_finite = True
    fold: object

    @cacheit
    def __new__(cls, *arguments, **options):
        """Make one without what SymPy makes of each function: a set of how many arguments it takes."""
        arguments = tuple(map(sp.sympify, arguments))
        known = cls.folded(*arguments) if options.get("evaluate", True) else None
        return sp.Basic.__new__(cls, *arguments) if known is None else known

    @classmethod
    def folded(cls, *arguments):
        """The value of fractions."""
        return cls.fold(*arguments) if all(x.is_Rational for x in arguments) else None

    def fdiff(self, argindex=1):
        """The derivative."""
        return sp.S.Zero


class absolute(_Kinked):
    """|x|."""

    nargs, fold = 1, sp.Abs

    def fdiff(self, argindex=1):
        """The sign of x."""
        return sign(self.args[0])


class sign(_Kinked):
    """-1, 0 or 1."""

    nargs, fold = 1, sp.sign


class floor(_Kinked):
    """The largest integer not above x."""

    nargs, fold = 1, sp.floor


class minimum(_Kinked):
    """The smaller of two."""

    nargs, fold = 2, sp.Min

    def fdiff(self, argindex=1):
        """1 or 0; half where both are equal."""
        x, y = self.args
        return (1 - (1 if argindex == 1 else -1) * sign(x - y)) / 2


class maximum(_Kinked):
    """The larger of two."""

    nargs, fold = 2, sp.Max

    def fdiff(self, argindex=1):
        """1 or 0; half where both are equal."""
        x, y = self.args
        return (1 + (1 if argindex == 1 else -1) * sign(x - y)) / 2


class below(_Kinked):
    """The third of four where the first is below the second, a number; else the fourth.

    The first is constant along a flow: the number of a part's mode, or a truth in a reset. So it jumps nowhere, but for
    what `select` chooses by, which is a sign.
    """

    nargs = 4

    @classmethod
    def folded(cls, number, bound, one, other):
        """Choose where the number is known."""
        if one == other:
            return one
        return (one if number < bound else other) if number.is_Number else None

    def _eval_derivative(self, s):
        number, bound, one, other = self.args
        return below(number, bound, one.diff(s), other.diff(s))


class solution(sp.Function):
    """Unknown i of n linear equations A x = b, of i, n, the entries of A row by row, and b.

    It is written out by `hsdsl.mathematics.lower`, and so no function of a kernel.
    """

    is_real = is_extended_real = is_finite = True

    @property
    def system(self):
        """The place of the unknown, the rows of A, and b."""
        i, n = int(self.args[0]), int(self.args[1])
        entries, constants = self.args[2 : 2 + n * n], self.args[2 + n * n :]
        return i, tuple(entries[k * n : k * n + n] for k in range(n)), tuple(constants)

    def fdiff(self, argindex=1):
        """By b_r the entry i, r of the inverse of A; by A_rc minus that times unknown c."""
        _, rows, _ = self.system
        n, place = len(rows), argindex - 3
        if place < 0:
            return sp.S.Zero
        r, c = divmod(place, n) if place < n * n else (place - n * n, None)
        inverse = solution(*self.args[: 2 + n * n], *[sp.S.One if k == r else sp.S.Zero for k in range(n)])
        return inverse if c is None else -inverse * solution(sp.Integer(c), *self.args[1:])


class sinh(sp.sinh):
    """The hyperbolic sine, real."""

    is_real = is_finite = True

    def fdiff(self, argindex=1):
        return cosh(self.args[0])

    def _eval_is_unknown(self):
        return None

    _eval_is_positive = _eval_is_negative = _eval_is_zero = _eval_is_unknown


class cosh(sp.cosh):
    """The hyperbolic cosine, real."""

    is_real = is_finite = is_positive = True

    def fdiff(self, argindex=1):
        return sinh(self.args[0])


class tanh(sp.tanh):
    """The hyperbolic tangent, real."""

    is_real = is_finite = True

    def fdiff(self, argindex=1):
        return 1 - tanh(self.args[0]) ** 2

    def _eval_is_unknown(self):
        return None

    _eval_is_positive = _eval_is_negative = _eval_is_zero = _eval_is_unknown


class atan2(sp.atan2):
    """The angle of a point (y, x), real: SymPy's is a complex logarithm where it cannot tell the sign of a constant."""

    is_real = is_finite = True

    @classmethod
    def eval(cls, y, x):
        """Fold as SymPy does, where the result is real as it stands."""
        angle = sp.atan2(y, x)
        return None if angle.has(sp.atan2, sp.I, sp.Piecewise, sp.Heaviside) else angle


def power(base, exponent):
    """``base**exponent``; a power of a power stays as it is.

    To know whether it may multiply the exponents, SymPy splits the inner base into real and imaginary parts, and for
    that it multiplies powers out.
    """
    kept = base.is_Pow and not exponent.is_Integer
    return sp.Pow(base, exponent, evaluate=False) if kept else sp.Pow(base, exponent)


def rebuilt(expr, arguments):
    """An expression with other arguments, made as :func:`power` makes powers.

    Which of two expressions is larger SymPy is not asked: it splits both into real and imaginary parts.
    """
    if expr.is_Relational and arguments[0] != arguments[1] and not all(side.is_number for side in arguments):
        return expr.func(*arguments, evaluate=False)
    return power(*arguments) if expr.is_Pow else expr.func(*arguments)


def as_written(expr: Any, arguments: Sequence[Any]) -> Any:
    """An expression with other arguments in the same places: nothing is simplified, no operand is moved."""
    if expr.is_Add or expr.is_Mul:
        return expr.func._from_args(arguments)
    if tuple(arguments) == expr.args:
        return expr
    return sp.Pow(*arguments, evaluate=False) if expr.is_Pow else expr.func(*arguments)


def renamed(expr: Any, names: Mapping[Any, Any], done: dict[Any, Any]) -> Any:
    """An expression over other symbols, as it is written; ``done`` is kept as in :func:`replaced`.

    It is what the same steps make of these symbols, if their names are in the same order.
    """
    if not expr.args:
        return names.get(expr, expr)
    if expr not in done:
        done[expr] = as_written(expr, [renamed(a, names, done) for a in expr.args])
    return done[expr]


def replaced(expr: Any, mapping: Mapping[Any, Any], done: dict[Any, Any]) -> Any:
    """Replace symbols, visiting every shared part once; ``done`` is kept between calls with one mapping."""
    if not (parts := expr.args):
        return mapping.get(expr, expr)
    if (found := done.get(expr)) is None:
        args = tuple(replaced(a, mapping, done) for a in parts)
        found = done[expr] = expr if args == parts else rebuilt(expr, args)
    return found


def rewritten(expr: Any, change: Callable[[Any], Any], done: dict[Any, Any]) -> Any:
    """Change every part of an expression after its own parts, each once; ``done`` is kept as in :func:`replaced`."""
    if not expr.args:
        return expr
    if expr not in done:
        args = tuple(rewritten(a, change, done) for a in expr.args)
        done[expr] = change(expr if args == expr.args else rebuilt(expr, args))
    return done[expr]


# name in the language: (SymPy function, fewest arguments, most arguments; None: any number from the fewest up)
FUNCTIONS: dict[str, tuple[object, int, int | None]] = {
    **{name: (getattr(sp, name), 1, 1) for name in ("sin", "cos", "tan", "asin", "acos", "atan")},
    "atan2": (atan2, 2, 2),
    **{function.__name__: (function, 1, 1) for function in (sinh, cosh, tanh)},
    **{name: (getattr(sp, name), 1, 1) for name in ("asinh", "acosh", "atanh", "exp", "log", "sqrt")},
    "abs": (absolute, 1, 1),
    "sign": (sign, 1, 1),
    "floor": (floor, 1, 1),
    "min": (minimum, 2, None),
    "max": (maximum, 2, None),
    "select": (below, 3, 3),  # of a number, and what is chosen where it is positive and where not
}
CONSTANTS = {"pi": sp.pi}
