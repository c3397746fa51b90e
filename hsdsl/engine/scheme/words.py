"""What the text of the scheme may say beside Python's own words: kinds of values, and what a function is in C."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, TypeVar

from hsdsl.base.numbers.arithmetic import Number

Time = Number  # an instant: of 64 bits also where numbers have 32
Vector = Sequence[Number]  # that is only read
Room = list[Number]  # that is written
Indices = Sequence[int]  # that are only read
IndexRoom = list[int]  # that are written
each = range  # for passes of which none depends on another: C may make several at once
Count = int  # of 64 bits
Here = Any  # in C the run; in Python what primitives need of the mode that it is in
Function = TypeVar("Function", bound=Callable[..., Any])


def inline(function: Function) -> Function:
    """In C its text is put where it is called."""
    return function


def may_fail(function: Function) -> Function:
    """It may raise one of ``DOMAIN_ERRORS``; in C it returns whether it has failed."""
    return function
