"""A run as the object of `run --json`, and JSON text that keeps every digit."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from fractions import Fraction
from functools import cached_property, lru_cache
from itertools import islice
from typing import Any, cast

import numpy as np

from hsdsl.base.names import seen
from hsdsl.base.numbers import decimals
from hsdsl.engine.execution import Execution, Transition

STAGES = ("load", "compile", "simulate")
WIDTH = 100
_AS_THEY_ARE = frozenset((type(None), str, bool, int))
_KNOWN = float, str, int, type(None)
_encoded = json.JSONEncoder().encode


def as_json(execution: Execution) -> dict[str, Any]:
    """Return the object of `run --json`, of values that JSON has.

    Its keys, in this order: ``model``, ``engine``, ``scheme``, ``method``, ``settings``, ``overrides``, ``stop``,
    ``transitions``, ``final``, ``warnings``, ``verdict``, ``seconds``, and ``left_out`` where states were not
    integrated.
    """
    return plain(record(execution))


def record(execution: Execution) -> dict[str, Any]:
    """Return the object of `run --json` with the run's own values, to be printed by :func:`dumps`."""
    settings = dict(execution.settings)
    left_out = {"left_out": settings.pop("left_out")} if "left_out" in settings else {}
    final = named(execution.final, "time mode state outputs")
    state = final["state"]
    if memory := state.keys() - seen(state):  # what a run needs to go on from here
        final |= {"state": seen(state), "memory": {name: state[name] for name in state if name in memory}}
    run = named(execution, "model engine scheme method") | {
        "settings": settings,
        "overrides": execution.overrides,
        "stop": named(execution.stop, "reason time message"),
        "transitions": [_transition(transition) for transition in execution.transitions],
        "final": final,
        "warnings": [named(each, "code time edge message") for each in execution.warnings],
        "verdict": named(execution.verdict, "theorem reasons"),
        "seconds": {stage: execution.seconds.get(stage) for stage in STAGES},
    }
    return run | left_out


def named(value: object, names: str) -> dict[str, Any]:
    """Return some attributes of an object, whose names have blanks between them."""
    return {name: getattr(value, name) for name in names.split()}


def _transition(t: Transition) -> dict[str, Any]:
    ends = {"from": t.source, "to": t.target, "before": seen(t.before), "after": t.after and seen(t.after)}
    return named(t, "index time resumed edge") | ends | {"alternatives": t.alternatives}


_kind: Callable[[Any], Any] = type
_keys: Callable[[Any], Any] = tuple


def plain(value: Any) -> Any:
    """Make a value one that JSON has; a number that is not finite is None, a multiprecision one stays.

    Raises TypeError: for a value of any other kind.
    """
    kind = _kind(value)
    if kind in _AS_THEY_ARE:
        return value
    if kind is float:
        return value if math.isfinite(value) else None
    if kind is dict:  # sooner found than by what follows
        return {name if type(name) is str else str(name): plain(item) for name, item in value.items()}
    match value:
        case np.generic() | np.ndarray():
            return plain(cast(Any, value).tolist())
        case str():
            return str.__str__(value)
        case int():
            return int(value)
        case Mapping():
            return {str(key): plain(item) for key, item in cast("Mapping[Any, Any]", value).items()}
        case list() | tuple():
            return [plain(item) for item in cast("list[Any]", value)]
        case Fraction():
            return float(value)
        case os.PathLike():
            return os.fspath(cast("os.PathLike[str]", value))
        case float():
            return plain(float(value))
        case _ if decimals.is_multiprecision(value):
            return value if decimals.is_finite(value) else None
        case _:
            raise TypeError(f"JSON has no form for a {type(value).__name__}")


def dumps(value: Any) -> str:
    """Write JSON text with every digit of every number, never NaN or Infinity, in ASCII.

    Floats are written by ``repr``, multiprecision numbers as JSON numbers with the digits that the longest of them
    needs. A list or object that fits on a line is written on one.
    """
    return _Writer(value).texts([value], "\n", WIDTH)[0]


