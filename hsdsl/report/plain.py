"""The object that `run --json` prints, and JSON text that keeps every digit."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Mapping
from fractions import Fraction
from typing import Any, cast

import numpy as np

from hsdsl import decimals
from hsdsl.execution import Execution, Transition

STAGES = ("load", "compile", "simulate")
WIDTH = 100


def as_json(execution: Execution) -> dict[str, Any]:
    """Return the object of `run --json`; numbers that are not finite are None, multiprecision ones stay as they are.

    Its keys, in this order: ``model``, ``engine``, ``scheme``, ``method``, ``settings``, ``overrides``, ``stop``,
    ``transitions``, ``final``, ``verdict``, ``seconds``, and ``left_out`` where states were not integrated. Print it
    with :func:`dumps`.
    """
    stop, final, verdict = execution.stop, execution.final, execution.verdict
    run = {
        "model": execution.model,
        "engine": execution.engine,
        "scheme": execution.scheme,
        "method": execution.method,
        "settings": {name: value for name, value in execution.settings.items() if name != "left_out"},
        "overrides": execution.overrides,
        "stop": {"reason": stop.reason, "time": stop.time, "message": stop.message},
        "transitions": [_transition(transition) for transition in execution.transitions],
        "final": {"time": final.time, "mode": final.mode, "state": final.state, "outputs": final.outputs},
        "verdict": {"theorem": verdict.theorem, "reasons": verdict.reasons},
        "seconds": {stage: execution.seconds.get(stage) for stage in STAGES},
    }
    if "left_out" in execution.settings:
        run["left_out"] = execution.settings["left_out"]
    return cast("dict[str, Any]", plain(run))


def _transition(transition: Transition) -> dict[str, Any]:
    return {
        "index": transition.index,
        "time": transition.time,
        "resumed": transition.resumed,
        "edge": transition.edge,
        "from": transition.source,
        "to": transition.target,
        "before": transition.before,
        "after": transition.after,
        "alternatives": transition.alternatives,
    }


def plain(value: Any) -> Any:
    """Make a value one that JSON has: dicts, lists, texts, booleans, None and finite numbers of any precision.

    Raises
    ------
    TypeError
        For a value of any other kind.
    """
    if isinstance(value, (np.generic, np.ndarray)):
        value = cast(Any, value).tolist()
    if value is None or isinstance(value, (str, bool, int)):
        return value
    if isinstance(value, float) or decimals.is_multiprecision(value):
        return value if decimals.is_finite(value) else None
    if isinstance(value, Fraction):
        return float(value)
    if isinstance(value, os.PathLike):
        return os.fspath(cast("os.PathLike[str]", value))
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in cast("Mapping[Any, Any]", value).items()}
    if isinstance(value, (list, tuple)):
        return [plain(item) for item in cast("list[Any]", value)]
    raise TypeError(f"JSON has no form for a {type(value).__name__}")


def dumps(value: Any, width: int = WIDTH) -> str:
    """Write JSON text with every digit of every number, never NaN or Infinity, in ASCII.

    Floats are written by ``repr``, multiprecision numbers as JSON numbers with the digits that the longest of them
    needs. A list or object that fits on a line of ``width`` characters is written on one.
    """
    ready = plain(value)
    return "".join(_written(ready, decimals.bits(_leaves(ready)), "", width, width))


def _leaves(value: Any) -> Iterator[Any]:
    if isinstance(value, dict):
        value = list(cast("dict[str, Any]", value).values())
    if isinstance(value, list):
        for item in cast("list[Any]", value):
            yield from _leaves(item)
    else:
        yield value


def _written(value: Any, precision: int, indent: str, width: int, room: int) -> Iterator[str]:
    if not isinstance(value, (dict, list)):
        yield _leaf(value, precision)
        return
    short = _one_line(value, precision, room)
    if short is not None:
        yield short
        return
    opening, closing = "{}" if isinstance(value, dict) else "[]"
    inner = indent + "  "
    separator = opening + "\n"
    for key, item in _items(value):
        yield separator + inner + key
        yield from _written(item, precision, inner, width, width - len(inner + key) - len(","))
        separator = ",\n"
    yield f"\n{indent}{closing}"


def _items(value: Any) -> Iterator[tuple[str, Any]]:
    if isinstance(value, dict):
        for key, item in cast("dict[str, Any]", value).items():
            yield json.dumps(key) + ": ", item
    else:
        for item in cast("list[Any]", value):
            yield "", item


def _one_line(value: Any, precision: int, room: int) -> str | None:
    """Write a value on one line, or give up as soon as it is longer than ``room``."""
    if not isinstance(value, (dict, list)):
        return _leaf(value, precision)
    parts: list[str] = []
    for key, item in _items(value):
        part = _one_line(item, precision, room)
        if part is None:
            return None
        parts.append(key + part)
        room -= len(parts[-1]) + 2
        if room < 0:
            return None
    joined = ", ".join(parts)
    return "{" + joined + "}" if isinstance(value, dict) else "[" + joined + "]"


def _leaf(value: Any, precision: int) -> str:
    if isinstance(value, float) or decimals.is_multiprecision(value):
        return decimals.text(value, precision)
    return json.dumps(value)
