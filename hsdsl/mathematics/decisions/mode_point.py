# pyright: basic
"""A point of a mode, and what a run does there next: signs of expressions, derivatives of surfaces, transitions.

Points come from a search, so a value counts as 0 within :data:`NEAR` of the terms that it is the sum of. Where a kink,
a jump or a value that may be 0 decides, nothing is known.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import inf, perm
from typing import Any

import numpy as np
import sympy as sp

from hsdsl.language.expression.scope import symbol
from hsdsl.language.system import TIME, Edge, Mode
from hsdsl.mathematics.decisions.decide import MOST_PARTS
from hsdsl.mathematics.decisions.dynamics import Clause, Dynamics
from hsdsl.mathematics.decisions.search import Constraint, StraightLine, too_large
from hsdsl.mathematics.decisions.singularities import SmoothPiece, breaks, pieces

DEEPEST = 6  # derivatives along the flow that are examined
NEAR = 1e-8
_STEP = 2.0**-13  # of a difference quotient, relative to a name's size
_SMALL = 1e-6  # of how far a name is searched: nothing that is computed with it is more exact than NEAR of that


class Unsure(Exception):
    """What a point decides is not known."""


@dataclass(frozen=True)
class ModePoint:
    """A point of a mode: the values of its states, the inputs and time, by symbol."""

    dynamics: Dynamics
    mode: Mode
    point: Mapping[Any, float]

    def sign(self, expr: Any) -> int:
        """-1, 0 or 1; 0 where round-off and the search's own error may be all there is."""
        value, error = self._valued(expr)
        return 0 if abs(value) <= error else 1 if value > 0 else -1

    def _valued(self, expr: Any) -> tuple[float, float]:
        """A value, and a bound on its part from round-off and the error of the search."""
        names = sorted(expr.free_symbols, key=str)
        program = self.dynamics.remembered(
            ("terms", expr), lambda: StraightLine([expr, *sp.Add.make_args(expr)], names)
        )
        here = np.array([float(self.point[s]) for s in names])
        steps = _STEP * np.diag([self.size(s) for s in names])
        values = program.at(np.vstack([here, here + steps]) if names else np.zeros((1, 0)))
        value, terms, slopes = values[0, 0], values[1:, 0], (values[0, 1:] - values[0, 0]) / _STEP
        if not np.isfinite(value):
            raise Unsure
        return float(value), NEAR * float(max(np.abs(terms).sum(), np.nansum(np.abs(slopes))))

    def changes_sign_nearby(self, expr: Any) -> bool:
        """Whether an expression changes its sign within the error of a point where a derivative vanishes doubly."""
        names = sorted(expr.free_symbols, key=str)
        ranges = [self.dynamics.ranges(self.mode)[s].search for s in names]
        here = np.array([float(self.point[s]) for s in names])
        steps = NEAR**0.5 * np.diag([high - low for low, high in ranges])
        values = StraightLine([expr], names).at(np.vstack([here + steps, here - steps]))
        return not ((values > 0).all() or (values < 0).all())

    def size(self, name: Any) -> float:
        """How large a name's values are: what is known of them is known to a part of that."""
        low, high = self.dynamics.ranges(self.mode)[name].search
        return max(abs(self.point[name]), _SMALL * (high - low))

    def first(self, residual: Any) -> tuple[int, int]:
        """The order and the sign of the first derivative of a surface function along the flow that is not 0.

        Sign 0 where none is, up to order :data:`DEEPEST`. Raises :class:`Unsure` where the flow or the surface has a
        kink or a jump, or depends on an input in a way that is not known. So it does where what the errors of lower
        derivatives hide may outweigh this one, until the next one does.
        """
        piece = self.piece(residual, self.dynamics.flow(self.mode))
        expr, errors = piece.residual, list[float]()
        for order in range(1, DEEPEST + 1):
            expr = self.dynamics.along(expr, piece.flow)
            if expr is None or too_large([expr], MOST_PARTS):
                raise Unsure
            value, error = self._valued(expr)
            if abs(value) > error:
                if any(errors) and not self._outgrows(abs(value), errors, self.dynamics.along(expr, piece.flow)):
                    raise Unsure
                return order, 1 if value > 0 else -1
            errors.append(error)
            if expr.is_zero:
                break
        return DEEPEST, 0

    def _outgrows(self, value: float, errors: Sequence[float], following: Any) -> bool:
        """Whether a derivative outweighs the errors of lower ones before the next derivative outweighs it."""
        order = len(errors) + 1
        bend = 0.0 if following is None or too_large([following], MOST_PARTS) else abs(self._valued(following)[0])
        time = (order + 1) * value / bend if bend else inf
        return all(
            error == 0 or error * perm(order, order - k) < value * time ** (order - k)
            for k, error in enumerate(errors, 1)
        )

    def piece(self, residual: Any, flow: Mapping[Any, Any]) -> SmoothPiece:
        """The piece that the point is inside of, and on which surface and flow have all derivatives here.

        Raises :class:`Unsure` at a kink, and where there may be a jump or an infinite slope.
        """
        for piece in pieces(residual, flow) or ():
            if not piece.zeros and all(self.sign(side) > 0 for side in piece.sides):
                if any(map(self._rough, (piece.residual, *piece.flow.values()))):
                    raise Unsure
                return piece
        raise Unsure

    def _rough(self, expr: Any) -> bool:
        found = breaks(expr)
        return found is None or any(map(self._near, found))

    def _near(self, clause: Clause) -> bool:
        signs = [(self.sign(c.expr), c.relation) for c in clause]
        return all(sign == 0 if relation == "= 0" else sign <= 0 for sign, relation in signs)

    def holds(self, edge: Edge) -> bool:
        """Whether the `if` of an edge holds; raises :class:`Unsure` where a comparison is at its end."""
        return any(map(self._all, self._condition(edge)))

    def _condition(self, edge: Edge) -> list[Clause]:
        clauses = self.dynamics.condition(edge)
        if clauses is None:
            raise Unsure
        return clauses

    def _all(self, clause: Clause) -> bool:
        signs = [self.sign(c.expr) for c in clause]
        if any(sign > 0 for sign in signs):
            return False
        if 0 in signs:
            raise Unsure
        return True

    def will_hold(self, edge: Edge) -> bool:
        """Whether the `if` of an edge holds just after the point, along the flow; raises as :meth:`first` does."""
        return any(all(map(self._will_hold, clause)) for clause in self._condition(edge))

    def _will_hold(self, constraint: Constraint) -> bool:
        sign = self.sign(constraint.expr) or self.first(constraint.expr)[1]
        if constraint.relation == "= 0":
            return sign == 0
        return sign < 0 or (sign == 0 and constraint.relation == "<= 0")

    def after(self, edge: Edge) -> ModePoint:
        """Where an edge leads to from here."""
        target = self.dynamics.modes[edge.target]
        kept = {s: v for s, v in self.point.items() if s is TIME or s in self.dynamics.inputs}
        new = {symbol(s): self.dynamics.value(self.dynamics.placed(r), self.point) for s, r in edge.values.items()}
        if any(value != value for value in new.values()):
            raise Unsure
        return ModePoint(self.dynamics, target, kept | new)

    def next(self) -> Edge | None:
        """The transition that a run makes at once that enters here (M4, M5, M6); None where it flows, or stops."""
        if self.mode.final:
            return None
        signs = {edge: self.sign(self.dynamics.residual(edge.surface)) for edge in self.mode.edges}
        beyond = [edge for edge, sign in signs.items() if sign > 0 and edge.condition is None]
        if beyond:
            return ranked(beyond)[0]
        walls = [self.dynamics.residual(wall) for wall in self.mode.walls]
        if any(self.sign(wall) > 0 for wall in walls):
            return None
        if any(self.sign(wall) == 0 and self.first(wall)[1] >= 0 for wall in walls):
            raise Unsure
        on = (edge for edge in ranked(self.mode.edges) if signs[edge] == 0)
        return next((edge for edge in on if self.crosses(edge)), None)

    def crosses(self, edge: Edge) -> bool:
        """Whether the flow carries a state from here, a point of an edge's surface, through its guard."""
        return self.first(self.dynamics.residual(edge.surface))[1] > 0 and self.holds(edge)


