# pyright: basic
"""A point for what exact reasoning has left: a few plain values, tried exactly."""

from __future__ import annotations

from collections.abc import Mapping
from fractions import Fraction
from typing import Any

from hsdsl.lint.analysis.elimination import Reduced
from hsdsl.lint.analysis.polynomial import Atom, Polynomial, linear_in
from hsdsl.lint.analysis.question import Ranges, SearchRange
from hsdsl.lint.analysis.rational_bounds import RationalBounds, bounds_of, holds, of_constant


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
    if (low is None or low < typical) and (high is None or typical < high):
        return typical
    if bounds == (limits.low, limits.high) and low is not None and high is not None and low <= typical <= high:
        return typical  # nothing but its own range holds it
    if low is not None and high is not None:
        return (low + high) / 2
    return low + 1 if low is not None else high - 1 if high is not None else typical


def _valued(p: Polynomial, values: Mapping[Any, Fraction]) -> RationalBounds:
    def of_atom(atom: Atom) -> RationalBounds:
        return (values[atom.head], values[atom.head]) if atom.kind == "name" else of_constant(atom)

    return bounds_of(p, of_atom)


def _repair(p: Polynomial, values: dict[Any, Fraction], bounds: Mapping[Any, RationalBounds]) -> bool:
    """Move one name so that a linear constraint holds with room to spare."""
    low, high = _valued(p, values)
    if low is None or high is None:
        return False
    for symbol in sorted(p.names, key=lambda s: s.name):
        coefficient = linear_in(p, symbol)
        if coefficient is None or symbol not in values:
            continue
        first, last = bounds[symbol]
        edge = values[symbol] - high / coefficient
        far = edge - 1 if coefficient > 0 else edge + 1
        if first is not None and last is not None:
            far = (edge + (first if coefficient > 0 else last)) / 2
        if (first is None or first <= far) and (last is None or far <= last):
            values[symbol] = far
            return True
    return False


def _complete(values: dict[Any, Fraction], reduced: Reduced) -> dict[Any, float] | None:
    """Put values into what was eliminated, last first."""
    known: dict[Any, RationalBounds] = {s: (v, v) for s, v in values.items()}
    for symbol, p in reversed(reduced.solved):
        low, high = bounds_of(p, lambda atom: known[atom.head] if atom.kind == "name" else of_constant(atom))
        if low is None or high is None or high - low > Fraction(1, 10**15) * (1 + abs(low)):
            return None
        known[symbol] = low, high
    return {s: float((low + high) / 2) for s, (low, high) in known.items() if low is not None and high is not None}
