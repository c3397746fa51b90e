# pyright: basic
"""Crossings of guards: points that the flow crosses them at, and proofs that no flow does.

Along a run let the surface function r rise above 0 from a time s on. Where r is continuous, r = 0 at s, in the domain
and with a condition that holds or is at its end. Then, on some piece without kinks:

- the first derivative of r along the flow that is not 0 at s is positive, where derivatives are continuous there;
- and r' > 0 at times as near to s as one likes where r > 0.

One of the two is shown to be impossible on every piece. A derivative of order 2 or more says nothing at the end of a
piece, where the run may go to another one.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from hsdsl.language.system import Edge
from hsdsl.mathematics.decisions.dynamics import Clause, Dynamics
from hsdsl.mathematics.decisions.mode_point import ModePoint, Unsure
from hsdsl.mathematics.decisions.proof import Proof, closed, strict
from hsdsl.mathematics.decisions.question import UNKNOWN, Answer, Constraint, negative, positive, zero
from hsdsl.mathematics.decisions.singularities import breaks, discontinuities
from hsdsl.mathematics.decisions.smooth_pieces import SmoothPiece, pieces

DEEPEST = 6  # derivatives along the flow that are looked at


def uncrossed(dynamics: Dynamics, edge: Edge) -> tuple[str, Proof] | None:
    """Say why no flow crosses the guard of an edge, with the proof; None where that is not known."""
    mode, residual = dynamics.modes[edge.source], dynamics.residual(edge.surface)
    conditions, broken = dynamics.condition(edge), discontinuities(residual)
    if conditions is None or broken is None or residual.free_symbols & dynamics.inputs:
        return None
    domain = dynamics.domain(mode, without=edge)
    inside = [(*domain, *closed(clause)) for clause in conditions]
    proof = Proof(dynamics, mode)
    if not all(proof.never(inside, *clause) for clause in broken):
        return None
    if proof.never(inside, zero(residual)):
        where = "where `if` holds" if edge.condition is not None else "of the mode"
        return f"its surface does not meet the domain {where}", proof
    cut = pieces(residual, dynamics.flow(mode))
    found = [_Part(proof, piece, domain, inside).outcome() for piece in cut] if cut else [None]
    if None in found:
        return None
    along = " or runs along it" if "along" in found else ""
    return f"wherever its surface meets the domain, the flow points back inside{along}", proof


@dataclass(frozen=True)
class _Part:
    """The surface of an edge on one piece."""

    proof: Proof
    piece: SmoothPiece
    domain: Clause
    inside: list[Clause]

    def outcome(self) -> str | None:
        """Say what the flow does wherever the surface is met: ``inward`` or ``along``; None where it may go out."""
        dynamics, piece = self.proof.dynamics, self.piece
        surface = [(zero(piece.residual), *clause, *piece.closed) for clause in self.inside]
        for expr in (piece.residual, *piece.flow.values()):
            broken = breaks(expr)
            if broken is None or not all(self.proof.never(surface, *clause) for clause in broken):
                return None
        expr, first = piece.residual, None
        for _ in range(DEEPEST):
            expr = dynamics.along(expr, piece.flow)
            if expr is None or not self.proof.never(surface, positive(expr)):
                return None
            surface = [(*clause, zero(expr)) for clause in surface]
            if self.proof.never(surface):
                return "inward"
            first = expr if first is None else first
            if expr.is_zero or not self._within(surface):
                break
        return "along" if self._attracts(surface, first) else None

    def _within(self, surface: list[Clause]) -> bool:
        """Whether the piece goes on around every point of the surface where r' = 0."""
        return all(self.proof.never(surface, zero(side)) for side in (*self.piece.sides, *self.piece.zeros))

    def _attracts(self, surface: list[Clause], first: Any) -> bool:
        """Whether r falls, or stays, wherever it is positive, and nothing else ends the domain where r' = 0."""
        if not all(self.proof.never(surface, zero(other.expr)) for other in self.domain):
            return False
        beyond = (*self.domain, *self.piece.closed, positive(self.piece.residual), positive(first))
        return self.proof.never([beyond])


def fires(dynamics: Dynamics, edge: Edge, *more: Constraint) -> Answer:
    """A point of an edge's guard with more constraints, through which the flow goes; inside all else if possible."""
    return _passed(dynamics, edge, dynamics.condition(edge), more)


def passes_by(dynamics: Dynamics, edge: Edge) -> Answer:
    """A point of an edge's surface that the flow goes through where no edge of the mode fires."""
    residual = dynamics.residual(edge.surface)
    alternatives: list[Clause] = [()]
    same: list[Edge] = []
    elsewhere: list[Any] = []
    for other in dynamics.modes[edge.source].edges:
        if dynamics.residual(other.surface) == residual:
            refused = dynamics.condition(other, holds=False)
            if refused is None:
                return UNKNOWN
            same.append(other)
            alternatives = [(*before, *clause) for before in alternatives for clause in refused]
        elif other.condition is not None:
            elsewhere.append(dynamics.residual(other.surface))

    def passes(here: ModePoint) -> bool:
        return all(here.sign(r) != 0 for r in elsewhere) and not any(map(here.will_hold, same))

    for clauses in ([strict(clause) for clause in alternatives], alternatives):
        for more in dict.fromkeys(((), tuple(map(negative, elsewhere)))):
            answer = _passed(dynamics, edge, clauses, more, passes)
            if answer.somewhere:
                return answer
    return UNKNOWN


def _passed(
    dynamics: Dynamics,
    edge: Edge,
    conditions: Sequence[Clause] | None,
    more: tuple[Constraint, ...],
    accepts: Callable[[ModePoint], bool] = lambda _: True,
) -> Answer:
    """An accepted point of an edge's surface with some conditions, through which the flow goes."""
    mode, residual = dynamics.modes[edge.source], dynamics.residual(edge.surface)
    rate = dynamics.rate(mode, residual)
    domain = dynamics.domain(mode, without=edge)
    if rate is None or conditions is None:
        return UNKNOWN
    out = () if rate.is_zero else (positive(rate),)
    for inside in (strict(domain), domain):
        for speed in dict.fromkeys((out, ())):
            clauses = [(zero(residual), *inside, *speed, *clause) for clause in conditions]
            answer = dynamics.ask_any(mode, clauses, *more)
            if answer.somewhere and _goes_out(ModePoint(dynamics, mode, answer.point), edge, accepts):
                return answer
    return UNKNOWN


def _goes_out(here: ModePoint, edge: Edge, accepts: Callable[[ModePoint], bool]) -> bool:
    """Whether the flow goes out of the surface of an edge, and into all else that the point lies on."""
    domain = here.dynamics.domain(here.mode, without=edge)
    try:
        inside = all(here.sign(c.expr) < 0 or here.first(c.expr)[1] < 0 for c in domain)
        return inside and accepts(here) and here.first(here.dynamics.residual(edge.surface))[1] > 0
    except Unsure:
        return False
