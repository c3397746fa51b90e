"""Many assignments as C of bounded size: those of one shape as loops over tables, the others in pieces of a function.

A compiler takes more than twice as long for a function twice as long. So equations of the same shape, such as those of
the masses of a chain, are compiled once: what differs between them, indices and numbers, is data.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

LARGE = 128  # assignments: fewer are written as they are
LEAST_LIKE = 8  # assignments of one shape that become a loop
LONGEST = 128  # statements of a piece
_OPERAND = re.compile(r"\b([a-z]+)\[(\d+)\]|\bl(\d+)\b|(\(\(hs_real\)-?0x[0-9a-f.p+-]+\))")
_OWN = "(lines + ({}) * length)"  # what l{} means


@dataclass(frozen=True)
class Assignment:
    """``target = value;`` behind those that it ``needs``, by their numbers: all of them come before it."""

    target: str
    value: str
    needs: Iterable[int] = ()


def pieces(assignments: Sequence[Assignment]) -> list[list[str]]:
    """The statements of assignments, in pieces; each needs what those before it assign, and its own statements."""
    found: list[list[str]] = [[]]
    for statement in _statements(assignments):
        if len(found[-1]) >= LONGEST:
            found.append([])
        found[-1].append(statement)
    return found


def _statements(assignments: Sequence[Assignment]) -> Iterator[str]:
    for level in _levels(assignments):
        groups: dict[str, list[Assignment]] = {}
        for one in level:
            groups.setdefault(_OPERAND.sub(_shape, f"{one.target} = {one.value};"), []).append(one)
        for group in groups.values():
            texts = [f"{one.target} = {one.value};" for one in group]
            if len(group) >= LEAST_LIKE:
                yield _loop(texts)
            else:
                yield from (_OPERAND.sub(lambda found: _named(found, found[2] or found[3]), text) for text in texts)


def _levels(assignments: Sequence[Assignment]) -> list[list[Assignment]]:
    """Assignments, behind each other only where one needs the other."""
    depth: list[int] = []
    levels: list[list[Assignment]] = []
    for one in assignments:
        depth.append(1 + max((depth[i] for i in one.needs), default=-1))
        if depth[-1] == len(levels):
            levels.append([])
        levels[depth[-1]].append(one)
    return levels


def _shape(found: re.Match[str]) -> str:
    return f"{found[1]}[]" if found[1] else "l" if found[3] else "number"


def _named(found: re.Match[str], index: str | None) -> str:
    """An operand, with another index in the place of its own."""
    if found[1]:
        return f"{found[1]}[{index}]"
    return _OWN.format(index) if found[3] else found[4]


def _loop(texts: Sequence[str]) -> str:
    """Statements of one shape as a loop; what is the same in all of them, or goes up evenly, needs no table."""
    matches = [list(_OPERAND.finditer(text)) for text in texts]
    tables: dict[bool, list[list[str]]] = {False: [], True: []}  # of indices, of numbers
    names: list[str] = []
    for column in zip(*matches, strict=True):
        index = column[0][4] is None
        values = [found[2] or found[3] or found[4] for found in column]
        plain = _plain(values) if index else values[0] if len(set(values)) == 1 else None
        if plain is None:
            tables[not index].append(values)
            plain = f"{'of' if index else 'number'}[i][{len(tables[not index]) - 1}]"
        names.append(_named(column[0], plain) if index else plain)
    iterator = iter(names)
    body = _OPERAND.sub(lambda _: next(iterator), texts[0])
    declared = "".join(_table(kind, columns) for kind, columns in tables.items() if columns)
    return f"{{ {declared}for (int i = 0; i < {len(texts)}; i++) {body} }}"


def _plain(indices: Sequence[str]) -> str | None:
    numbers = list(map(int, indices))
    first, step = numbers[0], numbers[1] - numbers[0]
    if any(number != first + i * step for i, number in enumerate(numbers)):
        return None
    return str(first) if step == 0 else f"{first} + {step} * i"


def _table(numbers: bool, columns: Sequence[Sequence[str]]) -> str:
    rows = ", ".join(f"{{{', '.join(row)}}}" for row in zip(*columns, strict=True))
    kind, name = ("hs_real", "number") if numbers else ("int", "of")
    return f"static const {kind} {name}[][{len(columns)}] = {{{rows}}}; "
