# pyright: basic
"""The first step of the ladder: exact reasoning with polynomials.

Equations that are linear in a name are solved for it and put into the rest; what is left is compared with bounds that
the constraints themselves give, and a point is built where all that is left is linear. No search, no general solver.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any

from hsdsl.lint.analysis.polynomial import (
    Atom,
    Bounds,
    Monomial,
    Polynomial,
    Ring,
    bounds_of,
    linear_in,
    number,
)
from hsdsl.lint.analysis.question import Constraint, Range, Relation
from hsdsl.lint.analysis.tape import enclosure

Row = tuple[Polynomial, Relation]
_SIGNED = {"sin": (-1, 1), "cos": (-1, 1), "tanh": (-1, 1), "exp": (0, None), "cosh": (1, None), "absolute": (0, None)}
_SIGNED |= {"sign": (-1, 1)}


class Contradiction(Exception):
    """The constraints exclude each other."""


@dataclass
class Reduced:
    """What is left of a question when its linear equations are solved.

    Attributes
    ----------
    rows : list of (polynomial, relation)
        What is still asked.
    solved : list of (symbol, polynomial)
        Names and what they are, in the order of elimination: each in the names that were left then.
    bounds : dict
        Exact bounds of the names that are left.
    """

    rows: list[Row]
    solved: list[tuple[Any, Polynomial]] = field(default_factory=list)
    bounds: dict[Any, Bounds] = field(default_factory=dict)


def reduce(constraints: Sequence[Constraint], ring: Ring, ranges: Mapping[Any, Range]) -> Reduced | None:
    """Say what is left of a question when its linear equations are solved; None where it has no answer."""
    try:
        reduced = Reduced([(ring.of(c.expr), c.relation) for c in constraints])
        _eliminate(reduced, ring, ranges)
        reduced.bounds = {symbol: (r.low, r.high) for symbol, r in ranges.items()}
        _tighten(reduced)
    except Contradiction:
        return None
    return reduced


def contradicts(reduced: Reduced, constraint: Constraint, ring: Ring, ranges: Mapping[Any, Range]) -> bool:
    """Whether one more constraint, an inequality, is found to leave nothing of a question."""
    p = moved(ring.of(constraint.expr), reduced, ring)
    bounds: dict[Any, Bounds] = {symbol: (r.low, r.high) for symbol, r in ranges.items()}
    try:
        _tighten(Reduced([*reduced.rows, *_kept([(p, constraint.relation)])], reduced.solved, bounds))
    except Contradiction:
        return True
    return False


def linear(reduced: Reduced) -> bool:
    """Whether nothing but linear inequalities is left, each of one name or direction."""
    return all(atom.kind == "name" and e == 1 for p, _ in reduced.rows for m in p.terms if m for atom, e in m[:1])


def moved(p: Polynomial, reduced: Reduced, ring: Ring) -> Polynomial:
    """A polynomial where the equations hold."""
    for symbol, value in reduced.solved:
        p = ring.substituted(p, {symbol: value})
    return p


def _eliminate(reduced: Reduced, ring: Ring, ranges: Mapping[Any, Range]) -> None:
    reduced.rows = _kept(reduced.rows)
    while True:
        found = _solvable(reduced.rows, ranges)
        if found is None:
            return
        index, symbol, value = found
        reduced.solved.append((symbol, value))
        limits = _limits(value, ranges[symbol])
        rest = [row for i, row in enumerate(reduced.rows) if i != index]
        touched: list[Row] = [(ring.substituted(p, {symbol: value}), r) for p, r in rest if symbol in p.names]
        reduced.rows = [row for row in rest if symbol not in row[0].names] + _kept(touched + limits)


def _solvable(rows: list[Row], ranges: Mapping[Any, Range]) -> tuple[int, Any, Polynomial] | None:
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


def _limits(value: Polynomial, limits: Range) -> list[Row]:
    rows: list[Row] = []
    if limits.low is not None:
        rows.append((number(limits.low) - value, "<= 0"))
    if limits.high is not None:
        rows.append((value - number(limits.high), "<= 0"))
    return rows


def _kept(rows: list[Row]) -> list[Row]:
    """The rows that are not settled by being numbers."""
    kept: list[Row] = []
    for p, relation in dict.fromkeys(rows):
        holds = _holds(bounds_of(p, _constants), relation) if not p.names else None
        if holds is False:
            raise Contradiction
        if holds is None:
            kept.append((p, relation))
    return kept


def _holds(bounds: Bounds, relation: Relation) -> bool | None:
    low, high = bounds
    if relation == "= 0":
        if low == high == 0:
            return True
        return False if (low is not None and low > 0) or (high is not None and high < 0) else None
    strict = relation == "< 0"
    if high is not None and (high < 0 or (high == 0 and not strict)):
        return True
    if low is not None and (low > 0 or (low == 0 and strict)):
        return False
    return None


def _constants(atom: Atom) -> Bounds:
    return enclosure(atom.head) or (None, None) if atom.kind == "constant" else _by_nature(atom)


def _by_nature(atom: Atom) -> Bounds:
    """What an atom's values always lie between."""
    if atom.kind == "root":
        return Fraction(0), None
    if atom.kind == "call":
        low, high = _SIGNED.get(getattr(atom.head, "__name__", ""), (None, None))
        return None if low is None else Fraction(low), None if high is None else Fraction(high)
    return None, None


