"""What uses what: from the names that expressions are written with to what those names define."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import NamedTuple

from hsdsl.lint.written import Written
from hsdsl.schema import Model

_DEFINING = ("parameter", "input", "let")


class Definition(NamedTuple):
    """What a name can stand for: a parameter, an input, a state, or a `let` name of the model or of one mode."""

    kind: str
    mode: str | None
    name: str


def definition(document: Model, mode: str | None, name: str) -> Definition | None:
    """What a name means in a mode, or outside all modes; None for `t`, `pi` and the like."""
    if mode is not None and name in document.modes[mode].let:  # pyright: ignore[reportArgumentType]
        return Definition("let", mode, name)
    for kind, table in (("let", document.let), ("parameter", document.parameters), ("input", document.inputs)):
        if name in table:
            return Definition(kind, None, name)
    if any(name in (other.flow or ()) for other in document.modes.values()):
        return Definition("state", None, name)
    return None


def needs(document: Model, expression: Written) -> Iterator[Definition]:
    """What an expression names."""
    for name in expression.names:
        found = definition(document, expression.mode, name)
        if found is not None:
            yield found


def unused(document: Model, expressions: Iterable[Written]) -> frozenset[Definition]:
    """The parameters, inputs and `let` names that nothing depends on but, at most, other unused ones."""
    uses: dict[Definition, set[Definition]] = {
        **{Definition("parameter", None, str(name)): set() for name in document.parameters},
        **{Definition("input", None, str(name)): set() for name in document.inputs},
        **{Definition("let", None, str(name)): set() for name in document.let},
        **{Definition("let", str(m), str(name)): set() for m, mode in document.modes.items() for name in mode.let},
    }
    defined = frozenset(uses)
    waiting: list[Definition] = []
    for expression in expressions:
        if expression.role in _DEFINING:
            own = Definition(expression.role, expression.mode, str(expression.name))
            uses[own].update(needs(document, expression))
        else:
            waiting.extend(needs(document, expression))
    reached: set[Definition] = set()
    while waiting:
        found = waiting.pop()
        if found not in reached:
            reached.add(found)
            waiting.extend(uses.get(found, ()))
    return defined - reached
