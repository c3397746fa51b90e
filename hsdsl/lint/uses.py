"""What uses what: from the names that expressions are written with to what those names define."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import NamedTuple

from hsdsl.lint.source_expressions import SourceExpression
from hsdsl.schema import ModelDocument

_DEFINING = ("parameter", "input", "let")


class Definition(NamedTuple):
    """What a name can stand for: a parameter, an input, a state, or a `let` name of the model or of one mode."""

    kind: str
    mode: str | None
    name: str


class Names:
    """What every name of a model means."""

    def __init__(self, document: ModelDocument) -> None:
        states = dict.fromkeys(str(key) for mode in document.modes.values() for key in mode.flow or ())
        kinds = {"state": states, "input": document.inputs, "parameter": document.parameters, "let": document.let}
        self.top = {str(name): Definition(kind, None, str(name)) for kind, names in kinds.items() for name in names}
        self.own = {
            str(key): {str(name): Definition("let", str(key), str(name)) for name in mode.let}
            for key, mode in document.modes.items()
        }

    def used(self, expression: SourceExpression) -> Iterator[Definition]:
        """What an expression names, but for `t`, `pi` and the like."""
        everywhere = expression.role == "output" and expression.mode is None  # it is read in every mode
        inner = self.own.values() if everywhere else [self.own.get(expression.mode or "", {})]
        for name in expression.names:
            own = [table[name] for table in inner if name in table]
            if name in self.top and (everywhere or not own):
                own.append(self.top[name])
            yield from own


def unused(document: ModelDocument, expressions: Iterable[SourceExpression]) -> frozenset[Definition]:
    """The parameters, inputs and `let` names that nothing depends on but, at most, other unused ones."""
    names = Names(document)
    tables = (names.top, *names.own.values())
    uses: dict[Definition, set[Definition]] = {d: set() for t in tables for d in t.values() if d.kind in _DEFINING}
    defined = frozenset(uses)
    waiting: list[Definition] = []
    for expression in expressions:
        if expression.role in _DEFINING:
            own = Definition(expression.role, expression.mode, str(expression.name))
            uses[own].update(names.used(expression))
        else:
            waiting.extend(names.used(expression))
    reached: set[Definition] = set()
    while waiting:
        found = waiting.pop()
        if found not in reached:
            reached.add(found)
            waiting.extend(uses.get(found, ()))
    return defined - reached
