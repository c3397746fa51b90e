"""Records: frozen dataclasses with fields made on first use, equality of recorded data, and how it shows itself."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import fields, is_dataclass
from importlib import import_module
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Self, cast

import numpy as np


class Deferred:
    """A frozen dataclass some of whose fields may be made later; to its users it is as if they had been there.

    A run of a tenth of a millisecond would else spend several times that on tables that few look at.
    """

    @classmethod
    def deferred(
        cls, later: Mapping[str, Callable[[Any], Any]], known: Mapping[str, Any] = MappingProxyType({}), **now: Any
    ) -> Self:
        """Make one from the values of some fields and, for the others, functions that make
        them of the object itself.

        Fields in ``later`` must have no default; nothing is checked. ``known`` is what many have in common.
        """
        made = object.__new__(cls)
        made.__dict__.update({**known, **now} if known else now, _later=later)
        return made

    def _elsewhere(self, name: str) -> str:
        """Where the value of a public name is that is no attribute, as a hint."""
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
        """List the public names: fields, made or deferred, properties and methods."""
        own = {field.name for field in fields(self)}  # pyright: ignore[reportArgumentType]
        return sorted(name for name in own.union(dir(type(self))) if not name.startswith("_") and name != "deferred")

    def __getstate__(self) -> dict[str, Any]:
        """Give every field: what makes them does not travel."""
        return {field.name: getattr(self, field.name) for field in fields(self)}  # pyright: ignore[reportArgumentType]


# how runs show and save themselves: functions of the analysis; their data does not import its pictures
HOMES = {
    "axes": "hsdsl.analysis.plot",
    "ensemble_html": "hsdsl.analysis.plot.notebook",
    "run_html": "hsdsl.analysis.plot.notebook",
    "save": "hsdsl.analysis.store",
}


def shown(name: str, *given: Any, **options: Any) -> Any:
    """Call the function of this name, imported where it is called."""
    return getattr(import_module(HOMES[name]), name)(*given, **options)


def same(a: Any, b: Any) -> bool:
    """Compare numbers, texts, arrays, dataclasses and containers of them by value.

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
