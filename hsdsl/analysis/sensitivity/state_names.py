"""The names of states, outputs and parameters that an augmented system has besides those of its model.

A model's names are identifiers, and none of these is.
"""

from __future__ import annotations

from collections.abc import Iterable

UNIT, SPAN, ERROR = "unit round-off", "length of the run", "error of the run"  # parameters, given by numbers
LAST = "time of the last transition"
MEASURED = "slopes are measured"  # 1 where a step's end told them


def own(names: Iterable[str]) -> tuple[str, ...]:
    """The names that are a model's."""
    return tuple(name for name in names if " " not in name)


def derivative_name(state: str, by: str) -> str:
    """The derivative of a state or output."""
    return f"d {state} / d {by}"


def rate_name(output: str) -> str:
    """The derivative of an output along the flow."""
    return f"d {output} / d t"


def still_rate_name(output: str) -> str:
    """The derivative of an output by time where states rest."""
    return f"d {output} / d t at rest"


def slope_name(state: str) -> str:
    """The slope of a state as the end of a step tells it."""
    return f"slope of {state}"


def shift_name(by: str) -> str:
    """The derivative of the time of the last transition."""
    return f"d time / d {by}"
