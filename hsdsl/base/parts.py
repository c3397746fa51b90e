"""The parts of a composed system, what the numbers of their modes are called, and modes and edges as the file has them.

A system of parts is one mode over the states of all of them. The mode of a part with several is a number that no flow
changes, 1 for the first: a state with the name of the part. So what a system costs grows with the sum of its parts'
modes, and a product mode exists only where a run visits it. An event has several edges in a system, and one in a file.
"""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol, TypeVar

from hsdsl.base.names import did_you_mean

_LISTED = 8  # instances that a hint names
_INDEX = re.compile(r"\[\d+\]")


@dataclass(frozen=True)
class Part:
    """An instance of an automaton: its name, the names of its modes, and the states that each of them has.

    ``start`` is the index of the mode it starts in.
    """

    name: str
    modes: tuple[str, ...]
    states: tuple[tuple[str, ...], ...]
    final: tuple[bool, ...]
    start: int = 0

    @property
    def is_numbered(self) -> bool:
        """Whether its mode is a state of the system."""
        return len(self.modes) > 1

    def number(self, state: Mapping[str, Any]) -> int:
        """The index of the mode it is in, at a state of the system."""
        return int(state[self.name]) - 1 if self.is_numbered else 0


def numbered(parts: Sequence[Part]) -> tuple[str, ...]:
    """The states that are numbers of modes."""
    return tuple(part.name for part in parts if part.is_numbered)


def product_name(parts: Sequence[Part], state: Mapping[str, Any]) -> str:
    """What the product mode at a state of the system is called, as `a=on b=off`."""
    return " ".join(f"{part.name}={part.modes[part.number(state)]}" for part in parts)


def numbers_of(parts: Sequence[Part], name: str) -> dict[str, int]:
    """The numbers of the product mode of this name.

    Raises ValueError: it is none; the message says why.
    """
    given: dict[str, str] = {}
    for item in name.split():
        part, _, mode = item.partition("=")
        given[part] = mode
    for part in parts:
        if given.get(part.name) not in part.modes:
            raise ValueError(f"expected {part.name}= and one of {', '.join(part.modes)}")
    if len(given) > len(parts):
        raise ValueError("it names more than the parts of the model")
    return {part.name: part.modes.index(given[part.name]) + 1 for part in parts if part.is_numbered}


def present(parts: Sequence[Part], state: Mapping[str, Any]) -> frozenset[str]:
    """The states that the product mode at a state of the system has."""
    return frozenset(name for part in parts for name in part.states[part.number(state)])


def of_all(name: str) -> str:
    """The name of something that all instances of a `count` have: `leg.k` for `leg[3].k`."""
    return _INDEX.sub("", name)


def for_all(given: Mapping[str, Any], known: Iterable[str]) -> dict[str, Any]:
    """Values by name, those for all instances under the name of each; one that is given by itself counts more."""
    whole, all_of = {*known}, defaultdict[str, list[str]](list)
    for name in dict.fromkeys(known):
        all_of[of_all(name)].append(name)
    members = {name: all_of.get(name, [name]) for name in given if name not in whole}
    spread = {member: given[name] for name, own in members.items() for member in own}
    return spread | {name: value for name, value in given.items() if name in whole}


def meant(name: str, known: Iterable[str]) -> str | None:
    """The hint for a name that is none of those known, nor one for all instances."""
    names = list(dict.fromkeys(known))
    if alike := [each for each in names if of_all(each) == of_all(name)]:
        return f"known here: {alike[0]} to {alike[-1]}, and {of_all(name)} for all"
    return did_you_mean(name, names if "[" in name else map(of_all, names))


def meant_alone(name: str, known: Iterable[str]) -> str | None:
    """The hint for a name that is none of those known, where one for all instances has no meaning."""
    names = list(dict.fromkeys(known))
    if alike := [each for each in names if of_all(each) == name]:
        return f"name one instance: {', '.join([*alike[:_LISTED], *['...'] * (len(alike) > _LISTED)])}"
    return meant(name, names) if "[" in name else did_you_mean(name, names)


class Layout(NamedTuple):
    """Where parts are among the states of their system, as numbers and letters for other languages."""

    numbers: tuple[int, ...]  # the place of each part's number among the states, -1 for a part with one mode
    owners: tuple[int, ...]  # the part that each state is of, -1 for the numbers of modes
    owned: tuple[str, ...]  # for each state and each mode of its part `1` where the mode has it, else `0`


def layout_of(parts: Sequence[Part], states: Sequence[str]) -> Layout:
    """Where parts are among the states of their system; nowhere where there are no parts."""
    if not parts:
        return Layout((), (), ())
    places = {name: k for k, name in enumerate(states)}
    owner = {name: k for k, part in enumerate(parts) for own in part.states for name in own}
    owners = tuple(owner.get(name, -1) for name in states)
    return Layout(
        tuple(places[part.name] if part.is_numbered else -1 for part in parts),
        owners,
        tuple(
            "" if k < 0 else "".join(str(int(name in own)) for own in parts[k].states)
            for name, k in zip(states, owners, strict=True)
        ),
    )


