"""Prepared runs of the last few calls, found by their arguments."""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from threading import Lock
from typing import Any, Generic, TypeVar, cast

Value = TypeVar("Value")
_PLAIN = frozenset((type(None), str, int, float, bool))


class CallCache(Generic[Value]):
    """The last ``most`` values, by key; of a key None nothing is kept."""

    def __init__(self, most: int) -> None:
        self._most = most
        self._values: dict[Hashable, Value] = {}
        self._lock = Lock()

    def find(self, key: Hashable | None) -> Value | None:
        """The value of a key, if it is there."""
        return self._values.get(key)

    def keep(self, key: Hashable | None, value: Value) -> None:
        """Keep a value, and drop the oldest where there are too many."""
        if key is None:
            return
        with self._lock:
            self._values[key] = value
            while len(self._values) > self._most:
                del self._values[next(iter(self._values))]


def call_key(*arguments: Any) -> Hashable | None:
    """A key that calls share only if their arguments are the same; None where they are not plain data.

    1, 1.0 and True are not the same, zeros of both signs are.
    """
    kinds = tuple(map(type, arguments))
    if _PLAIN.issuperset(kinds):
        return kinds, arguments
    try:
        return tuple([(a.__class__, a) if a.__class__ in _PLAIN else _key(a) for a in arguments])
    except TypeError:
        return None


def _key(value: Any) -> Hashable:
    kind = cast("type[Any]", type(value))
    if kind in _PLAIN:
        return kind, value
    if isinstance(value, Mapping):
        return dict, tuple([(name, _key(item)) for name, item in cast("Mapping[Any, Any]", value).items()])
    if kind is list or kind is tuple:
        return kind, tuple(map(_key, value))
    raise TypeError(f"a {kind.__name__} is not plain data")
