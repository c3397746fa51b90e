# pyright: basic
"""Numbers as decimal text and back without loss, for float64 and for mpmath numbers of any precision.

A number of P bits, written by :func:`text` and read at P bits, is the same number again: ceil(P log10 2) + 1 digits are
always enough (Steele and White 1990), and like ``repr`` the text is the shortest that does it.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from decimal import Decimal
from typing import Any

FLOAT_BITS = 53
MOST_DIGITS = 20  # of a number in a formula


def is_multiprecision(x: Any) -> bool:
    """Whether ``x`` is an mpmath number (of any context)."""
    return hasattr(x, "_mpf_")


def is_finite(x: Any) -> bool:
    """Whether a number is neither infinite nor not-a-number."""
    return bool(x.context.isfinite(x)) if is_multiprecision(x) else math.isfinite(x)


def number_of(text: str) -> float | None:
    """The number that a text is, or None."""
    try:
        return float(text)
    except ValueError:
        return None


def bits(numbers: Iterable[Any]) -> int:
    """How many bits hold every one of ``numbers`` exactly, at least those of float64."""
    return max((x._mpf_[3] for x in numbers if is_multiprecision(x)), default=FLOAT_BITS)


def text(x: Any, precision: int = FLOAT_BITS) -> str:
    """Write a number: ``repr`` of a float, and of of an mpmath number the fewest digits that read back.

    Not-a-number and infinities are ``nan``, ``inf`` and ``-inf``.
    """
    if not is_multiprecision(x):
        return repr(float(x))
    if not is_finite(x):
        return repr(float(x))
    from mpmath.libmp import from_str, to_str

    needed = max(precision, x._mpf_[3], FLOAT_BITS)
    enough = math.ceil(needed * math.log10(2)) + 3
    shorter = (str(to_str(x._mpf_, digits)) for digits in range(enough - 4, enough))
    return next((s for s in shorter if from_str(s, needed, "n") == x._mpf_), str(to_str(x._mpf_, enough)))


def read(written: str, precision: int, context: Any) -> Any:
    """Read what :func:`text` wrote, rounded to ``precision`` bits, as a number of an mpmath ``context``."""
    from mpmath.libmp import from_str

    return context.make_mpf(from_str(written, precision, "n"))


def context_of(digits: int) -> Any:
    """Return mpmath's context for ``digits`` decimal digits, the one that runs compute in."""
    from hsdsl.base.numbers.arithmetic import multiprecision

    return multiprecision(digits).zero.context


def short(p: int, q: int) -> tuple[str, int] | None:
    """P/q as decimal digits and a power of ten, zero for usual sizes; None where the digits do not end, or are many."""
    rest = q
    for prime in (2, 5):
        while rest % prime == 0:
            rest //= prime
    digits = Decimal(p) / Decimal(q)
    if rest != 1 or Decimal(digits) * q != p:
        return None
    written = f"{digits.normalize():E}" if not 1e-4 <= abs(p / q) < 1e6 else f"{digits.normalize():f}"
    mantissa, _, exponent = written.partition("E")
    return (mantissa, int(exponent or 0)) if len(written) <= MOST_DIGITS else None
