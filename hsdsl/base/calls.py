"""Calls with an argument that does not exist: refused in a sentence, with the closest one as a hint."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from types import FunctionType
from typing import ParamSpec, TypeVar, cast

from hsdsl.base.errors import UsageError
from hsdsl.base.names import did_you_mean

P = ParamSpec("P")
R = TypeVar("R")
C = TypeVar("C", bound=type)
TAKES_ANY = 0x08  # a flag of code: `**options`, which it hands on
Elsewhere = Callable[..., str | None]  # of a method's object and the name: the hint, where there is one


def nowhere(*_: object) -> None:
    """No hint."""


def checks_arguments(function: Callable[P, R], name: str = "", elsewhere: Elsewhere = nowhere) -> Callable[P, R]:
    """Let a function raise UsageError for an argument that it does not have; ``elsewhere`` may have a hint."""
    code = cast(FunctionType, function).__code__
    if code.co_flags & TAKES_ANY:
        return function
    own = frozenset(code.co_varnames[: code.co_argcount + code.co_kwonlyargcount])
    others = [each for each in code.co_varnames[: len(own)] if each != "self"]
    name = name or code.co_name

    @wraps(function)
    def checked(*args: P.args, **kwargs: P.kwargs) -> R:
        if not own.issuperset(kwargs):
            key = next(key for key in kwargs if key not in own)
            hint = (elsewhere(args[0], key) if args else None) or did_you_mean(key, others)
            hint = hint or f"its arguments are {', '.join(others)}"
            raise UsageError(f"{name} has no argument '{key}'", hint)
        return function(*args, **kwargs)

    return checked


def checks_methods(kind: C, elsewhere: Elsewhere = nowhere) -> C:
    """Let a class and its methods raise UsageError for arguments that are none of theirs."""
    for key, value in list(vars(kind).items()):
        if isinstance(value, FunctionType) and (key == "__init__" or not key.startswith("_")):
            name = kind.__name__ if key == "__init__" else f"{kind.__name__}.{key}"
            setattr(kind, key, checks_arguments(value, name, elsewhere))
    return kind
