"""The order of simultaneous events of equal priority: SBML leaves it to chance, and a model repeats it by a seed.

Each of these events adds a pseudo-random number between 0 and 1 to its priority, and each execution of one draws anew.
The generator is that of Park and Miller (doi:10.1145/63039.63042, with the multiplier of 1993). Its state and the
numbers are whole, and the products stay below 2**53: doubles compute them exactly.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from functools import cached_property, lru_cache
from itertools import pairwise
from math import floor, log2
from typing import Any

from hsdsl.interface.imports.sbml.document import Event, Node
from hsdsl.interface.imports.sbml.formulas import Facts
from hsdsl.language.expression import plain
from hsdsl.language.expression.parse import ExpressionError

FIRST = 10**8  # the priority of what only remembers, before all others
MODULUS = 2**31 - 1
STEP = 48271
LARGEST = 2**20  # numbers up to this many steps of priorities leave 2**32 places between two of them
MOST = 32  # events of one group whose order is drawn: each is compared with each, at every transition
_SCATTERS = 1024  # takes the upper digits: neighbouring seeds have nothing in common then


class Order:
    """The events of a file that chance may order, and what draws their order; ``number`` writes formulas."""

    def __init__(self, facts: Facts, number: Callable[[Node], str], seed: int) -> None:
        self.facts, self.number, self.seed, self._waits = facts, number, seed, False
        self.priorities, self.drawing, self.by_file = dict[str, str](), list[str](), list[str]()  # by names of events
        words = ("seed", "draw", "drawn", "product", "scattered", "next_draw")
        self.seed_name, self.draw, self.drawn, self.product, self.scattered, self.next = map(facts.fresh, words)

    def find(self) -> None:
        """Find the priorities of events that share an instant and effects with others of equal priority.

        Where one of these is no plain number, each is how many of the others it exceeds less how many exceed it.
        """
        for events in self._related():
            given = {e.name: self.number(self.facts.whole(e.priority)) for e in events if e.priority is not None}
            texts = Counter(given.values())
            tied = [name for name, text in given.items() if texts[text] > 1 or _has_rival(text, texts)]
            if not tied:
                continue
            if len(tied) > MOST:
                self.by_file += tied
                continue
            values = {value for value in map(_value, texts) if value is not None}
            step = None if None in map(_value, texts) else _step(sorted(values))
            unit = f"{step!r}*" if step and step < 1 else ""
            for name, text in given.items():
                rank = text if step else " + ".join(f"sign({text} - {other})" for other in texts if other != text)
                key = f"{unit}{self._number(name)}" if name in tied else ""
                self.priorities[name] = " + ".join(filter(None, (rank, key)))

    def _number(self, name: str) -> str:
        """The number that is drawn for an event at each execution."""
        self.drawing.append(name)
        return f"{self.product}({_multiplier(len(self.drawing) - 1)}, {self.draw})/{MODULUS}"

    def parts(self) -> dict[str, dict[str, Any]]:
        """What a model with such events has besides: functions, parameters, states that do not flow."""
        if not self.drawing:
            return {}
        product = {"of": ["a", "b"], "is": f"a*b - {MODULUS}*floor(a*b/{MODULUS})"}
        scattered = {"of": ["n"], "is": f"{self.product}(floor(n/{_SCATTERS}) + 1, n)"}
        first = f"{self.product}({STEP}, {self.seed_name})"
        start = {self.draw: f"{self.scattered}({self.scattered}({first}))"}
        return {
            "parameters": {self.seed_name: str(self.seed)},
            "functions": {self.product: product, self.scattered: scattered},
            "initial": start | ({self.drawn: "0"} if self._waits else {}),
        }

    def reset(self, event: Event, at_trigger: bool) -> dict[str, str]:
        """How an execution of an event draws anew: itself, or by an event that follows where its values are older."""
        if event.name not in self.drawing:
            return {}
        self._waits |= at_trigger
        return {self.drawn: "1"} if at_trigger else {self.draw: self.drawn_anew}

    @property
    def drawn_anew(self) -> str:
        return f"{self.product}({STEP}, {self.draw})"

    def assumption(self) -> Iterator[str]:
        """The sentence on it."""
        of, draws = "the order of simultaneous events of equal priority is", f"drawn by `{self.seed_name}`"
        for names, how in ((self.drawing, draws), (self.by_file, "that of the file")):
            some = ", ".join(names[:2]) + (f" and {len(names) - 2} more" if names[2:] else "")
            yield from (f"{of} {how}: {some}" for _ in names[:1])

    def resets(self) -> list[dict[str, Any]]:
        """The event that draws anew after executions whose values are older than they."""
        if not self._waits:
            return []
        reset = {self.draw: self.drawn_anew, self.drawn: "0"}
        return [{"name": self.next, "event": f"{self.drawn} >= 1", "priority": str(FIRST), "reset": reset}]

    def _related(self) -> Iterator[list[Event]]:
        """Events in groups, of which no two have an effect on each other, at any one instant."""
        groups: list[tuple[set[str], list[Event]]] = []
        for event in self.facts.model.events:
            names, own = self._touched(event), [event]
            for group in [group for group in groups if group[0] & names]:
                groups.remove(group)
                names, own = names | group[0], group[1] + own
            groups.append((names, own))
        place = {event.name: k for k, event in enumerate(self.facts.model.events)}
        yield from (sorted(own, key=lambda event: place[event.name]) for _, own in groups if len(own) > 1)

    def _touched(self, event: Event) -> set[str]:
        """What events change that an event changes or reads, or that moves what its trigger reads."""
        facts = self.facts
        others = [node for node in (event.delay, event.priority) if node is not None]
        formulas = [facts.whole(node) for node in (event.trigger, *others, *(node for _, node in event.changes))]
        names = set[str]().union({name for name, _ in event.changes}, *map(facts.deep, formulas))
        moved = facts.deep(formulas[0]) & {*facts.model.rates, *facts.reacting}
        if moved or any(node.uses("rateOf") for node in formulas):
            names |= self._flows
        if names & {*facts.unknowns}:
            names |= set[str]().union(*map(facts.deep, facts.model.equations))
        names |= {facts.volume(name) or "" for name in names if name in facts.species}
        return names & facts.event_assigned

    @cached_property
    def _flows(self) -> set[str]:
        """The names that flows use."""
        facts = self.facts
        amounts = {reference.name for found in facts.reacting.values() for _, reference, _ in found}
        rules = [facts.model.assigned[name] for name in amounts if name in facts.model.assigned]
        return amounts.union(*map(facts.deep, (*facts.model.rates.values(), *facts.laws.values(), *rules)))


def _step(ordered: list[float]) -> float | None:
    """The power of two, up to 1, that is at most the distance of different numbers; None where they are far larger."""
    step = 2.0 ** min(0, *(floor(log2(b - a)) for a, b in pairwise(ordered))) if len(ordered) > 1 else 1.0
    return step if max(map(abs, ordered), default=0.0) <= LARGEST * step else None


def _has_rival(text: str, others: Iterable[str]) -> bool:
    """Whether another text may be a priority of the same value: all but different numbers may."""
    value = _value(text)
    return any(None in (value, _value(other)) or value == _value(other) for other in others if other != text)


@lru_cache(256)
def _value(text: str) -> float | None:
    """The number that a priority is, if no name is in it."""
    try:
        return None if plain.names_in(text) else float(plain.value(text))
    except (ExpressionError, TypeError, OverflowError):
        return None


def _multiplier(index: int) -> int:
    """The factor that makes the number of an event out of the state: below 2**22, and no small multiple of others."""
    return 2**21 + pow(16807, index, 2097143)
