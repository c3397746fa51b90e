"""`dataclass` of the standard library, whose methods are compiled at their first use or not at all.

The standard one compiles up to six methods of every class when its module is imported. A short run imports 70 classes,
makes objects of half of them and compares few: this took a fifth of its instructions.
"""

from __future__ import annotations

import dataclasses
from dataclasses import asdict, field, fields, is_dataclass, replace
from functools import partial
from operator import attrgetter
from reprlib import recursive_repr
from typing import TYPE_CHECKING, Any

__all__ = ["asdict", "dataclass", "field", "fields", "is_dataclass", "replace"]

if TYPE_CHECKING:
    from dataclasses import dataclass  # what it means, and what type checkers know of it
else:

    def dataclass(kind=None, /, *, frozen=False, eq=True, repr=True, **others):
        """Make a data class; with other options, such as ``slots``, by the standard library."""
        if kind is None:
            return partial(dataclass, frozen=frozen, eq=eq, repr=repr, **others)
        if others:
            return dataclasses.dataclass(frozen=frozen, eq=eq, repr=repr, **others)(kind)
        kind.__doc__ = kind.__doc__ or kind.__name__  # else it is made of the signature, which takes long
        dataclasses.dataclass(init=False, eq=False, repr=False)(kind)
        for name, method in _methods(kind, frozen, eq, repr).items():
            if vars(kind).get(name) is None:  # a class with an __eq__ of its own has None for its hash
                setattr(kind, name, method)
        return kind


class _Init:
    """The ``__init__`` of a class, which puts the compiled one in its place when it is looked up."""

    def __init__(self, kind: Any, frozen: bool) -> None:
        self._kind, self._frozen = kind, frozen

    def __get__(self, one: object, kind: type) -> Any:
        self._kind.__init__ = compiled = _compiled_init(self._kind, self._frozen)
        return compiled.__get__(one, kind)


class _Factory:
    """Stands for a value that is made anew for each object."""

    def __repr__(self) -> str:
        return "<factory>"


def _compiled_init(kind: Any, frozen: bool) -> Any:
    """Compile the function that is given the fields of a class and stores them."""
    made, missing = _Factory(), dataclasses.MISSING
    names: dict[str, Any] = {"store_": object.__setattr__, "made_": made}
    given, by_name, stored = ["self"], list[str](), list[str]()
    every: tuple[dataclasses.Field[Any], ...] = fields(kind)
    for one in every:
        name = value = one.name
        default = made
        if one.default_factory is missing:
            default = one.default
        else:
            names[f"make_{name}"] = one.default_factory
            value = f"make_{name}() if {name} is made_ else {name}" if one.init else f"make_{name}()"
        if one.init:
            names[f"default_{name}"] = default
            (by_name if one.kw_only else given).append(name if default is missing else f"{name}=default_{name}")
        if one.init or default is made:
            stored.append(f"store_(self, {name!r}, {value})" if frozen else f"self.{name} = {value}")
    if hasattr(kind, "__post_init__"):
        stored.append("self.__post_init__()")
    given += ["*", *by_name] if by_name else []
    exec(f"def __init__({', '.join(given)}):\n " + "\n ".join(stored or ["pass"]), names)
    init = names["__init__"]
    init.__qualname__ = f"{kind.__qualname__}.__init__"
    init.__annotations__ = {one.name: one.type for one in every if one.init} | {"return": None}
    return init


def _methods(kind: Any, frozen: bool, eq: bool, shown: bool) -> dict[str, Any]:
    every: tuple[dataclasses.Field[Any], ...] = fields(kind)
    compared = [one.name for one in every if one.compare]
    values = attrgetter(*compared, *(compared[:1] or ["__class__"]))  # once more: a tuple, of one field too
    names = [one.name for one in every if one.repr]

    def __eq__(self: Any, other: Any) -> Any:
        return values(self) == values(other) if other.__class__ is self.__class__ else NotImplemented

    def __hash__(self: Any) -> int:
        return hash(values(self))

    @recursive_repr("...")
    def __repr__(self: Any) -> str:
        return f"{self.__class__.__qualname__}({', '.join(f'{name}={getattr(self, name)!r}' for name in names)})"

    def refuse(self: Any, name: str, *_: object) -> None:
        raise dataclasses.FrozenInstanceError(f"cannot assign to or delete field {name!r}")

    made: dict[str, Any] = {"__init__": _Init(kind, frozen)}
    if shown:
        made["__repr__"] = __repr__
    if eq:
        made |= {"__eq__": __eq__, "__hash__": __hash__ if frozen else None}
    if frozen:
        made |= {"__setattr__": refuse, "__delattr__": refuse}
    return made
