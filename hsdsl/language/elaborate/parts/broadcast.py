# pyright: basic
"""Broadcasts: what all parts do at the instant of one transition, every reset reading the values before."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

from hsdsl.base.names import SINCE
from hsdsl.language.elaborate.parts.names import Board
from hsdsl.language.elaborate.parts.transitions import Event, PartTransition
from hsdsl.language.expression.algebra import ONE, ZERO, either, is_mode, select, total, truth_of, whole
from hsdsl.language.expression.scope import symbol


@dataclass
class Broadcast:
    """The transitions that listen to others, and what follows from one that fires.

    An instance makes one transition at an instant: the first in its file order whose `if` holds. What it makes can be
    listened to in its turn.
    """

    board: Board
    listeners: Sequence[PartTransition]
    _by_event: dict[Event, list[PartTransition]] = field(init=False)

    def __post_init__(self) -> None:
        self._by_event = defaultdict(list)
        for listener in self.listeners:
            if listener.one.part.final[listener.target]:
                message = f"'{listener.name}' fires together with another transition, and leads to a final mode"
                self.board.report_once(listener.place, "HS353", message, "give it a `when`")
            for event in listener.after:
                self._by_event[event].append(listener)

    def followers(self, first: PartTransition) -> Iterator[tuple[Any, PartTransition]]:
        """The transitions that may fire together with one, each with the truth that it does."""
        fired: dict[str, Any] = {first.one.name: ONE}
        settled: set[PartTransition] = set()
        news: dict[Event, Any] = {first.event: ONE}
        while news:
            later: dict[Event, list[Any]] = defaultdict(list)
            for listener in self._hearing(news, first):
                if listener in settled:
                    continue
                heard = either([truth for event, truth in news.items() if event in listener.after])
                if heard == 1:
                    settled.add(listener)
                truth = heard * self._enabled(listener)
                before = fired.get(listener.one.name)
                truth = truth if before is None else truth * (1 - before)
                if truth != 0:
                    fired[listener.one.name] = truth if before is None else before + truth
                    later[listener.event].append(truth)
                    yield truth, listener
            news = {event: sum(truths[1:], truths[0]) for event, truths in later.items()}

    def _hearing(self, news: dict[Event, Any], first: PartTransition) -> list[PartTransition]:
        found = dict.fromkeys(listener for event in news for listener in self._by_event[event])
        places = {listener: k for k, listener in enumerate(self.listeners)}
        return sorted((x for x in found if x.one is not first.one), key=lambda x: (-x.priority, places[x]))

    @staticmethod
    def _enabled(listener: PartTransition) -> Any:
        one = listener.one
        here = is_mode(symbol(one.name), listener.source + 1) if one.part.is_numbered else ONE
        return here if listener.condition is None else here * truth_of(listener.condition)

    def changes(self, first: PartTransition) -> dict[str, Any]:
        """The states that change where a transition fires, with their values, expressions of the values before."""
        values = dict(first.resets)
        setters = dict.fromkeys(first.resets, first)
        if first.one.part.is_numbered and first.target != first.source:
            values[first.one.name] = whole(first.target + 1)
        values |= self._timer(first)
        for truth, follower in self.followers(first):
            given = follower.resets | self._timer(follower)
            if follower.one.part.is_numbered and follower.target != follower.source:
                given[follower.one.name] = whole(follower.target + 1)
            for state, value in given.items():
                setter = setters.setdefault(state, follower)
                if setter.one is not follower.one:
                    self._clash(state, setter, follower)
                safe = total(value, lambda a, b, truth=truth: select(truth, a, b), frozenset())
                values[state] = select(truth, safe, values.get(state, symbol(state)))
        return values

    def _timer(self, made: PartTransition) -> dict[str, Any]:
        """The timer of an instance, which each of its transitions that does not stay sets to 0."""
        return {made.one.full(SINCE): ZERO} if made.one.name in self.board.timed and not made.stays else {}

    def _clash(self, state: str, one: PartTransition, other: PartTransition) -> None:
        message = (
            f"'{one.one.name}.{one.name}' and '{other.one.name}.{other.name}' fire together and both set '{state}'"
        )
        self.board.report_once(other.keys[state], "HS353", message, "let one of them set it")
