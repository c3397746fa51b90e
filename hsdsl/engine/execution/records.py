"""Frozen dataclasses with fields computed at first use, and equality of recorded data."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import fields, is_dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Self, cast

import numpy as np


class Deferred:
    """A frozen dataclass that may compute some of its fields at first use; users do not notice the difference.

    A run of a tenth of a millisecond would else spend several times that on tables that few look at.
    """

    @classmethod
    def deferred(
        cls, later: Mapping[str, Callable[[Any], Any]], known: Mapping[str, Any] = MappingProxyType({}), **now: Any
    ) -> Self:
        """Make an object from the values of some fields, and from functions of the object for the other fields.

        Fields in ``later`` must have no default; nothing is checked. ``known`` is what many have in common.
        """
        made = object.__new__(cls)
        made.__dict__.update({**known, **now} if known else now, _later=later)
        return made

    def _elsewhere(self, name: str) -> str:
        """Return a hint where to find the value of a public name that is no attribute."""
        return ""

    if not TYPE_CHECKING:

        def __getattr__(self, name: str) -> Any:
            make = self.__dict__.get("_later", {}).get(name)
            if make is None:
                hint = self._elsewhere(name) if self.__dict__ and not name.startswith("_") else ""
                raise AttributeError(f"'{type(self).__name__}' object has no attribute '{name}'{hint}")
            value = self.__dict__[name] = make(self)
            return value

    def __dir__(self) -> list[str]:
        """List the public names: fields, computed or deferred, properties and methods."""
        own = {field.name for field in fields(self)}  # pyright: ignore[reportArgumentType]
        return sorted(name for name in own.union(dir(type(self))) if not name.startswith("_") and name != "deferred")

    def __getstate__(self) -> dict[str, Any]:
        """Return every field; the functions that compute deferred fields are not pickled."""
        return {field.name: getattr(self, field.name) for field in fields(self)}  # pyright: ignore[reportArgumentType]


def same(a: Any, b: Any) -> bool:
    """Compare numbers, texts, arrays, dataclasses and containers by value.

    Arrays must agree in shape and in kind of number (float64 or object), containers in kind and order; fields
    marked ``compare=False`` are left out.
    """
    if isinstance(a, np.ndarray) or isinstance(b, np.ndarray):
        return _same_arrays(a, b)
    if is_dataclass(a) or is_dataclass(b):
        return type(a) is type(b) and all(
            same(getattr(a, field.name), getattr(b, field.name)) for field in fields(a) if field.compare
        )
    if isinstance(a, Mapping) and isinstance(b, Mapping):
        left, right = cast(Mapping[Any, Any], a), cast(Mapping[Any, Any], b)
        return list(left) == list(right) and all(same(left[key], right[key]) for key in left)
    if isinstance(a, (tuple, list)) and isinstance(b, (tuple, list)):
        left, right = cast("tuple[Any, ...]", a), cast("tuple[Any, ...]", b)
        return (
            isinstance(a, list) == isinstance(b, list)
            and len(left) == len(right)
            and all(same(x, y) for x, y in zip(left, right, strict=True))
        )
    return bool(a == b) or _both_nan(a, b)


def _both_nan(a: Any, b: Any) -> bool:
    return bool(a != a) and bool(b != b)  # the one value that differs from itself


def _same_arrays(a: Any, b: Any) -> bool:
    if not (isinstance(a, np.ndarray) and isinstance(b, np.ndarray)):
        return False
    left, right = cast("np.ndarray[Any, Any]", a), cast("np.ndarray[Any, Any]", b)
    if left.shape != right.shape or (left.dtype == object) != (right.dtype == object):
        return False
    with np.errstate(invalid="ignore"):
        equal = np.asarray(left == right, dtype=bool)
        nan = np.asarray(left != left, dtype=bool) & np.asarray(right != right, dtype=bool)
    return bool(np.all(equal | nan))
