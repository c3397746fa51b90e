# pyright: basic
"""An event as mathematics: its condition, the states that remember what it did, and the executions that can wait."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from hsdsl.base.functions import below, replaced
from hsdsl.base.names import memory
from hsdsl.language.expression.algebra import either, is_mode, select, total, whole
from hsdsl.language.expression.conditions import Reached, comparisons, number, reached
from hsdsl.language.expression.scope import symbol
from hsdsl.language.system import HALF, ONE, TIME, ZERO, Edge, Mode, Queue, Surface

Values = dict[str, Any]


@dataclass(frozen=True)
class Event:
    """An event as it was written, ``edge``, and the names of the states that remember what it did.

    ``timed`` says that `since` is the time since the mode was entered, and ``jumps`` that the condition may turn true
    by a reset, or hold where the mode is entered. ``flow`` has the rates of symbols; ``constants`` are parameters.
    """

    edge: Edge
    mode: Mode
    timed: bool
    flow: Mapping[Any, Any]
    constants: frozenset[Any]
    jumps: bool = False

    @cached_property
    def names(self) -> dict[str, str]:
        parts = ["armed", *(["due"] if self.jumps else []), *([] if self.delay is None else ["waiting"])]
        return {part: memory(self.edge.name, part) for part in parts}

    @cached_property
    def stored(self) -> dict[str, str]:
        """States that the execution that waits gives values, and the states that have these; numbers need no memory."""
        given = self.edge.values
        own = () if self.delay is None or self.event.at_execution else self.event.given
        return {x: memory(self.edge.name, f"to.{x}") for x in own if x in given and given[x].free_symbols}

    @property
    def at(self) -> Any:
        """The time at which the execution that waits is made."""
        return symbol(self._at)

    @property
    def _at(self) -> str:
        return memory(self.edge.name, "at")

    @property
    def queue(self) -> Queue | None:
        """Where several executions can wait: one that is not persistent is gone before it is triggered again."""
        if self.delay is None or not self.event.persistent:
            return None
        return Queue(self.names["waiting"], (self._at, *self.stored.values()), self.event.waiting)

    @cached_property
    def symbols(self) -> frozenset[Any]:
        """What its condition depends on."""
        return frozenset().union(*(c.residual.free_symbols for c in comparisons(self.event.trigger)))

    def rate(self, expression: Any) -> Any:
        """How fast an expression changes along the flow of the mode."""
        known, done = number_left(self.edge), dict[Any, Any]()
        moving = ((s, self.flow[s]) for s in sorted(expression.free_symbols, key=str) if s in self.flow)
        return sum((expression.diff(s) * replaced(flow, known, done) for s, flow in moving), ZERO)

    @property
    def delay(self) -> Any | None:
        return self.event.delay

    @cached_property
    def priority(self) -> Any:
        """The number that decides which event goes first; 0 where its part is in another mode."""
        given, here = self.event.priority, self.here({}, {})
        return whole(self.edge.priority) if given is None else select(here, self.guarded(given, here), ZERO)

    @cached_property
    def ready(self) -> Any:
        """1 where it is to be made at this instant, else 0."""
        if self.delay is not None:
            ready = below(self.symbol("waiting"), HALF, ZERO, ONE) * reached(TIME, self.at)
        else:
            ready = self.symbol("armed") * self.rises()
            ready = either([ready, self.symbol("due")]) if self.jumps else ready
        here = self.here({}, {})
        return ready if here == 1 else select(here, self.guarded(ready, here), ZERO)

    def goes_before(self, other: Event) -> bool:
        """Whether it goes before another one, of those that are made at one instant, by M6."""
        names = [edge.name for edge in self.mode.edges]
        ranks = [(-each.edge.priority, names.index(each.edge.name)) for each in (self, other)]
        return ranks[0] < ranks[1]

    @property
    def event(self) -> Any:
        assert self.edge.event is not None
        return self.edge.event

    @property
    def states(self) -> tuple[str, ...]:
        return (*self.names.values(), *(() if self.delay is None else (self._at, *self.stored.values())))

    def symbol(self, part: str) -> Any:
        return symbol(self.names[part])

    def here(self, meaning: Mapping[Any, Any], known: Mapping[Any, Any]) -> Any:
        """1 where its part is in its mode, at new values of states."""
        if self.edge.part is None:
            return ONE
        number = symbol(self.edge.part[0])
        return is_mode(meaning.get(number, number).xreplace(known), self.edge.part[1])

    def guarded(self, expression: Any, truth: Any) -> Any:
        """An expression that has a value also where something is not true."""
        return total(expression, lambda a, b: select(truth, a, b), self.constants)

    def surface(self, left: Any, right: Any, text: str) -> Surface:
        """A surface of its mode; inside everywhere where its part is in another one."""
        here = self.here({}, {})
        if here == 1:
            return Surface(left, right, left - right, text)
        rest = ((left, ZERO), (right, ZERO), (left - right, -ONE))
        left, right, residual = (select(here, self.guarded(side, here), other) for side, other in rest)
        return Surface(left, right, residual, text)

    def touched(self, meaning: Mapping[Any, Any]) -> bool:
        """Whether new values of states change its condition."""
        return any(c.residual.xreplace(meaning) != c.residual for c in comparisons(self.event.trigger))

    def after(self, meaning: Mapping[Any, Any], reached: Reached | None = None, going_on: bool = False) -> Any:
        """1 where the condition holds at new values of states.

        Of the comparisons that stay the one that was ``reached`` holds while the flow does not lead back, and so do
        those that counted as reached with it. Where the mode is ``going_on``, comparisons that stay are on their
        surfaces what they are next.
        """

        def of(part: Reached) -> Any:
            stays = part.residual.xreplace(meaning) == part.residual
            if stays and going_on and part.strict and (rate := self.rate(part.residual)) != 0:
                return part.rises(rate, TIME).xreplace(meaning)
            if reached is None or not stays:
                return part.holds(meaning)
            turns = part.turns(reached)
            rate = self.rate(part.residual)
            return (
                part.nearly_holds(rate, TIME) if turns is None else part.holds_next(turns, rate, rate.xreplace(meaning))
            )

        return number(self.event.trigger, of)

    def leaves(self, meaning: Mapping[Any, Any]) -> bool:
        """Whether new values of states change how its comparisons change along the flow."""
        rates = (self.rate(c.residual) for c in comparisons(self.event.trigger))
        return any(rate.xreplace(meaning) != rate for rate in rates)

    def rises(self) -> Any:
        """1 where the flow turns the condition true at this instant, else 0."""
        return number(self.event.trigger, lambda part: part.rises(self.rate(part.residual), TIME))


def number_left(edge: Edge) -> dict[Any, Any]:
    """The number of the part's mode that an edge leaves."""
    return {} if edge.part is None else {symbol(edge.part[0]): whole(edge.part[1])}


def chosen(event: Event, truth: Any, values: Values, others: Values) -> Values:
    """Values where something is true, and others elsewhere."""
    if truth == 1:
        return values
    return {name: select(truth, event.guarded(value, truth), others[name]) for name, value in values.items()}
