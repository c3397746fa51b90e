"""Numbers of eighty digits, in a context of their own (mpmath's global one is left alone)."""

from __future__ import annotations

from fractions import Fraction
from typing import Any

from mpmath import MPContext  # pyright: ignore[reportMissingTypeStubs]

from hsdsl.errors import UsageError

Number = Any  # mpmath.mpf of this context
Vector = tuple[Number, ...]

DIGITS = 80
mp: Any = MPContext()
mp.dps = DIGITS


def number(value: Any, what: str = "the number") -> Number:
    """Turn an int, a float (its binary value), decimal text, a fraction or an mpmath number into a finite number.

    Raises
    ------
    UsageError
        It is none of these.
    """
    try:
        exact = Fraction(value) if isinstance(value, (int, float, str, Fraction)) else None
        found = mp.mpf(exact.numerator) / exact.denominator if exact is not None else mp.convert(value)
    except (TypeError, ValueError, OverflowError, ZeroDivisionError):
        found = mp.nan
    if not mp.isfinite(found):
        raise UsageError(f"{what}: a finite number is wanted, not {value!r}")
    return found
