"""Defaults of an experiment."""

from __future__ import annotations

from fractions import Fraction
from typing import Any

DEFAULTS: dict[str, Any] = {
    "scheme": "located",
    "method": "auto",
    "completion": "contact",
    "relaxation": Fraction("1e-6"),
    "max_transitions": 10**6,
}
MOST_WAITING = 10**6  # executions of one event
DEFAULT_TOLERANCE = Fraction("1e-9")
_FOR_ROUNDOFF = 7  # digits: of the 16 of float64 the default tolerance keeps 9


def kept_digits(digits: int) -> int:
    """How many of so many decimal digits the default tolerance of a method of any order keeps."""
    return digits - _FOR_ROUNDOFF


def least_relaxation(relaxation: Any, until: Any) -> Any:
    """The default relaxation of a run that ends at ``until``: the general one, or if smaller as large a part of it."""
    return min(relaxation, relaxation * until) if until > 0 else relaxation
