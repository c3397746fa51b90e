# pyright: basic
"""Guards that are reached together, and whether the order of their transitions matters."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from hsdsl.expression.scope import symbol
from hsdsl.lint.analysis.dynamics import Clause, Dynamics
from hsdsl.lint.analysis.question import Constraint, at_most_zero, negative
from hsdsl.lower.straight import replaced
from hsdsl.system import Edge, Mode

DEEPEST = 3  # transitions at one instant that are followed
_NEAR = 1e-6


@dataclass(frozen=True)
class Arrival:
    """A mode, and its states as expressions of those before."""

    mode: str
    states: tuple[str, ...]
    values: tuple[Any, ...]

    def moves(self) -> dict[Any, Any]:
        """The values by symbol, where they are not the symbol itself."""
        pairs = zip(map(symbol, self.states), self.values, strict=True)
        return {s: value for s, value in pairs if s != value}


def together(dynamics: Dynamics, first: Edge, second: Edge) -> list[Clause] | None:
    """Where two guards of a mode overlap, as alternatives."""
    one, other = dynamics.guard(first), dynamics.guard(second)
    if one is None or other is None:
        return None
    return [tuple(dict.fromkeys((*a, *b))) for a in one for b in other]


def commute(dynamics: Dynamics, first: Edge, second: Edge, overlap: Clause, point: Mapping[Any, float]) -> bool:
    """Whether both orders lead to one mode with the same states, all at one instant, from every point of an overlap.

    ``point`` is one of the overlap's points: what does not happen there need not be looked at further.
    """
    here = _Overlap(dynamics, dynamics.modes[first.source], overlap, point)
    one, other = ([here.arrival(edge, {})] for edge in (first, second))
    new = [one, other]
    for _ in range(DEEPEST):
        if any(here.same(a, b) for a in one for b in other):
            return True
        new = [[after for arrival in arrivals for after in here.following(arrival)] for arrivals in new]
        one, other = one + new[0], other + new[1]
    return False


@dataclass(frozen=True)
class _Overlap:
    """Points on two guards at once."""

    dynamics: Dynamics
    mode: Mode
    clause: Clause
    point: Mapping[Any, float]

    def arrival(self, edge: Edge, moves: dict[Any, Any]) -> Arrival:
        """What an edge leads to."""
        done: dict[Any, Any] = {}
        values = tuple(replaced(self.dynamics.placed(value), moves, done) for value in edge.reset)
        return Arrival(edge.target, edge.target_states, values)

    def following(self, here: Arrival) -> Iterator[Arrival]:
        """What is sure to follow at the same instant."""
        moves = here.moves()
        for edge in self.dynamics.modes[here.mode].edges:
            if self._fires(here, edge, moves):
                yield self.arrival(edge, moves)

    def same(self, one: Arrival, other: Arrival) -> bool:
        """Whether two arrivals are one."""
        if one.mode != other.mode or one.states != other.states:
            return False
        differences = (a - b for a, b in zip(one.values, other.values, strict=True) if a != b)
        return all(self.dynamics.vanishes(self.mode, d, self.clause) is not None for d in differences)

    def _fires(self, here: Arrival, edge: Edge, moves: dict[Any, Any]) -> bool:
        """Whether an edge fires at once wherever the overlap is left from."""
        dynamics = self.dynamics
        residual = dynamics.residual(edge.surface)
        carried = replaced(residual, moves, {})
        if not dynamics.value(carried, self.point) > -_NEAR:
            return False
        refused = dynamics.condition(edge, holds=False)
        for clause in [()] if refused is None else refused:
            moved = tuple(c.along(replaced(c.expr, moves, {})) for c in clause)
            if not dynamics.ask(self.mode, (*self.clause, *moved)).never:
                return False
        if dynamics.vanishes(self.mode, carried, self.clause) is not None:
            rate = dynamics.rate(dynamics.modes[here.mode], residual)
            return rate is not None and self._never(negative(replaced(rate, moves, {})))
        return edge.condition is None and self._never(at_most_zero(carried))

    def _never(self, constraint: Constraint) -> bool:
        return self.dynamics.contradicts(self.mode, self.clause, constraint)
