"""Distances as intervals, with a status that says which ends are proved.

What is open when the time of a `Budget` is spent stays open, and the interval says so.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from math import inf, nan
from time import monotonic

CERTIFIED = "certified"
SAMPLED = "sampled"
SEARCHED = "searched"


def up_to_hops(hops: int) -> str:
    """The status of a distance whose paths with more passages were not examined."""
    return f"up to {hops} hops"


def weakest(*statuses: str) -> str:
    """The combined status of several distances: the weakest of them."""
    order = {CERTIFIED: 0, SAMPLED: 2, SEARCHED: 3}
    return max(statuses, key=lambda status: order.get(status, 1), default=CERTIFIED)


class EndsCross(RuntimeError):
    """A lower end above its upper end: an error of this software, never of a model."""


@dataclass(frozen=True)
class Interval:
    """A distance between ``lower`` and ``upper``, both included; ``inf`` if there is no path.

    Status ``certified``: both ends are proved. ``up to N hops``: both ends are proved, but a path with more passages
    may be shorter than the upper end. ``sampled``: a part was evaluated only at points. ``searched``: the upper end is
    the best path of local solves; the lower end is proved.
    """

    lower: float
    upper: float
    status: str = field(default=CERTIFIED, compare=False)

    def __post_init__(self) -> None:
        if not 0 <= self.lower <= self.upper:
            raise EndsCross(f"internal error: the bounds of a distance contradict: [{self.lower!r}, {self.upper!r}]")

    @property
    def width(self) -> float:
        """The upper end minus the lower end; 0 if both are infinite."""
        return 0.0 if self.lower == self.upper else self.upper - self.lower

    @property
    def middle(self) -> float:
        """The middle of the interval; not-a-number if only the upper end is infinite."""
        if self.lower == self.upper:
            return self.lower
        return nan if self.upper == inf else (self.lower + self.upper) / 2

    def __contains__(self, value: float) -> bool:
        return self.lower <= value <= self.upper

    def __add__(self, other: Interval) -> Interval:
        return Interval(self.lower + other.lower, self.upper + other.upper, weakest(self.status, other.status))

    def __str__(self) -> str:
        return f"[{self.lower:.10g}, {self.upper:.10g}]"

    def but(self, status: str) -> Interval:
        """The same with a status no better than one."""
        return replace(self, status=weakest(self.status, status))


ZERO = Interval(0.0, 0.0)
INFINITE = Interval(inf, inf)


@dataclass
class Budget:
    """Some seconds from now on, unlimited by default.

    ``ran_out`` records whether anything was left undone; ``watch`` receives the bounds known so far, now and then.
    """

    seconds: float = inf
    began: float = field(default_factory=monotonic)
    ran_out: bool = False
    watch: Callable[[float, float], None] | None = None

    def start(self) -> None:
        """Count from now on."""
        self.began = monotonic()

    def spent(self) -> bool:
        """Whether the time is over; remembered."""
        if monotonic() - self.began >= self.seconds:
            self.ran_out = True
        return self.ran_out

    def tell(self, lower: float, upper: float) -> None:
        """Say what is known so far."""
        if self.watch is not None:
            self.watch(lower, upper)
