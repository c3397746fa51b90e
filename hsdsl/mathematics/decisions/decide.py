# pyright: basic
"""Decision of questions: exact reasoning, then a search for a point, then a proof by branch and bound.

Exact reasoning solves equations that are linear in a name and puts the solution into the rest; compares the rest with
the bounds that the constraints give; and tries a few plain values. An end of a bound is a fraction, or infinite: floats
are never computed with, since a fraction may be too large.

Every step is bounded in operations, not in time, so that an answer is the same on every machine. A model has one budget
for all its questions, after which only exact reasoning goes on.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from functools import reduce
from math import inf
from typing import Any, TypeVar

import numpy as np

from hsdsl.base.errors import Decided
from hsdsl.base.functions import replaced
from hsdsl.mathematics.decisions.polynomial import (
    UNIT,
    Atom,
    Monomial,
    NormalForms,
    Polynomial,
    expression,
    linear_in,
    number,
)
from hsdsl.mathematics.decisions.search import (
    MOST_BOXES,
    NEVER,
    ROUNDS,
    STARTS,
    UNKNOWN,
    Answer,
    Array,
    Constraint,
    NewtonSearch,
    Ranges,
    Relation,
    SearchRange,
    StraightLine,
    enclosure,
    excluded,
    too_large,
)

MOST_PARTS = 1500  # of the expressions of one question
FEWEST_POINTS = 12  # to believe that something is always zero
MOST_WORK = 6_000_000  # operations on numbers a question may cost
WORK_OF_A_MODEL = 400_000_000
OVERHEAD = 400  # operations that one call of NumPy costs as much as
T = TypeVar("T")


@dataclass
class Decider:
    """Decides questions about one model and remembers the answers."""

    normal_forms: NormalForms = field(default_factory=NormalForms)
    left: int = WORK_OF_A_MODEL
    _remembered: dict[Any, Any] = field(default_factory=dict[Any, Any])

    def remembered(self, key: Any, work: Callable[[], T]) -> T:
        """What was worked out under a key before, for rules that need the same."""
        if key not in self._remembered:
            self._remembered[key] = work()
        return self._remembered[key]

    def decide(self, constraints: Sequence[Constraint], ranges: Ranges, prove: bool = False) -> Answer:
        """Answer whether there is a point that satisfies all constraints.

        Their expressions hold the names of ``ranges`` and exact numbers; answers are remembered for that object. Boxes
        are tried only with ``prove``, when `never` matters as much as `somewhere`.
        """
        key = ("decide", tuple(constraints), id(ranges), prove)
        return self.remembered(key, lambda: self._decide(constraints, ranges, prove))

    def _decide(self, constraints: Sequence[Constraint], ranges: Ranges, prove: bool) -> Answer:
        if too_large((c.expr for c in constraints), MOST_PARTS):
            return UNKNOWN
        reduced = self._reduced(constraints, ranges)
        if reduced is None:
            return NEVER
        point = witness(reduced, ranges)
        if point is not None:
            return Answer("somewhere", "symbolic", point)
        solved: dict[Any, Any] = {}  # what was eliminated, in the names that are left
        for symbol, p in reversed(reduced.solved):
            solved[symbol] = replaced(expression(p), dict(solved), {})
        rest = self._rest(constraints, reduced, solved)
        names = sorted({s for c in rest for s in c.expr.free_symbols}, key=lambda s: s.name)
        search = self._search(rest, ranges, reduced, names)
        if search is None:
            return UNKNOWN
        never = Answer("never", "interval", {}, _searched(names, reduced, ranges))
        if excluded(search.program, search.relations, search.low, search.high, 1):
            return never
        found = search.point()
        if found is not None:
            return self._somewhere(dict(zip(names, map(float, found), strict=True)), solved, reduced, ranges)
        return never if prove and self._excluded(search) else UNKNOWN

    def vanishes(self, expr: Any, given: Sequence[Constraint], ranges: Ranges) -> Decided | None:
        """Say how it is known that an expression is zero wherever constraints hold; None where it is not known."""
        if too_large([expr, *(c.expr for c in given)], MOST_PARTS):
            return None
        reduced = self._reduced(given, ranges)
        if reduced is None:
            return None
        p = moved(self.normal_forms.of(expr), reduced, self.normal_forms)
        if not p.terms or any(q in (p, -p) for q, relation in reduced.rows if relation == "= 0"):
            return "symbolic"
        if p.number is not None or (len(reduced.solved) == sum(c.relation == "= 0" for c in given) and _polynomial(p)):
            return None
        points = self.sample(given, ranges)
        if len(points) < FEWEST_POINTS:
            return None
        value, *slopes = StraightLine([expr, *(expr.diff(s) for s in ranges)], list(ranges)).at(points)
        size = np.abs(np.array(slopes)).T * np.maximum(np.abs(points), 1e-3)
        return "sampled" if (np.abs(value) <= 1e-9 * np.maximum(size.sum(axis=1), 1e-6)).all() else None

    def sample(self, given: Sequence[Constraint], ranges: Ranges) -> Array:
        """Points where constraints hold, as many as are found: array (n, names of ranges)."""
        return self.remembered(("sample", tuple(given), id(ranges)), lambda: self._sample(given, ranges))

    def _sample(self, given: Sequence[Constraint], ranges: Ranges) -> Array:
        reduced = self._reduced(given, ranges)
        search = self._search(given, ranges, reduced, list(ranges)) if reduced else None
        return np.zeros((0, len(ranges))) if search is None else search.points()

    def _reduced(self, given: Sequence[Constraint], ranges: Ranges) -> Reduced | None:
        key = ("reduced", tuple(given), id(ranges))
        return self.remembered(key, lambda: reduced_by(given, self.normal_forms, ranges))

    def _rest(self, constraints: Sequence[Constraint], reduced: Reduced, solved: dict[Any, Any]) -> list[Constraint]:
        """What exact reasoning has left, written as it was given where that is possible: bounds are better so."""
        done: dict[Any, Any] = {}
        unsettled = set(reduced.rows)
        rest: list[Constraint] = []
        settled: set[Any] = set()
        for constraint in constraints:
            moved = Constraint(replaced(constraint.expr, solved, done), constraint.relation)
            row = (self.normal_forms.of(moved.expr), moved.relation)
            if row in unsettled and row not in settled:
                settled.add(row)
                rest.append(moved)
        return rest + [Constraint(expression(p), r) for p, r in reduced.rows if (p, r) not in settled]

    def _search(
        self, rest: Sequence[Constraint], ranges: Ranges, reduced: Reduced, names: Sequence[Any]
    ) -> NewtonSearch | None:
        """A search for points; None where that would cost more than there is left."""
        if too_large((c.expr for c in rest), MOST_PARTS):
            return None
        program = StraightLine([c.expr for c in rest], names)
        cost = len(program) * (OVERHEAD + STARTS) * (len(names) + 1) * ROUNDS
        if cost > self.left:
            return None
        self.left -= cost
        low, high = _box(names, reduced, ranges)
        typical = np.array([min(max(ranges[s].typical, a), b) for s, a, b in zip(names, low, high, strict=True)])
        return NewtonSearch(program, tuple(c.relation for c in rest), low, high, typical)

    def _excluded(self, search: NewtonSearch) -> bool:
        length = len(search.program)
        most = min(MOST_BOXES, MOST_WORK // length, self.left // (8 * length))
        self.left -= 8 * length * most
        return most > 0 and excluded(search.program, search.relations, search.low, search.high, most)

    def _somewhere(self, point: dict[Any, float], solved: dict[Any, Any], reduced: Reduced, ranges: Ranges) -> Answer:
        for symbol, limits in ranges.items():
            if symbol not in point and symbol not in solved:
                low, high = map(float, reduced.bounds[symbol])
                point[symbol] = min(max(limits.typical, low), high)
        free = list(point)
        values = StraightLine(solved.values(), free).at(np.array([[point[s] for s in free]]))[:, 0] if solved else ()
        whole = {**point, **dict(zip(solved, map(float, values), strict=True))}
        if not all(np.isfinite(v) for v in whole.values()):
            return UNKNOWN
        return Answer("somewhere", "sampled", {s: whole[s] for s in ranges})


def _box(names: Sequence[Any], reduced: Reduced, ranges: Ranges) -> tuple[Array, Array]:
    """Where to look: between exact bounds, else as far from them as a range is wide, or in the range."""
    ends = np.array([reduced.bounds[symbol] for symbol in names], dtype=float).reshape(-1, 2)
    near, far = np.array([ranges[symbol].search for symbol in names]).reshape(-1, 2).T
    start, end = (np.where(np.isinf(given), own, given) for given, own in zip(ends.T, (near, far), strict=True))
    low = np.where(np.isinf(ends[:, 0]), np.minimum(near, end - (far - near)), start)
    return low, np.where(np.isinf(ends[:, 1]), np.maximum(far, start + (far - near)), end)


def _searched(names: Sequence[Any], reduced: Reduced, ranges: Ranges) -> tuple[tuple[Any, float, float], ...]:
    """How far was looked in names that nothing bounds: an end that the constraints themselves give is none."""
    found: list[tuple[Any, float, float]] = []
    for symbol, low, high in zip(names, *_box(names, reduced, ranges), strict=True):
        without = np.isinf(np.array(reduced.bounds[symbol], dtype=float))
        if without.any():
            found.append((symbol, *np.where(without, (low, high), (-np.inf, np.inf)).tolist()))
    return tuple(found)


def _polynomial(p: Polynomial) -> bool:
    """Whether it is a polynomial of names alone: one that is not zero then vanishes nowhere in the large."""
    return all(atom.kind == "name" and exponent > 0 for monomial in p.terms for atom, exponent in monomial)


@dataclass
class Reduced:
    """What is left of a question when its linear equations are solved: constraints, and exact bounds of names.

    ``solved`` has names and what they are, in the order of elimination: each in the names that were left then.
    """

    rows: list[Row]
    solved: list[tuple[Any, Polynomial]] = field(default_factory=list)
    bounds: dict[Any, RationalBounds] = field(default_factory=dict)


def reduced_by(constraints: Sequence[Constraint], normal_forms: NormalForms, ranges: Ranges) -> Reduced | None:
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


End = Fraction | float
RationalBounds = tuple[End, End]
Row = tuple[Polynomial, Relation]
_EVERYTHING = (-inf, inf)
_ALWAYS = {"sin": (-1, 1), "cos": (-1, 1), "tanh": (-1, 1), "sign": (-1, 1)}
_ALWAYS |= {"exp": (0, inf), "cosh": (1, inf), "absolute": (0, inf)}


class Contradiction(Exception):
    """The constraints exclude each other."""


def bounds_of(p: Polynomial, names: Mapping[Any, RationalBounds]) -> RationalBounds:
    """Bounds of a polynomial from bounds of its names, term by term, exact."""
    low = high = p.terms.get(UNIT, Fraction(0))
    for monomial, coefficient in p.terms.items():
        if monomial:
            parts = (_raised(_of_atom(atom, names), exponent) for atom, exponent in monomial)
            first, last = reduce(_times, parts, (coefficient, coefficient))
            low, high = _plus(low, first), _plus(high, last)
    return low, high


def _of_atom(atom: Atom, names: Mapping[Any, RationalBounds]) -> RationalBounds:
    """What is known of a name, of a constant, or of all values of a function."""
    if atom.kind == "name":
        return names[atom.head]
    if atom.kind == "constant":
        return enclosure(atom.head) or _EVERYTHING
    if atom.kind == "root":
        return Fraction(0), inf
    low, high = _ALWAYS.get(getattr(atom.head, "__name__", ""), _EVERYTHING) if atom.kind == "call" else _EVERYTHING
    return low if low == -inf else Fraction(low), high if high == inf else Fraction(high)


def _plus(a: End, b: End) -> End:
    return a if isinstance(a, float) else b if isinstance(b, float) else a + b


def _product(a: End, b: End) -> End:
    if not (a and b):
        return Fraction(0)
    if isinstance(a, float) or isinstance(b, float):
        return inf if (a > 0) == (b > 0) else -inf
    return a * b


def _times(left: RationalBounds, right: RationalBounds) -> RationalBounds:
    corners = [_product(a, b) for a in left for b in right]
    return min(corners), max(corners)


def _raised(base: RationalBounds, exponent: int) -> RationalBounds:
    low, high = base
    if exponent < 0:
        if low <= 0 <= high:
            return (Fraction(0), inf) if exponent % 2 == 0 else _EVERYTHING
        low, high = (Fraction(0) if isinstance(end, float) else 1 / end for end in (high, low))
    ends = low ** abs(exponent), high ** abs(exponent)
    if exponent % 2:
        return ends
    return Fraction(0) if low <= 0 <= high else min(ends), max(ends)


def holds(bounds: RationalBounds, relation: Relation) -> bool | None:
    """Whether a sign is known to hold, or not to hold, within bounds; None where they do not say."""
    low, high = bounds
    if relation == "= 0":
        return True if low == high == 0 else False if low > 0 or high < 0 else None
    strict = relation == "< 0"
    if high < 0 or (high == 0 and not strict):
        return True
    return False if low > 0 or (low == 0 and strict) else None


def tighten(rows: Sequence[Row], bounds: dict[Any, RationalBounds]) -> None:
    """Narrow ``bounds`` by what rows say of names; raise :class:`Contradiction` where they exclude each other."""
    # Of each direction the largest lower end, with whether it is open, and the least upper one: with whether closed.
    directions: dict[tuple[tuple[Monomial, Fraction], ...], list[tuple[End, bool]]] = {}
    for p, relation in rows:
        key, level, rising = _direction(p)
        ends = directions.setdefault(key, [(-inf, False), (inf, True)])
        if relation == "= 0" or not rising:
            ends[0] = max(ends[0], (level, relation == "< 0"))
        if relation == "= 0" or rising:
            ends[1] = min(ends[1], (level, relation != "< 0"))
    for key, ((low, is_open), (high, closed)) in directions.items():
        if low > high or (low == high and (is_open or not closed)):
            raise Contradiction
        if (name := _name(key)) is not None:
            first, last = bounds[name]
            bounds[name] = max(first, low), min(last, high)
            if bounds[name][0] > bounds[name][1]:
                raise Contradiction
    for p, relation in rows:  # of a name alone all is known by now
        if (
            _name([item for item in p.terms.items() if item[0]]) is None
            and holds(bounds_of(p, bounds), relation) is False
        ):
            raise Contradiction


def _name(terms: Sequence[tuple[Monomial, Fraction]]) -> Any | None:
    """The name that terms are a multiple of."""
    if len(terms) != 1 or len(terms[0][0]) != 1:
        return None
    ((atom, exponent),) = terms[0][0]
    return atom.head if atom.kind == "name" and exponent == 1 else None


def _direction(p: Polynomial) -> tuple[tuple[tuple[Monomial, Fraction], ...], Fraction, bool]:
    """A polynomial as a multiple of ``direction - level``, and whether that multiple is positive."""
    terms = sorted(((m, c) for m, c in p.terms.items() if m), key=lambda item: [(atom.index, e) for atom, e in item[0]])
    lead = terms[0][1]
    return tuple((m, c / lead) for m, c in terms), -p.terms.get(UNIT, Fraction(0)) / lead, lead > 0
