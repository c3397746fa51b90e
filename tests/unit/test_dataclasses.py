"""Data classes of this package against those of the standard library, of the same classes."""

from __future__ import annotations

import copy
import dataclasses
import inspect
import pickle
from collections.abc import Callable
from contextlib import suppress
from dataclasses import field
from functools import partial
from typing import Any

import pytest

from hsdsl.base import dataclasses as ours

Maker = Callable[..., Any]


def plain(make: Maker) -> Any:
    @make
    class Plain:
        """Two fields and one that is made anew."""

        a: int
        b: str = "b"
        c: list[int] = field(default_factory=list[int], repr=False)

    return Plain


def frozen(make: Maker) -> Any:
    @make(frozen=True)
    class Frozen:
        a: object
        hidden: int = field(default=2, compare=False)
        late: int = field(kw_only=True)
        later: int = 5

        def __post_init__(self) -> None:
            if self.late < 0:
                raise ValueError("late")

    return Frozen


def derived(make: Maker) -> Any:
    base: Any = plain(make)

    @make
    class Derived(base):
        b: str = "other"
        made: dict[str, int] = field(init=False, default_factory=dict[str, int])

        def __eq__(self, other: object) -> bool:
            return isinstance(other, Derived)

    return Derived


def unequal(make: Maker) -> Any:
    @make(frozen=True, eq=False, repr=False)
    class Unequal:
        a: float

    return Unequal


def slotted(make: Maker) -> Any:
    @make(frozen=True, slots=True, order=True)
    class Slotted:
        a: float

    return Slotted


@ours.dataclass(frozen=True)
class Kept:
    """A class that pickles find."""

    a: tuple[int, ...]


POSITIONAL = (), (1,), (1, "x"), (1, "x", [3]), (1, 2, 3, 4, 5)
NAMED: tuple[dict[str, Any], ...] = {}, {"late": 7}, {"late": -1}, {"b": "y"}, {"no": 1}


def values(one: Any) -> Any:
    return [*one.__dict__.items()]


DEEDS: tuple[Callable[[Any], object], ...] = (
    repr,
    dataclasses.asdict,
    values,
    lambda one: (one == copy.copy(one), one == 1),
    lambda one: hash(one) == hash(copy.copy(one)),
    lambda one: one < copy.copy(one),
    lambda one: setattr(one, "a", 3),
    lambda one: setattr(one, "more", 3),
    lambda one: delattr(one, "a"),
    values,
)
NAN = float("nan")


def told(deed: Callable[[], object]) -> str:
    """What comes of a deed, without the places of objects in memory."""
    try:
        return str(deed()).partition(" object at 0x")[0]
    except dataclasses.FrozenInstanceError as error:
        return type(error).__name__
    except (TypeError, ValueError, AttributeError) as error:
        return f"{type(error).__name__}: {error}"


@pytest.mark.parametrize("build", [plain, frozen, derived, unequal, slotted])
@pytest.mark.parametrize("named", NAMED)
@pytest.mark.parametrize("positional", POSITIONAL)
def test_they_do_what_those_of_the_standard_library_do(
    build: Callable[[Maker], Any], positional: tuple[object, ...], named: dict[str, Any]
) -> None:
    def deeds(make: Maker) -> list[str]:
        kind = build(make)
        said = [told(lambda: inspect.signature(kind)), told(lambda: [one.name for one in dataclasses.fields(kind)])]
        said += [told(partial(getattr, kind, "__match_args__")), told(lambda: kind(*positional, **named))]
        with suppress(TypeError, ValueError):
            one = kind(*positional, **named)
            said += [told(lambda deed=deed: deed(one)) for deed in DEEDS]
        return said

    assert deeds(ours.dataclass) == deeds(dataclasses.dataclass)


def test_a_value_that_is_unequal_to_itself_compares_as_in_a_tuple() -> None:
    for make in (ours.dataclass, dataclasses.dataclass):
        kind = plain(make)
        assert kind(NAN) == kind(NAN) and kind(NAN) != kind(-NAN)


def test_they_pickle_and_are_replaced() -> None:
    one = Kept((1, 2))
    assert pickle.loads(pickle.dumps(one)) == one and dataclasses.replace(one, a=(3,)) == Kept((3,))


def test_nothing_is_compiled_before_the_first_object() -> None:
    kind, found = plain(ours.dataclass), list[object]()
    for _ in range(2):
        found.append(kind.__dict__["__init__"])
        assert kind(1).a == 1
    assert [*map(inspect.isfunction, found)] == [False, True]
