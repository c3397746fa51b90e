"""Questions that were answered `never`, put together: how that is known, and within which bounds."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from hsdsl.base.errors import Decided
from hsdsl.language.system import TIME, Mode
from hsdsl.mathematics.decisions.dynamics import Clause, Dynamics
from hsdsl.mathematics.decisions.question import Answer, Constraint


@dataclass
class Proof:
    """What is known to have no point in a mode, by the answers found; where ``timed``, within the run's time alone."""

    dynamics: Dynamics
    mode: Mode
    found: list[Answer] = field(default_factory=list[Answer])
    timed: bool = False

    def never(self, alternatives: Sequence[Clause], *more: Constraint) -> bool:
        """Whether there is no point where one of the alternatives and more constraints hold."""
        answers: list[Answer] = []
        for clause in alternatives:
            answers.append(self.dynamics.ask(self.mode, (*clause, *more), prove=True))
            if not answers[-1].never:
                return False
        self.found += answers
        self.timed |= any(TIME in c.expr.free_symbols for clause in (*alternatives, more) for c in clause)
        return True

    @property
    def decided(self) -> Decided:
        """How it is known."""
        return "interval" if any(answer.decided == "interval" for answer in self.found) else "symbolic"

    @property
    def searched(self) -> tuple[tuple[Any, float, float], ...]:
        """The bounds that all of it holds within: what was looked at in every question."""
        ends: dict[Any, tuple[float, float]] = {}
        for answer in self.found:
            for symbol, low, high in answer.searched:
                first, last = ends.get(symbol, (low, high))
                ends[symbol] = max(first, low), min(last, high)
        if self.timed:
            ends[TIME] = float("-inf"), float(self.dynamics.until)
        return tuple((symbol, *limits) for symbol, limits in ends.items())


def closed(clause: Iterable[Constraint]) -> Clause:
    """Constraints with their ends: where one is at its end, round-off decides."""
    return tuple(replace(c, relation="<= 0") if c.relation == "< 0" else c for c in clause)


def strict(clause: Iterable[Constraint]) -> Clause:
    """Inequalities without their ends, where they are more than numbers."""
    return tuple(replace(c, relation="< 0") if c.relation == "<= 0" and not c.expr.is_number else c for c in clause)
