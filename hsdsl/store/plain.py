"""Recorded values as plain JSON and back: floats that are not finite, mpmath numbers and tuples keep what they are.

What JSON has no form for is an object of one key that begins with ``$``.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields, is_dataclass
from typing import Any, cast

import numpy as np

from hsdsl import decimals
from hsdsl.execution import Array


@dataclass(frozen=True)
class Plain:
    """How numbers are written: at ``precision`` bits, and read into the context of ``digits`` decimal digits."""

    precision: int
    digits: int | None

    @staticmethod
    def numbers(value: Any) -> Iterator[Any]:
        """Find all multiprecision numbers in a value."""
        if decimals.is_multiprecision(value):
            yield value
        elif is_dataclass(value):
            for field in fields(value):
                yield from Plain.numbers(getattr(value, field.name))
        elif isinstance(value, Mapping):
            for item in cast("Mapping[Any, Any]", value).values():
                yield from Plain.numbers(item)
        elif isinstance(value, (tuple, list)):
            for item in cast("tuple[Any, ...]", value):
                yield from Plain.numbers(item)

    def pack(self, value: Any) -> Any:
        """Make a value plain.

        Raises
        ------
        TypeError
            For a value of a kind that executions do not record.
        """
        if isinstance(value, np.generic):
            value = cast(Any, value.item())
        if value is None or isinstance(value, (str, bool, int)):
            return value
        if decimals.is_multiprecision(value):
            return {"$mpf": decimals.text(value, self.precision)}
        if isinstance(value, float):
            return value if math.isfinite(value) else {"$float": repr(value)}
        if isinstance(value, Mapping):
            return self._pack_mapping(cast("Mapping[Any, Any]", value))
        if isinstance(value, tuple):
            return {"$tuple": [self.pack(item) for item in cast("tuple[Any, ...]", value)]}
        if isinstance(value, list):
            return [self.pack(item) for item in cast("list[Any]", value)]
        raise TypeError(f"a {type(value).__name__} cannot be stored")

    def _pack_mapping(self, value: Mapping[Any, Any]) -> Any:
        if all(isinstance(key, str) and not key.startswith("$") for key in value):
            return {key: self.pack(item) for key, item in value.items()}
        return {"$map": [[self.pack(key), self.pack(item)] for key, item in value.items()]}

    def unpack(self, value: Any) -> Any:
        """Undo :meth:`pack`."""
        if isinstance(value, list):
            return [self.unpack(item) for item in cast("list[Any]", value)]
        if not isinstance(value, dict):
            return value
        known = cast("dict[str, Any]", value)
        tag = next(iter(known), "")
        content: Any = known.get(tag)
        if tag == "$mpf":
            return self._number(content)
        if tag == "$float":
            return float(content)
        if tag == "$tuple":
            return tuple(self.unpack(item) for item in content)
        if tag == "$map":
            return {self.unpack(key): self.unpack(item) for key, item in content}
        return {key: self.unpack(item) for key, item in known.items()}

    def pack_fields(self, record: Any) -> dict[str, Any]:
        """Make a dataclass plain: its fields by name."""
        return {field.name: self.pack(getattr(record, field.name)) for field in fields(record)}

    def unpack_fields(self, plain: dict[str, Any]) -> dict[str, Any]:
        """Undo :meth:`pack_fields`, up to calling the class."""
        return {name: self.unpack(value) for name, value in plain.items()}

    def pack_array(self, column: Array) -> Array:
        """Make an array one that needs no pickling: a multiprecision one becomes text, with a leading mark."""
        if column.dtype != object:
            return column
        context = decimals.context_of(self.digits or 15)
        texts = [decimals.text(context.convert(x), self.precision) for x in column.ravel()]
        return np.array(texts, dtype="S" if texts else "S1").reshape(column.shape)

    def unpack_array(self, column: Array) -> Array:
        """Undo :meth:`pack_array`."""
        if column.dtype.kind != "S":
            return column
        numbers = np.empty(column.size, dtype=object)
        numbers[:] = [self._number(text.decode()) for text in column.ravel().tolist()]
        return numbers.reshape(column.shape)

    def _number(self, written: str) -> Any:
        return decimals.read(written, self.precision, decimals.context_of(self.digits or 15))