def ranked(edges: Iterable[Edge]) -> list[Edge]:
    """Edges of one mode in the order in which they go where they are reached together (M6)."""
    return sorted(edges, key=lambda edge: -edge.priority)


MOST = 40


def chain(here: ModePoint, edge: Edge) -> Iterator[tuple[Edge, ModePoint]]:
    """Follow an edge and the transitions that are made at the same instant: each with where it leads to.

    Raises :class:`Unsure` where what comes next is not known, or has no end.
    """
    following: Edge | None = edge
    for _ in range(MOST):
        here = here.after(following)
        yield following, here
        following = here.next()
        if following is None:
            return
    raise Unsure


def cycle(here: ModePoint, edge: Edge) -> tuple[Edge, ...] | None:
    """The transitions that follow an edge at one instant without end; None without a known cycle."""
    visited: list[ModePoint] = []
    edges: list[Edge] = []
    try:
        for following, reached in chain(here, edge):
            edges.append(following)
            for k, before in enumerate(visited):
                if same(before, reached):
                    return tuple(edges[k + 1 :])
            visited.append(reached)
    except Unsure:
        return None
    return None


def same(one: ModePoint, other: ModePoint) -> bool:
    """Whether two points agree within the accuracy of a search."""
    if one.mode is not other.mode:
        return False
    pairs = [(one.point[symbol(s)], other.point[symbol(s)], one.size(symbol(s))) for s in one.mode.states]
    return all(abs(a - b) <= NEAR * size for a, b, size in pairs)
