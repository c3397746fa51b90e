# pyright: basic
"""Initial values of instances: expressions of parameters, and of the initial values of any instances."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

from hsdsl.base.names import did_you_mean
from hsdsl.language.elaborate.parts.instances import Instance
from hsdsl.language.elaborate.parts.names import IN_MODE, MEMBER, Board, Names, whole_value
from hsdsl.language.elaborate.symbols import Meanings
from hsdsl.language.expression.scope import Meaning, Refusal, Scope, Value, state
from hsdsl.language.source import Scalar

_SENTENCE = "an initial value is an expression of parameters and of other initial values"


@dataclass
class Starts:
    """The initial values of all instances; ``written`` has each behind those whose states it uses."""

    board: Board
    written: dict[str, Any] = field(default_factory=dict)
    _known: dict[str, Value | None] = field(default_factory=dict)
    _active: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.outer: Mapping[str, Meaning] = self.board.symbols.parameter_scope(_SENTENCE).values
        for one in self.board.roster.instances.values():
            for name in given_to(one):
                if name in one.states:
                    self.of(one, name, False)

    def of(self, one: Instance, name: str, symbolic: bool) -> Meaning:
        """The initial value of a state of an instance, or with ``symbolic`` its symbol."""
        full, given = one.full(name), given_to(one)
        if name not in given:
            mode = one.part.modes[one.start or 0]
            message = f"'{name}' has no initial value where '{one.automaton}' starts in '{mode}'"
            return Refusal("HS308", message, None)
        if full not in self._known:
            if full in self._active:
                path = " -> ".join((*self._active[self._active.index(full) :], full))
                message = f"the initial value of '{full}' is defined by itself: {path}"
                self.board.symbols.report(given[name].place, "HS302", message, "give one of them by parameters")
                return None
            self._active.append(full)
            try:
                value = self._number(one, given[name], False, one.index)
                expr = self._number(one, given[name], True, one.index) if value is not None else None
            finally:
                self._active.pop()
            self._known.setdefault(full, value)
            if expr is not None:
                self.written[full] = expr.expr
        found = self._known[full]
        return state(full) if symbolic and found is not None else found

    def _number(self, one: Instance | None, scalar: Scalar, symbolic: bool, index: int | None) -> Value | None:
        names = StartNames(self, one, index, symbolic)
        scope = Scope(names, expanded=Names(self.board, one, None, index).expanded)
        return self.board.symbols.number(scalar, scope, finite_now=not symbolic)

    def beyond(self, base: str, number: int, attribute: str, symbolic: bool) -> Meaning:
        """What a name is beyond the first and the last of several instances."""
        given = self.board.at_end(base, number, attribute)
        return given if isinstance(given, Refusal) else self._number(None, given, symbolic, number)


def given_to(one: Instance) -> dict[str, Scalar]:
    """The initial values that an instance is given."""
    extra = one.given.initial.__pydantic_extra__ if one.given.initial else {}
    return {str(key): scalar for key, scalar in extra.items()}


@dataclass(frozen=True)
class StartNames(Mapping[str, Meaning]):
    """The names in the initial values of an instance, or beyond the ends of several."""

    starts: Starts
    one: Instance | None
    index: int | None
    symbolic: bool

    def __getitem__(self, name: str) -> Meaning:
        one, board = self.one, self.starts.board
        if "." in name:
            return self._member(name)
        if one is not None and name in one.kind.parameters:
            return board.parameters.get(one.full(name))
        if name == "index" and self.index is not None:
            return whole_value(self.index)
        if one is not None and name in one.states:
            return self.starts.of(one, name, self.symbolic)
        return self.starts.outer[name]

    def _member(self, name: str) -> Meaning:
        found, board = MEMBER.fullmatch(name), self.starts.board
        if found is None:
            raise KeyError(name)
        base, index, attribute = found.groups()
        other: Any = board.instance(base, index, Names(board, self.one, None, self.index))
        if other is None or isinstance(other, Refusal):
            return other
        if isinstance(other, int):
            return self.starts.beyond(base, other, attribute, self.symbolic)
        if attribute in other.kind.parameters:
            return board.parameters.get(other.full(attribute))
        if attribute.startswith(IN_MODE):
            return whole_value(int(other.part.modes[other.start or 0] == attribute.removeprefix(IN_MODE)))
        if attribute in other.states:
            return self.starts.of(other, attribute, self.symbolic)
        known = [*other.states, *map(str, other.kind.parameters)]
        message = f"'{attribute}' is no state or parameter of '{other.automaton}'"
        return Refusal("HS111", message, did_you_mean(attribute, known, _SENTENCE))

    def __iter__(self) -> Iterator[str]:
        if self.one is not None:
            yield from (*self.one.states, *map(str, self.one.kind.parameters))
        yield from self.starts.outer

    def __len__(self) -> int:
        return sum(1 for _ in self)

    def items(self) -> Any:
        """The names with their meanings, for hints: states without working their values out."""
        own: Meanings = {} if self.one is None else {name: state(name) for name in self.one.states}
        return [*own.items(), *self.starts.outer.items()]
