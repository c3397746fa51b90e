# pyright: basic
"""Do simultaneous transitions commute?

Where a run reaches several guards at one instant, each of their transitions may be taken first. Then all follow that
fire at the same instant (M4, M5, M6). The transitions commute where every order leads to the same point: the order
does not matter, as the convergence theorem asks for.

This question is answered in three places, everywhere by `commute`:

- here for a model, before any run. Numbers from one point can show that the order matters there. Expressions for all
  points where guards overlap can prove that it does not;
- in `hsdsl.engine.simulate.verdict.commutation` for what a run reached together;
- in `hsdsl/engine/runtime/c/screen_places.c` for the same in C, which leaves undecided what it is not sure of.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

from hsdsl.base.functions import replaced
from hsdsl.language.expression.scope import symbol
from hsdsl.language.system import Edge, Mode, Surface
from hsdsl.mathematics.decisions.dynamics import Clause, Dynamics
from hsdsl.mathematics.decisions.mode_point import ModePoint, Unsure, ranked
from hsdsl.mathematics.decisions.proof import Proof, strict
from hsdsl.mathematics.decisions.question import UNKNOWN, Answer, at_most_zero, positive, zero
from hsdsl.mathematics.decisions.singularities import breaks
from hsdsl.mathematics.decisions.smooth_pieces import KINKED, influencing
from hsdsl.mathematics.decisions.zero_time_cycle import chain, same

DEEPEST = 3  # transitions at one instant that are followed


def overlap_of(dynamics: Dynamics, first: Edge, second: Edge) -> tuple[Clause, ...]:
    """Where two guards of a mode overlap, as alternatives."""
    one, other = dynamics.guard(first) or (), dynamics.guard(second) or ()
    return tuple(tuple(dict.fromkeys((*a, *b))) for a, b in product(one, other))


def speeds(dynamics: Dynamics, first: Edge, second: Edge) -> Clause:
    """That the flow goes out of both surfaces with a rate above 0, where that is not so everywhere."""
    mode = dynamics.modes[first.source]
    rates = (dynamics.rate(mode, dynamics.residual(edge.surface)) for edge in (first, second))
    return tuple(positive(rate) for rate in rates if rate is not None and not rate.is_number)


def meeting(dynamics: Dynamics, first: Edge, second: Edge, overlap: Clause) -> Answer:
    """A point of an overlap where the flow goes out through both guards, and through none that goes before both."""
    mode = dynamics.modes[first.source]
    out = speeds(dynamics, first, second)
    others = [e.surface for e in mode.edges if e.condition is None and e not in (first, second)]
    inside = strict(at_most_zero(dynamics.residual(surface)) for surface in (*others, *mode.walls))
    for more in dict.fromkeys(((*out, *inside), out, ())):
        answer = dynamics.ask(mode, (*overlap, *more))
        if answer.somewhere and _meets(ModePoint(dynamics, mode, answer.point), first, second):
            return answer
    return UNKNOWN


def _meets(here: ModePoint, first: Edge, second: Edge) -> bool:
    """Whether one of two edges goes first at a point; also where a kink leaves that open."""
    for edge in ranked(here.mode.edges):
        try:
            on = here.sign(here.dynamics.residual(edge.surface)) == 0
            goes = on and (edge.condition is None or here.holds(edge)) and _leaves(here, edge)
        except Unsure:
            goes = edge in (first, second)
        if goes and edge not in (first, second):
            return False
        if goes:
            break
    return all(_leaves(here, edge) for edge in (first, second))


def _leaves(here: ModePoint, edge: Edge) -> bool:
    try:
        return here.first(here.dynamics.residual(edge.surface))[1] > 0
    except Unsure:
        return True


def matters(here: ModePoint, first: Edge, second: Edge) -> bool | None:
    """Whether the two orders lead from a point to different ones, followed with numbers; None where that is not known.

    They end where nothing more happens at that instant. Two that pass one point have no difference from there on.
    """
    try:
        one, other = ([reached for _, reached in chain(here, edge)] for edge in (first, second))
    except Unsure:
        return None
    return not any(same(a, b) for a in one for b in other)


def commute(dynamics: Dynamics, first: Edge, second: Edge, overlaps: Sequence[Clause]) -> Proof | None:
    """The proof that both orders lead to one mode with the same states at one instant from all points of overlaps."""
    proof = Proof(dynamics, dynamics.modes[first.source])
    for overlap in overlaps:
        here = _Overlap(proof, overlap)
        one, other = ([here.start(edge)] for edge in (first, second))
        while not any(here.same(a, b) for a in one for b in other):
            new = [list(here.following(arrivals[-1])) for arrivals in (one, other)]
            if not any(new) or len(one) > DEEPEST:
                return None
            one, other = one + new[0], other + new[1]
    return proof


@dataclass(frozen=True)
class Arrival:
    """A mode, and its states as expressions of those before."""

    mode: Mode
    moves: dict[Any, Any]

    def carried(self, expr: Any) -> Any:
        """An expression of its states, in those before."""
        return replaced(expr, self.moves, {})


@dataclass(frozen=True)
class _Overlap:
    """All points on two guards at once."""

    proof: Proof
    clause: Clause

    def start(self, edge: Edge) -> Arrival:
        """What an edge leads to from there."""
        return self._after(edge, {})

    def _after(self, edge: Edge, moves: dict[Any, Any]) -> Arrival:
        dynamics, done = self.proof.dynamics, {}
        values = (replaced(dynamics.placed(value), moves, done) for value in edge.reset)
        states = zip(map(symbol, edge.target_states), values, strict=True)
        return Arrival(dynamics.modes[edge.target], {s: value for s, value in states if s != value})

    def same(self, one: Arrival, other: Arrival) -> bool:
        """Whether two arrivals are known to be one."""
        pairs = ((one.carried(s), other.carried(s)) for s in map(symbol, one.mode.states))
        return one.mode is other.mode and all(a == b or self._vanishes(a - b) for a, b in pairs)

    def _vanishes(self, expr: Any) -> bool:
        return self.proof.dynamics.vanishes(self.proof.mode, expr, self.clause) == "symbolic"

    def _never(self, *more: Any) -> bool:
        return self.proof.never([self.clause], *more)

    def following(self, here: Arrival) -> Iterator[Arrival]:
        """What is sure to be made next at the same instant (M4, M5, M6): nothing where that is not sure."""
        for edge in ranked(here.mode.edges) if not here.mode.final else ():
            if edge.condition is None and self._known(here, edge.surface, beyond=True):
                yield self._after(edge, here.moves)
                return
            if edge.condition is None and not self._never(positive(self._residual(here, edge.surface))):
                return
        if not all(self._stays(here, wall) for wall in here.mode.walls):
            return
        for edge in ranked(here.mode.edges) if not here.mode.final else ():
            if self._known(here, edge.surface, beyond=False) and self._holds(here, edge):
                yield self._after(edge, here.moves)
                return
            if not self._stays(here, edge.surface):
                return

    def _residual(self, here: Arrival, surface: Surface) -> Any:
        return here.carried(self.proof.dynamics.residual(surface))

    def _rate(self, here: Arrival, surface: Surface) -> Any | None:
        """The rate after arrival; None where surface and flow are not known to be smooth."""
        dynamics = self.proof.dynamics
        residual = dynamics.residual(surface)
        smooth = (residual, *influencing(residual, dynamics.flow(here.mode)).values())
        broken = [breaks(expr) for expr in smooth]
        if None in broken or any(expr.has(*KINKED) for expr in smooth):
            return None
        moved = (tuple(c.along(here.carried(c.expr)) for c in clause) for clauses in broken for clause in clauses or ())
        rate = dynamics.rate(here.mode, residual) if all(self._never(*clause) for clause in moved) else None
        return None if rate is None else here.carried(rate)

    def _known(self, here: Arrival, surface: Surface, beyond: bool) -> bool:
        """Whether all arrivals are beyond a surface; else, whether all are on it and the flow goes out."""
        residual = self._residual(here, surface)
        if beyond:
            return self._never(at_most_zero(residual))
        rate = self._rate(here, surface) if self._vanishes(residual) else None
        return rate is not None and self._never(at_most_zero(rate))

    def _stays(self, here: Arrival, surface: Surface) -> bool:
        """Whether no arrival is beyond a surface, or on it where the flow does not lead inside."""
        residual = self._residual(here, surface)
        if not self._never(positive(residual)):
            return False
        if self._never(zero(residual)):
            return True
        rate = self._rate(here, surface)
        return rate is not None and self._never(zero(residual), at_most_zero(-rate))

    def _holds(self, here: Arrival, edge: Edge) -> bool:
        refused = self.proof.dynamics.condition(edge, holds=False)
        moved = [tuple(c.along(here.carried(c.expr)) for c in clause) for clause in refused or ()]
        return refused is not None and all(self._never(*clause) for clause in moved)
