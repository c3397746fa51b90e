"""Whether the parts of an execution that was read are of the types that they are declared with."""

from __future__ import annotations

import types
from collections.abc import Iterable
from dataclasses import fields
from functools import cache
from typing import Any, Literal, Union, cast, get_args, get_origin, get_type_hints

from hsdsl import decimals
from hsdsl.execution import Array, Execution

_DIMENSIONS = {"times": 1, "values": 2, "outputs": 2, "depth": 1, "coefficients": 3}
_LEFT_OUT = {"states": tuple[str, ...], "reason": str}


def check(execution: Execution) -> None:
    """Check what an execution does not check itself: where it comes from a file, each part may be anything.

    Raises
    ------
    TypeError
        A part has another type, a column another shape.
    """
    texts = {"model", "digest", "engine", "scheme", "method", "title", "output_names", "digits", "settings", "seconds"}
    _check_fields(execution, texts)
    for record in (execution.stop, execution.final, execution.verdict, *execution.transitions, *execution.arcs):
        _check_fields(record, {field.name for field in fields(record)})
    for name, dimensions in _DIMENSIONS.items():
        column: Array = getattr(execution, name)
        if column.ndim != dimensions or str(column.dtype) not in ("float64", "object"):
            raise TypeError(f"{name} is no such column")
    widths = {len(arc.states) for arc in execution.arcs}
    if execution.values.shape[1] < max(widths) or execution.outputs.shape[1] != len(execution.output_names):
        raise TypeError("columns are missing")
    if execution.digits is not None and execution.digits < 1:
        raise TypeError("no such precision")
    left_out = execution.settings.get("left_out")
    if left_out is not None and not all(_fits(left_out[name], kind) for name, kind in _LEFT_OUT.items()):
        raise TypeError("left_out says nothing")


def _check_fields(record: object, names: Iterable[str]) -> None:
    hints = _hints(type(record))
    for name in names:
        if not _fits(getattr(record, name), dict if name == "settings" else hints[name]):
            raise TypeError(f"{name} is no such thing")


@cache
def _hints(kind: type) -> dict[str, Any]:
    return get_type_hints(kind)


def _fits(value: Any, kind: Any) -> bool:
    """Whether a value is of a declared type; what is declared as anything is a number."""
    origin, arguments = get_origin(kind), get_args(kind)
    if kind in (Any, float):
        return type(value) in (int, float) or decimals.is_multiprecision(value)
    if kind is type(None):
        return value is None
    if origin is Literal:
        return value in arguments
    if origin is tuple:
        items = cast("tuple[Any, ...]", value)
        return isinstance(value, (tuple, list)) and all(_fits(item, arguments[0]) for item in items)
    if origin is dict:
        entries = cast("dict[Any, Any]", value)
        return isinstance(value, dict) and all(type(k) is str and _fits(v, arguments[1]) for k, v in entries.items())
    if origin in (Union, types.UnionType):
        return any(_fits(value, one) for one in arguments)
    return type(value) is kind
