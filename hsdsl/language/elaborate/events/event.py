# pyright: basic
"""An event as mathematics: its condition, the states that remember what it did, and the edges that it becomes.

States have the first that waits; where several can, `hsdsl.engine.simulate.transitions` keeps the others.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any

from hsdsl.base.functions import below, maximum, replaced
from hsdsl.base.names import memory
from hsdsl.language.expression.algebra import either, is_mode, select, total, whole
from hsdsl.language.expression.conditions import Reached, comparisons, condition, number, reached
from hsdsl.language.expression.scope import symbol
from hsdsl.language.system import HALF, ONE, TIME, TRUTH, ZERO, Edge, Mode, Queue, Surface, all_of, at_least

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
        """What its condition depends on, and how that changes along the flow."""
        return frozenset().union(*(part.free_symbols for one in self.rates.items() for part in one))

    @cached_property
    def rates(self) -> dict[Any, Any]:
        """How fast its surface functions change along the flow of the mode."""
        known, done = number_left(self.edge), dict[Any, Any]()

        def rate(residual: Any) -> Any:
            moving = ((s, self.flow[s]) for s in sorted(residual.free_symbols, key=str) if s in self.flow)
            return sum((residual.diff(s) * replaced(flow, known, done) for s, flow in moving), ZERO)

        return {part.residual: rate(part.residual) for part in comparisons(self.event.trigger)}

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
            ready = either([ready, self.due]) if self.jumps else ready
        here = self.here({}, {})
        return ready if here == 1 else select(here, self.guarded(ready, here), ZERO)

    @property
    def due(self) -> Any:
        """1 where resets have set it off, else 0."""
        return below(self.symbol("due"), HALF, ZERO, ONE)

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

    def after(self, meaning: Mapping[Any, Any]) -> Any:
        """1 where the condition holds at new values of states."""
        return number(self.event.trigger, lambda part: part.holds(meaning))

    def going_on(self, meaning: Mapping[Any, Any], reached: Reached | None, own: bool = False) -> Any:
        """1 where the condition holds at new values of states in a mode that goes on; ``own`` are those of its reset.

        A comparison that the reset changes has its value. Others count as what they are next along the flow: on the
        surface that was ``reached`` the opposite one is false. One that turned true there stays so, if it is not
        strict, though the flow is turned back, but for an event's own reset. A strict one that this leaves on the
        surface that set it off is no crossing of its own.
        """

        def of(part: Reached) -> Any:
            turns, rate = part.turns(reached), self.rates[part.residual]
            if part.residual.xreplace(meaning) != part.residual:
                stands = own and bool(turns) and part.strict
                return part.goes_on(rate, TIME).xreplace(meaning) if stands else part.holds(meaning)
            if turns is None:
                return part.holds(meaning) if rate == 0 else part.goes_on(rate, TIME).xreplace(meaning)
            if part.strict or own or not turns:
                return part.holds_next(turns and own, rate, rate.xreplace(meaning))
            return ONE

        return number(self.event.trigger, of)

    def leaves(self, meaning: Mapping[Any, Any]) -> bool:
        """Whether new values of states change how its comparisons change along the flow."""
        return any(rate.xreplace(meaning) != rate for rate in self.rates.values())

    def rises(self, reached: Reached | None = None) -> Any:
        """1 where the flow turns the condition true at this instant, at which a surface was ``reached``, else 0."""

        def of(part: Reached, one: Callable[[Any, Any], Any]) -> Any:
            turns = part.turns(reached)
            return one(self.rates[part.residual], TIME) if turns is None else ONE if turns else ZERO

        parts = comparisons(self.event.trigger)
        crossed = either([of(part, part.crosses) for part in parts]) if parts else ZERO
        return crossed if len(parts) < 2 else crossed * number(self.event.trigger, lambda part: of(part, part.goes_on))


def number_left(edge: Edge) -> dict[Any, Any]:
    """The number of the part's mode that an edge leaves."""
    return {} if edge.part is None else {symbol(edge.part[0]): whole(edge.part[1])}


def chosen(event: Event, truth: Any, values: Values, others: Values) -> Values:
    """Values where something is true, and others elsewhere."""
    if truth == 1:
        return values
    return {name: select(truth, event.guarded(value, truth), others[name]) for name, value in values.items()}


def _begins_to_wait(event: Event) -> Values:
    """The values where an event is triggered: those of the execution that begins to wait."""
    delay = maximum(event.delay, ZERO) if event.delay != 0 else ZERO
    given, waiting = event.edge.values, event.symbol("waiting")
    values = {waiting.name: ONE if event.queue is None else waiting + 1, event.at.name: TIME + delay}
    return values | {name: given[state] for state, name in event.stored.items()}


