"""Every distance comes as an interval: what it is at least, and what it is at most."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf, nan


@dataclass(frozen=True)
class Interval:
    """A distance known to lie between ``lower`` and ``upper``, both included; ``inf`` where there is no path.

    Raises
    ------
    ValueError
        Unless 0 <= lower <= upper.
    """

    lower: float
    upper: float

    def __post_init__(self) -> None:
        if not 0 <= self.lower <= self.upper:
            raise ValueError(f"not a distance: [{self.lower}, {self.upper}]")

    @property
    def width(self) -> float:
        """Upper less lower; 0 where both are infinite."""
        return 0.0 if self.lower == self.upper else self.upper - self.lower

    @property
    def middle(self) -> float:
        """Middle of the interval; not a number when only the upper end is infinite."""
        if self.lower == self.upper:
            return self.lower
        return nan if self.upper == inf else (self.lower + self.upper) / 2

    def __contains__(self, value: float) -> bool:
        return self.lower <= value <= self.upper

    def __add__(self, other: Interval) -> Interval:
        return Interval(self.lower + other.lower, self.upper + other.upper)

    def __str__(self) -> str:
        return f"[{self.lower:.10g}, {self.upper:.10g}]"


ZERO = Interval(0.0, 0.0)
INFINITE = Interval(inf, inf)