def _multiprecision(value: Any) -> Iterator[Any]:
    """The numbers of a value, at any depth, that are not floats, and other values without a form in JSON."""
    many: Iterable[Any] = cast("dict[str, Any]", value).values() if isinstance(value, dict) else value
    for item in many if isinstance(value, (dict, list)) else (value,):
        if isinstance(item, (dict, list)):
            yield from _multiprecision(item)
        elif not isinstance(item, _KNOWN):
            yield item


@lru_cache
def _key(name: str) -> str:
    return _encoded(name) + ": "


class _Writer:
    """The texts of a value's parts; parts that are alike, such as the transitions of a run, are written together."""

    def __init__(self, whole: Any) -> None:
        self._whole = whole

    @cached_property
    def _precision(self) -> int:
        return decimals.bits(_multiprecision(plain(self._whole)))

    def texts(self, values: Sequence[Any], newline: str, room: int) -> list[str]:
        """Write each of some values, one that is longer than ``room`` on several lines."""
        kinds = set(map(_kind, values))
        if len(kinds) < 2 and (dict not in kinds or len(set(map(_keys, values))) < 2):
            return self._alike(values, newline, room)
        places: dict[Any, list[int]] = {}
        for place, value in enumerate(values):
            kind = _kind(value)
            places.setdefault(tuple(value) if kind is dict else kind, []).append(place)
        found = [""] * len(values)
        for some in places.values():
            for place, text in zip(some, self._alike([values[i] for i in some], newline, room), strict=True):
                found[place] = text
        return found

    def _alike(self, values: Sequence[Any], newline: str, room: int) -> list[str]:
        """Write values of one type, and objects of the same keys."""
        kind = _kind(values[0]) if values else None
        if kind is float:
            return [repr(number) if math.isfinite(number) else "null" for number in values]
        if kind is int:
            return list(map(repr, values))
        if kind in _AS_THEY_ARE:
            known = {value: _encoded(value) for value in set(values)}
            return [known[value] for value in values]
        if kind is dict:
            return self._objects(values, newline, room)
        if kind in (list, tuple):
            return self._lists(values, newline, room)
        if values and decimals.is_multiprecision(values[0]):
            return [decimals.text(x, self._precision) if decimals.is_finite(x) else "null" for x in values]
        return self.texts(list(map(plain, values)), newline, room) if values else []

    def _objects(self, values: Sequence[dict[Any, Any]], newline: str, room: int) -> list[str]:
        names, inner = list(values[0]), newline + "  "
        keys = [_key(str(name)) for name in names]
        columns = [
            self.texts([value[name] for value in values], inner, WIDTH - len(inner) - len(key))
            for name, key in zip(names, keys, strict=True)
        ]
        rows = zip(*columns, strict=True) if names else ((),) * len(values)
        line, lines = _forms([key.replace("%", "%%") + "%s" for key in keys], "{}", newline)
        return [_fitting(line % row, room) or lines % row for row in rows]

    def _lists(self, values: Sequence[Sequence[Any]], newline: str, room: int) -> list[str]:
        if not any(values):
            return ["[]"] * len(values)
        inner = newline + "  "
        items = iter(self.texts([item for value in values for item in value], inner, WIDTH - len(inner)))
        forms = (_forms(list(islice(items, len(value))), "[]", newline) for value in values)
        return [_fitting(line, room) or lines for line, lines in forms]


def _forms(parts: Sequence[str], brackets: str, newline: str) -> tuple[str, str]:
    """A list or object on one line, and on several."""
    inner, (opening, closing) = newline + "  ", brackets
    return opening + ", ".join(parts) + closing, opening + inner + ("," + inner).join(parts) + newline + closing


def _fitting(line: str, room: int) -> str:
    """The text where it is one line that fits, else nothing."""
    return line if len(line) <= room and "\n" not in line else ""
