"""A run as the object of `run --json`, and JSON text that keeps every digit."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Iterable, Iterator, Mapping
from fractions import Fraction
from functools import lru_cache
from typing import Any, cast

import numpy as np

from hsdsl import decimals
from hsdsl.execution import Execution, Transition

STAGES = ("load", "compile", "simulate")
WIDTH = 100
_AS_THEY_ARE = frozenset((type(None), str, bool, int))
_KNOWN = float, str, int, type(None)
_encoded = json.JSONEncoder().encode


def as_json(execution: Execution) -> dict[str, Any]:
    """Return the object of `run --json`, to be printed by :func:`dumps`.

    Its keys, in this order: ``model``, ``engine``, ``scheme``, ``method``, ``settings``, ``overrides``, ``stop``,
    ``transitions``, ``final``, ``verdict``, ``seconds``, and ``left_out`` where states were not integrated.
    """
    settings = dict(execution.settings)
    left_out = {"left_out": settings.pop("left_out")} if "left_out" in settings else {}
    run = _named(execution, "model", "engine", "scheme", "method") | {
        "settings": settings,
        "overrides": execution.overrides,
        "stop": _named(execution.stop, "reason", "time", "message"),
        "transitions": [_transition(transition) for transition in execution.transitions],
        "final": _named(execution.final, "time", "mode", "state", "outputs"),
        "verdict": _named(execution.verdict, "theorem", "reasons"),
        "seconds": {stage: execution.seconds.get(stage) for stage in STAGES},
    }
    return plain(run | left_out)


def _named(value: object, *names: str) -> dict[str, Any]:
    return {name: getattr(value, name) for name in names}


def _transition(t: Transition) -> dict[str, Any]:
    between = {"from": t.source, "to": t.target}
    return _named(t, "index", "time", "resumed", "edge") | between | _named(t, "before", "after", "alternatives")


def plain(value: Any) -> Any:
    """Make a value one that JSON has; a number that is not finite is None, a multiprecision one stays.

    Raises
    ------
    TypeError
        For a value of any other kind.
    """
    if type(value) in _AS_THEY_ARE:
        return value
    if type(value) is float:
        return value if math.isfinite(value) else None
    match value:
        case np.generic() | np.ndarray():
            return plain(cast(Any, value).tolist())
        case str() | int():
            return value
        case dict() | Mapping():
            return {str(key): plain(item) for key, item in cast("Mapping[Any, Any]", value).items()}
        case list() | tuple():
            return [plain(item) for item in cast("list[Any]", value)]
        case Fraction():
            return float(value)
        case os.PathLike():
            return os.fspath(cast("os.PathLike[str]", value))
        case _ if isinstance(value, float) or decimals.is_multiprecision(value):
            return value if decimals.is_finite(value) else None
        case _:
            raise TypeError(f"JSON has no form for a {type(value).__name__}")


def dumps(value: Any) -> str:
    """Write JSON text with every digit of every number, never NaN or Infinity, in ASCII.

    Floats are written by ``repr``, multiprecision numbers as JSON numbers with the digits that the longest of them
    needs. A list or object that fits on a line is written on one.
    """
    ready = plain(value)
    return _written(ready, decimals.bits(_multiprecision(ready)), "\n", WIDTH)


def _multiprecision(value: Any) -> Iterator[Any]:
    """The numbers of a value that are not floats, and what else is neither plain nor a list or object."""
    many: Iterable[Any] = cast("dict[str, Any]", value).values() if isinstance(value, dict) else value
    for item in many if isinstance(value, (dict, list)) else (value,):
        if isinstance(item, (dict, list)):
            yield from _multiprecision(item)
        elif not isinstance(item, _KNOWN):
            yield item


@lru_cache
def _key(name: str) -> str:
    return _encoded(name) + ": "


def _written(value: Any, precision: int, newline: str, room: int) -> str:
    """Write a value; one that is longer than ``room`` on several lines."""
    if not isinstance(value, (dict, list)):
        number = isinstance(value, float) or decimals.is_multiprecision(value)
        return decimals.text(value, precision) if number else _encoded(value)
    inner = newline + "  "
    room_inside = WIDTH - len(inner)
    if isinstance(value, dict):
        opening, closing = "{}"
        named = [(_key(name), item) for name, item in cast("dict[str, Any]", value).items()]
        parts = [key + _written(item, precision, inner, room_inside - len(key)) for key, item in named]
    else:
        opening, closing = "[]"
        parts = [_written(item, precision, inner, room_inside) for item in cast("list[Any]", value)]
    line = opening + ", ".join(parts) + closing
    if len(line) <= room and "\n" not in line:
        return line
    return opening + inner + ("," + inner).join(parts) + newline + closing