def _tighten(reduced: Reduced) -> None:
    """Bound what rows have in common, names among it, and look for contradictions."""
    directions: dict[tuple[tuple[Monomial, Fraction], ...], list[Any]] = {}
    for p, relation in reduced.rows:
        key, level, rising = _direction(p)
        ends = directions.setdefault(key, [None, None])
        if relation == "= 0" or not rising:
            _raise(ends, level, relation == "< 0")
        if relation == "= 0" or rising:
            _lower(ends, level, relation == "< 0")
    for key, (low, high) in directions.items():
        if low is not None and high is not None and (low[0] > high[0] or (low[0] == high[0] and (low[1] or high[1]))):
            raise Contradiction
        ((atom, exponent), *others), *more = key[0][0], *key[1:]
        if atom.kind == "name" and exponent == 1 and not others and not more:
            _narrow(reduced.bounds, atom.head, low and low[0], high and high[0])

    def of_atom(atom: Atom) -> Bounds:
        return reduced.bounds[atom.head] if atom.kind == "name" else _constants(atom)

    for p, relation in reduced.rows:  # of a name alone all is known by now
        if not _is_name(p) and _holds(bounds_of(p, of_atom), relation) is False:
            raise Contradiction


def _is_name(p: Polynomial) -> bool:
    """Whether a polynomial is a multiple of one name, and a constant."""
    monomials = [m for m in p.terms if m]
    if len(monomials) != 1 or len(monomials[0]) != 1:
        return False
    ((atom, exponent),) = monomials[0]
    return atom.kind == "name" and exponent == 1


def _direction(p: Polynomial) -> tuple[tuple[tuple[Monomial, Fraction], ...], Fraction, bool]:
    """A polynomial as a multiple of ``direction - level``, and whether that multiple is positive."""
    terms = sorted(((m, c) for m, c in p.terms.items() if m), key=lambda item: [(atom.index, e) for atom, e in item[0]])
    lead = terms[0][1]
    return tuple((m, c / lead) for m, c in terms), -p.terms.get((), Fraction(0)) / lead, lead > 0


def _raise(ends: list[Any], level: Fraction, strict: bool) -> None:
    if ends[0] is None or (level, strict) > ends[0]:
        ends[0] = (level, strict)


def _lower(ends: list[Any], level: Fraction, strict: bool) -> None:
    if ends[1] is None or (level, not strict) < (ends[1][0], not ends[1][1]):
        ends[1] = (level, strict)


def _narrow(bounds: dict[Any, Bounds], symbol: Any, low: Fraction | None, high: Fraction | None) -> None:
    first, last = bounds[symbol]
    if low is not None and (first is None or low > first):
        first = low
    if high is not None and (last is None or high < last):
        last = high
    if first is not None and last is not None and first > last:
        raise Contradiction
    bounds[symbol] = first, last


def point(reduced: Reduced, ranges: Mapping[Any, Range]) -> dict[Any, float] | None:
    """A point that satisfies everything, where trying a few values exactly finds one."""
    if any(relation == "= 0" for _, relation in reduced.rows):
        return None
    free = [s for s in ranges if s not in dict(reduced.solved)]
    values = {s: _inside(reduced.bounds[s], ranges[s]) for s in free}
    for _ in range(8):
        wrong = [(p, r) for p, r in reduced.rows if _holds(_valued(p, values), r) is not True]
        if not wrong:
            return _complete(values, reduced)
        if not any(_repair(p, values, reduced.bounds) for p, _ in wrong):
            return None
    return None


def _inside(bounds: Bounds, limits: Range) -> Fraction:
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


def _valued(p: Polynomial, values: Mapping[Any, Fraction]) -> Bounds:
    def of_atom(atom: Atom) -> Bounds:
        return (values[atom.head], values[atom.head]) if atom.kind == "name" else _constants(atom)

    return bounds_of(p, of_atom)


def _repair(p: Polynomial, values: dict[Any, Fraction], bounds: Mapping[Any, Bounds]) -> bool:
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
    known: dict[Any, Bounds] = {s: (v, v) for s, v in values.items()}
    for symbol, p in reversed(reduced.solved):
        low, high = bounds_of(p, lambda atom: known[atom.head] if atom.kind == "name" else _constants(atom))
        if low is None or high is None or high - low > Fraction(1, 10**15) * (1 + abs(low)):
            return None
        known[symbol] = low, high
    return {s: float((low + high) / 2) for s, (low, high) in known.items() if low is not None and high is not None}
