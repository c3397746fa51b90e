# pyright: basic
"""Constants as numbers, to know that they have a finite real value. Bounded: nothing here grows with a value."""

from __future__ import annotations

from typing import Any

import mpmath
import sympy as sp

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
    if not base and exponent < 0:
        return NAN
    return _guarded(_context.power, [base, exponent])


def apply(function: str, arguments: list[Any]) -> Any:
    """A function of the language; NaN outside its real domain."""
    if any(a is None for a in arguments):
        return None
    return _guarded(_FUNCTIONS.get(function) or getattr(_context, function), arguments)


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
