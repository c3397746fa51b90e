# pyright: basic
"""A point for what exact reasoning has left: a few plain values, tried exactly."""

from __future__ import annotations

from collections.abc import Mapping
from fractions import Fraction
from typing import Any

from hsdsl.lint.analysis.elimination import Reduced
from hsdsl.lint.analysis.polynomial import Polynomial, linear_in
from hsdsl.lint.analysis.question import Ranges, SearchRange
from hsdsl.lint.analysis.rational_bounds import RationalBounds, bounds_of, holds


def point(reduced: Reduced, ranges: Ranges) -> dict[Any, float] | None:
    """A point that satisfies everything, where trying a few values exactly finds one."""
    if any(relation == "= 0" for _, relation in reduced.rows):
        return None
    free = [s for s in ranges if s not in dict(reduced.solved)]
    values = {s: _inside(reduced.bounds[s], ranges[s]) for s in free}
    for _ in range(8):
        wrong = [(p, r) for p, r in reduced.rows if holds(_valued(p, values), r) is not True]
        if not wrong:
            return _complete(values, reduced)
        if not any(_repair(p, values, reduced.bounds) for p, _ in wrong):
            return None
    return None


def _inside(bounds: RationalBounds, limits: SearchRange) -> Fraction:
    """A plain value within bounds, the typical one if it can be."""
    low, high = bounds
    typical = Fraction(limits.typical)
    if low < typical < high or (bounds == limits.bounds and low <= typical <= high):  # nothing but its own range
        return typical
    if isinstance(low, Fraction) and isinstance(high, Fraction):
        return (low + high) / 2
    return low + 1 if isinstance(low, Fraction) else Fraction(high) - 1


def _valued(p: Polynomial, values: Mapping[Any, Fraction]) -> RationalBounds:
    return bounds_of(p, {name: (values[name], values[name]) for name in p.names})


def _repair(p: Polynomial, values: dict[Any, Fraction], bounds: Mapping[Any, RationalBounds]) -> bool:
    """Move one name so that a linear constraint holds with room to spare."""
    low, high = _valued(p, values)
    if isinstance(low, float) or isinstance(high, float):
        return False
    for symbol in sorted(p.names, key=lambda s: s.name):
        coefficient = linear_in(p, symbol)
        if coefficient is None or symbol not in values:
            continue
        first, last = bounds[symbol]
        edge = values[symbol] - high / coefficient
        far = edge - 1 if coefficient > 0 else edge + 1
        if isinstance(first, Fraction) and isinstance(last, Fraction):
            far = (edge + (first if coefficient > 0 else last)) / 2
        if first <= far <= last:
            values[symbol] = far
            return True
    return False


def _complete(values: dict[Any, Fraction], reduced: Reduced) -> dict[Any, float] | None:
    """Put values into what was eliminated, last first."""
    known: dict[Any, RationalBounds] = {s: (v, v) for s, v in values.items()}
    for symbol, p in reversed(reduced.solved):
        low, high = known[symbol] = bounds_of(p, known)
        if isinstance(low, float) or isinstance(high, float) or high - low > Fraction(1, 10**15) * (1 + abs(low)):
            return None
    return {s: float((low + high) / 2) for s, (low, high) in known.items()}
