"""The levels at which transitions fire, as a plot knows them."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class GuardLine:
    """A guard that is a level of one state: in ``mode`` something fires where ``state`` reaches ``value``."""

    mode: str
    state: str
    value: float
    label: str