def change(source: str, target: str, edge: str) -> str:
    """What an edge does to the names of modes: of a product only the parts that change, or the one that the edge is of.

    Names of parts and of their modes have no `=`, nor have modes of other models.
    """
    pairs = list(zip(_items(source), _items(target), strict=False))
    if "=" not in source or "=" not in target or [a[0] for a, _ in pairs] != [b[0] for _, b in pairs]:
        return f"{source} -> {target}"
    own = edge.rpartition(".")[0]
    moved = [(name, old, new) for (name, old), (_, new) in pairs if old != new]
    moved = moved or [(name, old, new) for (name, old), (_, new) in pairs if name == own]
    return ", ".join(f"{name}: {old} -> {new}" for name, old, new in moved) or "unchanged"


def compact(name: str) -> str:
    """The name of a mode; of a product with neighbours that are alike taken together, as `leg[1..4]=air`."""
    return _joined(_items(name)) if "=" in name else name


def short_names(names: Sequence[str]) -> dict[str, str]:
    """Product modes in a legend: without the parts that are in one mode in all, those alike as `leg[1..4]=air`."""
    products = {name: _items(name) for name in names if "=" in name}
    differ = {part for items in zip(*products.values(), strict=False) if len(set(items)) > 1 for part, _ in items}
    short = {name: _joined([item for item in items if item[0] in differ]) for name, items in products.items()}
    return {name: short.get(name) or compact(name) for name in names}


def parts_in(names: Sequence[str]) -> dict[str, dict[str, str]] | None:
    """By part the mode that it has in each product mode, of the parts that differ; None where these are no products."""
    if not names or not all("=" in name for name in names):
        return None
    found: dict[str, dict[str, str]] = {}
    for name in names:
        for part, mode in _items(name):
            found.setdefault(part, {})[name] = mode
    return {part: modes for part, modes in found.items() if len({*modes.values()}) > 1 or len(modes) < len(names)}


def _items(product: str) -> list[tuple[str, str]]:
    """The parts and their modes in the name of a product mode."""
    return [(part, mode) for part, _, mode in (item.partition("=") for item in product.split())]


def _joined(items: Sequence[tuple[str, str]]) -> str:
    """The name of some parts and their modes, with neighbours in a row that are alike taken together."""
    rows: list[tuple[str, str, list[str]]] = []
    for part, mode in items:
        base, _, index = part.partition("[")
        if rows and index and rows[-1][2] and rows[-1][:2] == (base, mode):
            rows[-1][2].append(index[:-1])
        else:
            rows.append((base, mode, [index[:-1]] if index else []))
    return " ".join(f"{base}{_range(indices)}={mode}" for base, mode, indices in rows)


def _range(indices: Sequence[str]) -> str:
    if not indices:
        return ""
    return f"[{indices[0]}]" if len(indices) == 1 else f"[{indices[0]}..{indices[-1]}]"


class _Edge(Protocol):
    @property
    def name(self) -> str: ...

    @property
    def source(self) -> Any: ...

    @property
    def target(self) -> Any: ...

    @property
    def of_event(self) -> tuple[str, ...]: ...


class _Mode(Protocol):
    @property
    def name(self) -> str: ...

    @property
    def edges(self) -> Sequence[_Edge]: ...


E = TypeVar("E", bound=_Edge)
M = TypeVar("M", bound=_Mode)


def written_edges(edges: Iterable[E], also: Collection[Any] = ()) -> list[E]:
    """The edges of a mode, of each event only its own one; of those into the modes ``also`` the first."""
    found: dict[Any, E] = {}
    for k, edge in enumerate(edges):
        key = (edge.name,) if edge.of_event else k
        if not _is_inner(edge) or edge.target in also:
            found.setdefault(key, edge)
    return list(found.values())


def _is_inner(edge: _Edge) -> bool:
    """Whether an edge only changes what an event remembers, or ends a run."""
    return bool(edge.of_event) and edge.name != edge.of_event[0]


def inner_modes(modes: Iterable[_Mode]) -> set[Any]:
    """The modes in which runs end where too many executions of an event wait, as edges name them."""
    return {e.target for mode in modes for e in mode.edges if _is_inner(e) and e.target != e.source}


def written_modes(modes: Sequence[M]) -> list[M]:
    """The modes of the file."""
    inner = inner_modes(modes)
    return [mode for k, mode in enumerate(modes) if k not in inner and mode.name not in inner]


def event_text(of_event: Sequence[str]) -> list[str]:
    """How an event is written, key by key; nothing for another edge."""
    return [f"event {of_event[1]}", *of_event[2:]] if of_event else []