def dropped(event: Event) -> Values:
    return {} if event.event.persistent or event.delay is None else {event.names["waiting"]: ZERO}


def _executes(event: Event) -> Edge:
    """The edge that gives the states, after the delay, the values that were stored."""
    edge, waiting = replace(event.edge, event=None), event.symbol("waiting")
    texts = dict(zip(edge.target_states, edge.reset_texts, strict=True))
    values = edge.values | {state: symbol(name) for state, name in event.stored.items()}
    if edge.target == event.mode.name:
        values[waiting.name] = ZERO if event.queue is None else waiting - 1
    surface = event.surface(TIME, event.at, f"t >= {event.at.name}")
    states, reset = tuple(values), tuple(values.values())
    edge = replace(edge, surface=surface, condition=at_least(waiting, HALF), target_states=states, reset=reset)
    return replace(
        edge, reset_texts=tuple(texts.get(name, name) for name in states), condition_text=f"{waiting.name} >= 1/2"
    )


Draft = tuple[Edge, Event | None, Reached | None]


def _turn(event: Event, events: Sequence[Event]) -> Any | None:
    """1 where no event of a higher priority is to be made at this instant, else 0; None where the edges' own decide.

    Each pair is compared by itself, so that an error of a state that priorities read decides nothing between others.
    """
    if all(other.event.priority is None for other in events):
        return None
    others = [other for other in events if other is not event]
    higher = ((other, below(event.priority - other.priority, ZERO, ONE, ZERO)) for other in others)
    return ONE - either([rank * other.ready for other, rank in higher if rank != 0])


def edges_of(event: Event, events: Sequence[Event]) -> Iterator[Draft]:
    """The edges of one of a mode's events: which of them fires it, and the comparison that was reached."""
    edge, trigger, armed = replace(event.edge, event=None), event.event.trigger, event.symbol("armed")
    fires = edge if event.delay is None else _staying(event, f"{edge.name} triggers", _begins_to_wait(event))
    if event.delay is not None:  # what only remembers goes before anything that changes states
        fires = replace(fires, priority=1 + max(other.priority for other in event.mode.edges))
    turn = _turn(event, events)
    goes = () if turn is None or turn == 1 else (at_least(turn, HALF),)
    free = goes if event.delay is None else ()
    for part in comparisons(trigger):
        others = condition(trigger, partial(_with, event, part, True))
        surface = event.surface(part.left, part.right, part.text)
        when = all_of(at_least(armed, HALF), others, *free)
        fires = replace(fires, strict=part.strict)
        yield replace(fires, surface=surface, condition=when, condition_text=event.event.text), event, part
    if event.jumps:
        now = event.due
        if turn is not None and event.delay is None:
            now *= turn
        for other in events if event.delay is None else ():
            if other.delay is not None and other.goes_before(event):
                alike = ONE if turn is None else below(other.priority - event.priority, ZERO, ZERO, ONE)
                now *= 1 - other.ready * alike
            elif turn is None and other.delay is None and other.edge.priority > event.edge.priority:
                now *= 1 - other.ready
        surface = event.surface(now, HALF, f"{event.names['due']} >= 1/2")  # where now is 1, not 0
        yield replace(fires, surface=surface, condition=None, condition_text=None, strict=False), event, None
    if event.delay is not None:
        made = _executes(event)
        yield replace(made, condition=all_of(made.condition, *goes)), None, None
    arms = _staying(event, f"{edge.name} re-arms", {event.names["armed"]: ONE} | dropped(event))
    for part in comparisons(trigger):
        holds = condition(trigger, partial(_with, event, part, False))
        surface = event.surface(part.right, part.left, part.opposite)
        when = all_of(at_least(HALF, armed), ~holds)
        if dropped(event):  # what waits is gone where a strict comparison ends, and is made where another one does
            others = [edge.priority for edge in event.mode.edges]
            arms = replace(arms, priority=max(others) + 1 if part.strict else min(others) - 1)
        yield replace(arms, surface=surface, condition=when, condition_text=f"not ({event.event.text})"), None, None


def _with(event: Event, reached: Reached, value: bool, part: Reached) -> Any:
    """The Boolean of a comparison where another one turns to a value."""
    turns = part.turns(reached)
    return part.follows(event.rates[part.residual], TIME) if turns is None else TRUTH[value == turns]


def _staying(event: Event, name: str, values: Values) -> Edge:
    """An edge that changes some memory of an event, and nothing else."""
    mode = event.mode
    states = (*mode.states, *values)
    reset = (*map(symbol, mode.states), *values.values())
    edge = replace(event.edge, event=None, name=name, target=mode.name, target_states=states, reset=reset)
    return replace(edge, reset_texts=states, stays=True, condition_text=None)
