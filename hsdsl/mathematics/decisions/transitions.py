# pyright: basic
"""Transitions of a model in general: crossings of guards, landings of resets, and whether simultaneous ones commute.

*Crossings.* Along a run let the surface function r rise above 0 from a time s on. Where r is continuous, r = 0 at s, in
the domain and with a condition that holds or is at its end. Then, on some piece without kinks:

- the first derivative of r along the flow that is not 0 at s is positive, where derivatives are continuous there;
- and r' > 0 at times as near to s as one likes where r > 0.

One of the two is shown to be impossible on every piece. A derivative of order 2 or more says nothing at the end of a
piece, where the run may go to another one.

*Do transitions that are reached together commute?* Each of them is taken first in turn, then all that fire at the same
instant; where all orders lead to the same point the choice does not matter. Here that is asked of the points of a guard
(`commute`: by expressions, for all of them; `matters`: by numbers, at one). The verdict asks it of a run.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any, NamedTuple

from hsdsl.base.errors import Decided
from hsdsl.base.functions import replaced
from hsdsl.language.expression.scope import symbol
from hsdsl.language.system import Edge, Mode, Surface
from hsdsl.mathematics.decisions.dynamics import Clause, Dynamics, Proof, closed, strict
from hsdsl.mathematics.decisions.mode_point import ModePoint, Unsure, chain, ranked, same
from hsdsl.mathematics.decisions.search import UNKNOWN, Answer, Constraint, at_most_zero, negative, positive, zero
from hsdsl.mathematics.decisions.singularities import KINKED, SmoothPiece, breaks, discontinuities, influencing, pieces

DEEPEST = 6  # derivatives along the flow that are examined


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
    found = [_outcome(proof, piece, domain, inside) for piece in cut] if cut else [None]
    if None in found:
        return None
    along = " or runs along it" if "along" in found else ""
    return f"wherever its surface meets the domain, the flow points back inside{along}", proof


def _outcome(proof: Proof, piece: SmoothPiece, domain: Clause, inside: list[Clause]) -> str | None:
    """Say what the flow does on a piece where the surface is met: ``inward``, ``along``; None where it may go out."""
    surface = [(zero(piece.residual), *clause, *piece.closed) for clause in inside]
    for expr in (piece.residual, *piece.flow.values()):
        broken = breaks(expr)
        if broken is None or not all(proof.never(surface, *clause) for clause in broken):
            return None
    expr, first = piece.residual, None
    for _ in range(DEEPEST):
        expr = proof.dynamics.along(expr, piece.flow)
        if expr is None or not proof.never(surface, positive(expr)):
            return None
        surface = [(*clause, zero(expr)) for clause in surface]
        if proof.never(surface):
            return "inward"
        first = expr if first is None else first
        if expr.is_zero or not all(proof.never(surface, zero(end)) for end in (*piece.sides, *piece.zeros)):
            break
    if not all(proof.never(surface, zero(other.expr)) for other in domain):
        return None  # something else ends the domain where r' = 0
    beyond = (*domain, *piece.closed, positive(piece.residual), positive(first))
    return "along" if proof.never([beyond]) else None  # r falls, or stays, wherever it is positive


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


class Landing(NamedTuple):
    """A reset that lands on a surface of the next mode, wherever its transition fires, and how that is known.

    The surface is that of ``edge``, or a wall (None). ``rate`` says how fast the surface function changes after
    landing, in the states before the reset, and ``bend`` how fast that rate does. ``guard`` is where the first
    transition fires and the condition of the second holds. With ``returns`` the second one leads back to the mode and
    state before the first.
    """

    edge: Edge | None
    surface: Surface
    rate: Any
    bend: Any
    guard: list[Clause]
    returns: bool
    decided: Decided


def landings(dynamics: Dynamics, edge: Edge) -> tuple[Landing, ...]:
    """The surfaces of the next mode that an edge's reset always lands on."""
    return dynamics.remembered(("landings", edge.source, edge.name), lambda: tuple(_landings(dynamics, edge)))


def _landings(dynamics: Dynamics, edge: Edge) -> Iterator[Landing]:
    mode, target = dynamics.modes[edge.source], dynamics.modes[edge.target]
    guard = dynamics.guard(edge)
    surfaces = [*((after.surface, after) for after in target.edges), *((wall, None) for wall in target.walls)]
    for surface, after in surfaces if guard and not target.final else ():
        residual = dynamics.residual(surface)
        carried = dynamics.carried(residual, edge)
        known = [dynamics.vanishes(mode, carried, clause) for clause in guard or ()]
        if None in known:
            continue
        rate = dynamics.rate(target, residual)
        conditions = [()] if after is None else dynamics.condition(after)
        moved = [tuple(c.along(dynamics.carried(c.expr, edge)) for c in clause) for clause in conditions or ()]
        both = [(*before, *clause) for before in guard or () for clause in moved]
        returns = after is not None and _returns(dynamics, edge, after, guard or [])
        bend = None if rate is None else dynamics.rate(target, rate)
        rate, bend = (None if e is None else dynamics.carried(e, edge) for e in (rate, bend))
        yield Landing(after, surface, rate, bend, both, returns, "sampled" if "sampled" in known else "symbolic")


def _returns(dynamics: Dynamics, edge: Edge, after: Edge, guard: list[Clause]) -> bool:
    if after.target != edge.source or (after.name == edge.name and after.source == edge.source):
        return False
    mode = dynamics.modes[edge.source]
    for state, value in after.values.items():
        moved = dynamics.carried(dynamics.placed(value), edge) - symbol(state)
        if moved != 0 and any(dynamics.vanishes(mode, moved, clause) is None for clause in guard):
            return False
    return True


def entered_beyond(dynamics: Dynamics, edge: Edge) -> bool:
    """Whether a state may be beyond an edge's surface when it enters the mode, so that the edge fires at once (M5).

    Where that is not known, it may.
    """
    if edge.condition is not None:
        return False
    residual = dynamics.residual(edge.surface)
    if {s.name for s in residual.free_symbols} & {given.name for given in dynamics.system.inputs}:
        return True  # an input that jumps carries the surface along
    for before in dynamics.incoming[edge.source]:
        if before is not edge:
            mode = dynamics.modes[before.source]
            carried = dynamics.carried(residual, before)
            if not dynamics.ask_any(mode, dynamics.guard(before), positive(carried), prove=True).never:
                return True
    starts_here = edge.source == dynamics.system.initial.mode
    return starts_here and dynamics.value(residual, dynamics.starting_point) > 0


DEEPEST_CHAIN = 3  # transitions at one instant that are followed


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
            if not any(new) or len(one) > DEEPEST_CHAIN:
                return None
            one, other = one + new[0], other + new[1]
    return proof


class Arrival(NamedTuple):
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
