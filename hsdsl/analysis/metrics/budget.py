"""How long a distance may take: what is open when the time is spent stays open, and the answer says so."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from math import inf
from time import monotonic


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
