"""Recorded values as JSON and back: floats that are not finite, mpmath numbers and tuples keep their types.

A value without a form in JSON is an object of one key that begins with ``$``.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields
from typing import Any, cast

import numpy as np

from hsdsl.base.numbers import decimals
from hsdsl.engine.execution import Array


def numbers(value: Any) -> Iterator[Any]:
    """All multiprecision numbers in a value of mappings and lists."""
    if decimals.is_multiprecision(value):
        yield value
    elif isinstance(value, Mapping):
        yield from numbers(list(cast("Mapping[Any, Any]", value).values()))
    elif isinstance(value, (tuple, list)):
        for item in cast("list[Any]", value):
            yield from numbers(item)


@dataclass(frozen=True)
class Lossless:
    """Numbers written at ``precision`` bits, and read into the context of ``digits`` decimal digits."""

    precision: int
    digits: int | None

    def pack(self, value: Any) -> Any:
        """Make a value one that JSON has.

        Raises TypeError: for a value of a kind that executions do not record.
        """
        match value:
            case np.generic():
                return self.pack(cast(Any, value).item())
            case None | str() | bool() | int():
                return value
            case float():
                return value if math.isfinite(value) else {"$float": repr(value)}
            case Mapping():
                items = [(key, self.pack(item)) for key, item in cast("Mapping[Any, Any]", value).items()]
                if all(isinstance(key, str) and not key.startswith("$") for key, _ in items):
                    return dict(items)
                return {"$map": [[self.pack(key), item] for key, item in items]}
            case tuple():
                return {"$tuple": [self.pack(item) for item in cast("tuple[Any, ...]", value)]}
            case list():
                return [self.pack(item) for item in cast("list[Any]", value)]
            case _ if decimals.is_multiprecision(value):
                return {"$mpf": decimals.text(value, self.precision)}
            case _:
                raise TypeError(f"a {type(value).__name__} cannot be stored")

    def unpack(self, value: Any) -> Any:
        """Undo :meth:`pack`."""
        match value:
            case {"$mpf": text}:
                return self._number(text)
            case {"$float": text}:
                return float(text)
            case {"$tuple": items}:
                return tuple(self.unpack(item) for item in items)
            case {"$map": items}:
                return {self.unpack(key): self.unpack(item) for key, item in items}
            case dict():
                return {key: self.unpack(item) for key, item in cast("dict[str, Any]", value).items()}
            case list():
                return [self.unpack(item) for item in cast("list[Any]", value)]
            case _:
                return value

    def pack_fields(self, record: Any) -> dict[str, Any]:
        """Make a dataclass a mapping of its fields."""
        return {field.name: self.pack(getattr(record, field.name)) for field in fields(record)}

    def pack_array(self, column: Array) -> Array:
        """Make an array one that needs no pickling: a multiprecision one becomes text."""
        if column.dtype != object:
            return column
        context = decimals.context_of(self.digits or 15)
        texts = [decimals.text(context.convert(x), self.precision) for x in column.ravel()]
        return np.array(texts, dtype="S" if texts else "S1").reshape(column.shape)

    def unpack_array(self, column: Array) -> Array:
        """Undo :meth:`pack_array`."""
        if column.dtype.kind != "S":
            return column
        values = np.empty(column.size, dtype=object)
        values[:] = [self._number(text.decode()) for text in column.ravel().tolist()]
        return values.reshape(column.shape)

    def _number(self, written: str) -> Any:
        return decimals.read(written, self.precision, decimals.context_of(self.digits or 15))
