"""What was found about one hypothesis at one place of a run."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from hsdsl.base.numbers.arithmetic import Number


@dataclass(frozen=True)
class Finding:
    """One thing that keeps the theorem from holding, or from being known to hold.

    Attributes
    ----------
    kind : str
        Findings of one kind are named together.
    theorem : {"left", "unknown"}
        What it makes of the verdict.
    sentence : str
        For a person.
    wall : tuple of str and number, or None
        A wall that the run was beyond, and when.
    """

    kind: str
    theorem: Literal["left", "unknown"]
    sentence: str
    wall: tuple[str, Number] | None = None


MOST_NAMED = 10**6


def times(margin: Number) -> str:
    """Write a margin as so many times something, in plain words."""
    if not margin < MOST_NAMED:
        return "more than a million times"
    return f"{round(float(margin)):,} times" if margin >= 100 else f"{abs(float(margin)):.2g} times"
