"""What the text of the scheme may say beside Python's own words: kinds of values, and what a function is in C."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, TypeVar

from hsdsl.base.numbers.arithmetic import Number

Time = Number  # an instant: of 64 bits also where numbers have 32
Vector = Sequence[Number]  # that is only read
Room = list[Number]  # that is written
Function = TypeVar("Function", bound=Callable[..., Any])


def inline(function: Function) -> Function:
    """In C its text is put where it is called."""
    return function
