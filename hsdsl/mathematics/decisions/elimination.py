# pyright: basic
"""First step of a decision: elimination of linear equations between polynomials.

Equations that are linear in a name are solved for it and put into the rest. The rest is compared with the bounds that
the constraints give (`rational_bounds`), and a few plain values are tried. There is no search and no general solver.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any

from hsdsl.mathematics.decisions.normal_form import NormalForms
from hsdsl.mathematics.decisions.polynomial import Polynomial, linear_in, number
from hsdsl.mathematics.decisions.question import Constraint, Ranges, SearchRange
from hsdsl.mathematics.decisions.rational_bounds import Contradiction, RationalBounds, Row, bounds_of, holds, tighten


@dataclass
class Reduced:
    """What is left of a question when its linear equations are solved: constraints, and exact bounds of names.

    ``solved`` has names and what they are, in the order of elimination: each in the names that were left then.
    """

    rows: list[Row]
    solved: list[tuple[Any, Polynomial]] = field(default_factory=list)
    bounds: dict[Any, RationalBounds] = field(default_factory=dict)


def reduce(constraints: Sequence[Constraint], normal_forms: NormalForms, ranges: Ranges) -> Reduced | None:
    """Say what is left of a question when its linear equations are solved; None where it has no answer."""
    try:
        reduced = Reduced([(normal_forms.of(c.expr), c.relation) for c in constraints])
        _eliminate(reduced, normal_forms, ranges)
        reduced.bounds = {symbol: r.bounds for symbol, r in ranges.items()}
        tighten(reduced.rows, reduced.bounds)
    except Contradiction:
        return None
    return reduced


def moved(p: Polynomial, reduced: Reduced, normal_forms: NormalForms) -> Polynomial:
    """A polynomial where the equations hold."""
    for symbol, value in reduced.solved:
        p = normal_forms.substituted(p, {symbol: value})
    return p


def _eliminate(reduced: Reduced, normal_forms: NormalForms, ranges: Ranges) -> None:
    reduced.rows = _kept(reduced.rows)
    while True:
        found = _solvable(reduced.rows, ranges)
        if found is None:
            return
        index, symbol, value = found
        reduced.solved.append((symbol, value))
        limits = _limits(value, ranges[symbol])
        rest = [row for i, row in enumerate(reduced.rows) if i != index]
        touched: list[Row] = [(normal_forms.substituted(p, {symbol: value}), r) for p, r in rest if symbol in p.names]
        reduced.rows = [row for row in rest if symbol not in row[0].names] + _kept(touched + limits)


def _solvable(rows: list[Row], ranges: Ranges) -> tuple[int, Any, Polynomial] | None:
    """An equation and the name to solve it for: one without bounds of its own rather than time or an input."""
    best = None
    for index, (p, relation) in enumerate(rows):
        if relation != "= 0":
            continue
        p = _single(p)
        for symbol in sorted(p.names, key=lambda s: (ranges[s].low is not None, s.name)):
            coefficient = linear_in(p, symbol)
            if coefficient is not None:
                this = Polynomial({m: c for m, c in p.terms.items() if not any(a.head is symbol for a, _ in m)})
                rank = (ranges[symbol].low is not None, len(this.terms))
                if best is None or rank < best[0]:
                    best = rank, (index, symbol, this.times(-1 / coefficient))
                break
    return best[1] if best else None


def _single(p: Polynomial) -> Polynomial:
    """A power that vanishes where its base does is replaced by the base."""
    if len(p.terms) == 1:
        ((monomial, _),) = p.terms.items()
        if len(monomial) == 1 and monomial[0][1] > 0:
            atom = monomial[0][0]
            return atom.arguments[0] if atom.kind in ("sum", "root") else Polynomial({((atom, 1),): Fraction(1)})
    return p


def _limits(value: Polynomial, limits: SearchRange) -> list[Row]:
    low: list[Row] = [] if limits.low is None else [(number(limits.low) - value, "<= 0")]
    high: list[Row] = [] if limits.high is None else [(value - number(limits.high), "<= 0")]
    return low + high


def _kept(rows: list[Row]) -> list[Row]:
    """The rows that are not settled by being numbers."""
    kept: list[Row] = []
    for p, relation in dict.fromkeys(rows):
        settled = holds(bounds_of(p, {}), relation) if not p.names else None
        if settled is False:
            raise Contradiction
        if settled is None:
            kept.append((p, relation))
    return kept


def witness(reduced: Reduced, ranges: Ranges) -> dict[Any, float] | None:
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
