# pyright: basic
"""Questions and answers: is there a point where some expressions have given signs?"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import inf
from typing import Any, Literal

from hsdsl.base.errors import Decided

Relation = Literal["= 0", "<= 0", "< 0"]


@dataclass(frozen=True)
class Constraint:
    """An expression of states, inputs and time, and the sign it must have."""

    expr: Any
    relation: Relation

    def along(self, expr: Any) -> Constraint:
        """The same of another expression."""
        return Constraint(expr, self.relation)


def zero(expr: Any) -> Constraint:
    """The expression vanishes."""
    return Constraint(expr, "= 0")


def at_most_zero(expr: Any) -> Constraint:
    """The expression is not positive."""
    return Constraint(expr, "<= 0")


def negative(expr: Any) -> Constraint:
    """The expression is negative."""
    return Constraint(expr, "< 0")


def positive(expr: Any) -> Constraint:
    """The expression is positive."""
    return Constraint(-expr, "< 0")


@dataclass(frozen=True)
class SearchRange:
    """What is known of a name's values: ends that hold for certain (None: without), and how far to look for points."""

    low: Any | None
    high: Any | None
    search: tuple[float, float]
    typical: float

    @property
    def bounds(self) -> tuple[Any, Any]:
        """The ends, infinite where there are none."""
        return -inf if self.low is None else self.low, inf if self.high is None else self.high


Ranges = Mapping[Any, SearchRange]  # by name


@dataclass(frozen=True)
class Answer:
    """What is known of a question: whether there is such a point, how that is known, and a point.

    ``searched`` are, of `never`, the names that nothing bounds, and how far was looked; infinite where that is no
    limit.
    """

    verdict: Literal["never", "somewhere", "unknown"]
    decided: Decided = "sampled"
    point: Mapping[Any, float] = field(default_factory=dict)
    searched: tuple[tuple[Any, float, float], ...] = ()

    @property
    def somewhere(self) -> bool:
        """Whether a point is known."""
        return self.verdict == "somewhere"

    @property
    def never(self) -> bool:
        """Whether it is known that there is none, where it was looked."""
        return self.verdict == "never"


UNKNOWN = Answer("unknown")
NEVER = Answer("never", "symbolic")
