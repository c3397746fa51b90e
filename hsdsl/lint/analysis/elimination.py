# pyright: basic
"""First step of a decision: elimination of linear equations between polynomials.

Equations that are linear in a name are solved for it and put into the rest. The rest is compared with the bounds that
the constraints give (`rational_bounds`). There is no search and no general solver.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any

from hsdsl.lint.analysis.normal_form import NormalForms
from hsdsl.lint.analysis.polynomial import Polynomial, linear_in, number
from hsdsl.lint.analysis.question import Constraint, Ranges, SearchRange
from hsdsl.lint.analysis.rational_bounds import Contradiction, RationalBounds, Row, bounds_of, holds, tighten


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
