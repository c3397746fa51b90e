"""The numbers a run computes with: float64, or mpmath at any precision.

An :class:`Arithmetic` is what generated code and the simulator need to know of a number type. Both types behave the
same where a function has no finite real value: they raise one of :data:`DOMAIN_ERRORS` or return a number that
``isfinite`` refuses.
"""

from __future__ import annotations

import copyreg
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from fractions import Fraction
from functools import cache, cached_property, partial
from typing import Any

Number = Any  # float or mpmath.mpf, as the arithmetic makes them

DOMAIN_ERRORS = (ValueError, OverflowError, ZeroDivisionError)
TIE = 1e-12  # times closer than TIE |t| are the same instant
NOTHING = 2.0**-960  # below this numbers of float64 have no digits left


def repeated(times: Callable[[Any, Any], Any], exponent: int, base: Any) -> Any:
    """A product of equal factors, as in C."""
    if exponent == 1:
        return base
    half = repeated(times, exponent // 2, base)
    square = times(half, half)
    return times(square, base) if exponent % 2 else square


@dataclass(frozen=True, eq=False)
class Arithmetic:
    """A number type: ``float64`` or ``mpmath``, by its ``name``."""

    name: str
    digits: int | None  # decimal digits; None for float64
    bits: int  # of the significand
    unit: Number  # the unit round-off u, 2**-bits
    constant: Callable[[Fraction], Number]  # the nearest number to an exact fraction
    isfinite: Callable[[Number], bool]
    functions: Mapping[str, Any]  # what generated code may call, by name

    @cached_property
    def zero(self) -> Number:
        """Zero of this type."""
        return self.constant(Fraction(0))

    @property
    def most_halvings(self) -> int:
        """Enough halvings, or steps of an iteration that gains as much, from any number to round-off of it."""
        return 16 + 2 * self.bits

    def sqrt(self, x: Number) -> Number:
        """The square root."""
        return self.functions["sqrt"](x)


def below(number: Any, bound: Any, one: Any, other: Any) -> Any:
    """Choose between two numbers."""
    return one if number < bound else other


def _float_sign(x: float) -> float:
    return float(x > 0.0) - float(x < 0.0)  # also of numbers of NumPy, whose truths cannot be subtracted


def _float_heaviside(x: float) -> float:
    return 0.5 * (1.0 + _float_sign(x))


def _float_floor(x: float) -> float:
    return float(math.floor(x))


def _float_constant(value: Fraction) -> float:
    try:
        return float(value)
    except OverflowError:
        return math.inf if value > 0 else -math.inf


# mpmath numbers have no largest one, so a blow-up would go on for ever: bounds on exponents of two, of any number and
# of arguments whose functions grow beyond it
LARGEST_EXPONENT = 2**12
LARGEST_ARGUMENT = {"exp": 13, "sinh": 13, "cosh": 13, "log": LARGEST_EXPONENT, "sqrt": LARGEST_EXPONENT}
_TRIGONOMETRIC = ("sin", "cos", "tan", "asin", "acos", "atan", "atan2")
_HYPERBOLIC = ("sinh", "cosh", "tanh", "asinh", "acosh", "atanh")
_MATH = (*_TRIGONOMETRIC, *_HYPERBOLIC, "exp", "log", "sqrt", "pow")

FLOAT64 = Arithmetic(
    name="float64",
    digits=None,
    bits=53,
    unit=2.0**-53,
    constant=_float_constant,
    isfinite=math.isfinite,
    functions={name: getattr(math, name) for name in _MATH}
    | {
        "frexp": math.frexp,
        "ldexp": math.ldexp,
        "abs": abs,
        "sign": _float_sign,
        "heaviside": _float_heaviside,
        "floor": _float_floor,
        "below": below,
        "min": min,
        "max": max,
        "pi": math.pi,
        "e": math.e,
        "nan": math.nan,
    },
)


def _pickled(digits: int, number: Any) -> tuple[Callable[..., Any], tuple[Any, ...]]:
    return _unpickled, (digits, number._mpf_)


def _unpickled(digits: int, parts: Any) -> Any:
    return multiprecision(digits).zero.context.make_mpf(parts)


@cache
def multiprecision(digits: int) -> Arithmetic:
    """Make mpmath numbers of ``digits`` decimal digits, in a context of their own (no global state is touched)."""
    import mpmath  # pyright: ignore[reportMissingTypeStubs]

    context: Any = mpmath.MPContext()
    context.dps = digits
    copyreg.pickle(context.mpf, partial(_pickled, digits))

    def heaviside(x: Any) -> Any:
        return (1 + context.sign(x)) / 2

    def isfinite(value: Any) -> bool:
        return bool(context.isfinite(value)) and context.mag(value) < LARGEST_EXPONENT

    def real(function: Callable[..., Any], largest: int) -> Callable[..., Any]:
        def checked(*arguments: Any) -> Any:
            if any(context.mag(a) > largest for a in arguments):
                raise OverflowError("an argument beyond all numbers")
            value = function(*arguments)
            if not isinstance(value, context.mpf):  # mpmath leaves the reals where math raises
                raise ValueError("no real value")
            return value

        return checked

    return Arithmetic(
        name="mpmath",
        digits=digits,
        bits=context.prec,
        unit=context.ldexp(1, -context.prec),
        constant=lambda value: context.mpf(value.numerator) / context.mpf(value.denominator),
        isfinite=isfinite,
        functions={
            name: real(getattr(context, "power" if name == "pow" else name), LARGEST_ARGUMENT.get(name, 4096))
            for name in _MATH
        }
        | {
            "frexp": context.frexp,
            "ldexp": context.ldexp,
            "abs": abs,
            "sign": context.sign,
            "heaviside": heaviside,
            "floor": context.floor,
            "below": below,
            "min": min,
            "max": max,
            "pi": +context.pi,
            "e": +context.e,
            "nan": context.nan,
        },
    )
