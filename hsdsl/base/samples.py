"""Inputs given by samples: what holds between two of them, and which times may follow each other."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal

Hold = Literal["zero", "linear"]


def in_order(hold: Hold, times: Sequence[Any], k: int) -> bool:
    """Whether sample k may follow those before it: later, or at the same time as one of an input with ramps, a jump."""
    again = hold == "linear" and times[k] == times[k - 1] and not (k > 1 and times[k - 2] == times[k])
    return times[k - 1] < times[k] or again
