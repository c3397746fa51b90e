"""Fields that are made when they are first asked for."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import fields
from typing import TYPE_CHECKING, Any, Self


class Deferred:
    """A frozen dataclass some of whose fields may be made later; to its users it is as if they had been there.

    A run of a tenth of a millisecond would else spend several times that on tables that few look at.
    """

    @classmethod
    def deferred(cls, later: Mapping[str, Callable[[Any], Any]], **now: Any) -> Self:
        """Make one from the values of some fields and, for the others, functions that make
        them of the object itself.

        Fields in ``later`` must have no default; nothing is checked.
        """
        made = object.__new__(cls)
        made.__dict__.update(now, _later=later)
        return made

    if not TYPE_CHECKING:

        def __getattr__(self, name: str) -> Any:
            make = self.__dict__.get("_later", {}).get(name)
            if make is None:
                raise AttributeError(f"'{type(self).__name__}' object has no attribute '{name}'")
            value = self.__dict__[name] = make(self)
            return value

    def __dir__(self) -> list[str]:
        """List the public names: fields, whether made yet or not, and what can be asked."""
        own = {field.name for field in fields(self)}  # pyright: ignore[reportArgumentType]
        return sorted(name for name in own.union(dir(type(self))) if not name.startswith("_") and name != "deferred")

    def __getstate__(self) -> dict[str, Any]:
        """Give every field: what makes them does not travel."""
        return {field.name: getattr(self, field.name) for field in fields(self)}  # pyright: ignore[reportArgumentType]
