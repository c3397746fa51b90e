# pyright: basic
"""Decision of questions: exact reasoning, then a search for a point, then a proof by branch and bound.

Every step is bounded in operations, not in time, so that an answer is the same on every machine. A model has one budget
for all its questions, after which only exact reasoning goes on.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, TypeVar

import numpy as np

from hsdsl.base.errors import Decided
from hsdsl.base.functions import replaced
from hsdsl.mathematics.decisions import elimination
from hsdsl.mathematics.decisions.elimination import Reduced
from hsdsl.mathematics.decisions.newton_search import MOST_BOXES, ROUNDS, STARTS, NewtonSearch, excluded
from hsdsl.mathematics.decisions.normal_form import NormalForms, expression
from hsdsl.mathematics.decisions.polynomial import Polynomial
from hsdsl.mathematics.decisions.question import NEVER, UNKNOWN, Answer, Constraint, Ranges
from hsdsl.mathematics.decisions.straight_line_program import Array, StraightLine, too_large

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
        point = elimination.witness(reduced, ranges)
        if point is not None:
            return Answer("somewhere", "symbolic", point)
        return self._numerically(constraints, ranges, reduced, prove)

    def vanishes(self, expr: Any, given: Sequence[Constraint], ranges: Ranges) -> Decided | None:
        """Say how it is known that an expression is zero wherever constraints hold; None where it is not known."""
        if too_large([expr, *(c.expr for c in given)], MOST_PARTS):
            return None
        reduced = self._reduced(given, ranges)
        if reduced is None:
            return None
        p = elimination.moved(self.normal_forms.of(expr), reduced, self.normal_forms)
        if not p.terms or any(q in (p, -p) for q, relation in reduced.rows if relation == "= 0"):
            return "symbolic"
        if p.number is not None or (len(reduced.solved) == sum(c.relation == "= 0" for c in given) and _polynomial(p)):
            return None
        points = self.sample(given, ranges)
        if len(points) < FEWEST_POINTS:
            return None
        program = StraightLine([expr, *(expr.diff(s) for s in ranges)], list(ranges))
        value, *slopes = program.at(points)
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
        return self.remembered(key, lambda: elimination.reduce(given, self.normal_forms, ranges))

    def _numerically(self, constraints: Sequence[Constraint], ranges: Ranges, reduced: Reduced, prove: bool) -> Answer:
        solved = _solutions(reduced)
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


def _solutions(reduced: Reduced) -> dict[Any, Any]:
    """What was eliminated, in the names that are left."""
    found: dict[Any, Any] = {}
    for symbol, p in reversed(reduced.solved):
        found[symbol] = replaced(expression(p), dict(found), {})
    return found


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
