"""Random systems of events, and their executions by the words of docs/meaning.md M13 alone, at 60 digits.

Flows are polynomials of degree 2 in time, so that crossings are in closed form; nothing of the package is used.
"""

from __future__ import annotations

import random
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import mpmath

DIGITS = 60
SAME = mpmath.mpf(10) ** -40  # times that differ by less are one
MOST_AT_ONCE = 400  # transitions at one instant: a cascade
MOST = 1500  # transitions of a system that is looked at
REST = mpmath.mpf(10) ** -12  # a flight so short ends a tail

Numbers = dict[str, Any]


class Unbounded(Exception):
    """More transitions than are looked at."""


@dataclass(frozen=True)
class Linear:
    """constant + sum of coefficients times names; ``t`` is the time. Coefficients are decimals, as text."""

    constant: str = "0"
    terms: tuple[tuple[str, str], ...] = ()

    def value(self, x: Mapping[str, Any]) -> Any:
        return sum((mpmath.mpf(a) * x[name] for name, a in self.terms), mpmath.mpf(self.constant))

    def text(self) -> str:
        parts = [f"({a})*{name}" for name, a in self.terms]
        return " + ".join([*parts, f"({self.constant})"] if self.constant != "0" or not parts else parts)


@dataclass(frozen=True)
class Comparison:
    """An inequality; it holds where ``left`` - ``right`` has the sign that the operator says."""

    left: Linear
    operator: str
    right: str

    def text(self) -> str:
        return f"{self.left.text()} {self.operator} {self.right}"

    def residual(self) -> Linear:
        """What is positive where it holds."""
        sign = 1 if self.operator[0] == ">" else -1
        terms = tuple((name, str(sign * mpmath.mpf(a))) for name, a in self.left.terms)
        return Linear(str(sign * (mpmath.mpf(self.left.constant) - mpmath.mpf(self.right))), terms)

    @property
    def strict(self) -> bool:
        return "=" not in self.operator


@dataclass(frozen=True)
class RandomEvent:
    """An event as a file has it; ``word`` joins its comparisons."""

    name: str
    parts: tuple[Comparison, ...]
    reset: dict[str, Linear]
    word: str = "and"
    delay: Linear | None = None
    at_execution: bool = False
    persistent: bool = True
    initially: bool = True
    priority: int | Linear = 0

    def joined(self, truths: Sequence[bool]) -> bool:
        return all(truths) if self.word == "and" else any(truths)

    def text(self) -> str:
        options = [f"name: {self.name}", f"event: {f' {self.word} '.join(part.text() for part in self.parts)}"]
        options.append("reset: {" + ", ".join(f"{x}: {value.text()}" for x, value in self.reset.items()) + "}")
        options += [] if self.delay is None else [f'delay: "{self.delay.text()}"']
        options += ["values: execution"] if self.at_execution else []
        options += [] if self.persistent else ["persistent: false"]
        options += [] if self.initially else ["initially: false"]
        if self.priority != 0:
            ranked = self.priority
            options.append(f'priority: "{ranked.text()}"' if isinstance(ranked, Linear) else f"priority: {ranked}")
        return "- {" + ", ".join(options) + "}"


@dataclass(frozen=True)
class EventSystem:
    """One mode with events. ``flow`` is linear in time and in states whose own flow is constant.

    ``ball`` names a height and a speed whose impacts accumulate; ``counts`` are states that then have no limit.
    """

    flow: dict[str, Linear]
    initial: dict[str, str]
    events: tuple[RandomEvent, ...]
    until: str
    ball: tuple[str, str] | None = None
    counts: frozenset[str] = frozenset()

    def text(self, further: str = "") -> str:
        flow = ", ".join(f"{x}: {value.text()}" for x, value in self.flow.items())
        initial = ", ".join(f"{x}: {value}" for x, value in self.initial.items())
        events = "".join(f"      {event.text()}\n" for event in self.events)
        return (
            f"hsdsl: 1\nmodes:\n  a:\n    flow: {{{flow}}}\n    transitions:\n{events}"
            f"initial: {{mode: a, {initial}}}\nexperiment: {{until: {self.until}}}\n{further}"
        )


@dataclass
class Memory:
    """What an event remembers: ``waits`` has times and values that the reset gets, None where it gets those of then.

    It is ``due`` by the flow or by a reset, so many ``times``.
    """

    armed: bool
    due: Literal["", "flow", "reset"] = ""
    times: int = 0
    waits: list[tuple[Any, Numbers | None]] = field(default_factory=list[Any])

    def drop(self) -> None:
        self.due, self.times, self.waits = "", 0, []


@dataclass
class Reference:
    """An execution: events with their times, the state at the end, and what happened."""

    made: list[tuple[Any, str]] = field(default_factory=list[Any])
    final: Numbers = field(default_factory=dict[str, Any])
    most_waiting: int = 0
    tails: list[Any] = field(default_factory=list[Any])  # times at which impacts accumulated
    endless: Any = None  # the time of a cascade that does not end


class Simulator:
    """An execution under way."""

    def __init__(self, system: EventSystem) -> None:
        self.system, self.found = system, Reference()
        self.t, self.x = mpmath.mpf(0), {name: mpmath.mpf(value) for name, value in system.initial.items()}
        self.rests = False
        self.impacts: list[Any] = []
        self.memory = [Memory(not event.initially or not self.holds(event)) for event in system.events]
        for event, memory in zip(system.events, self.memory, strict=True):
            if not event.initially and self.holds(event):
                self.set_off(event, memory)

    def run(self) -> Reference:
        end, count, instant = mpmath.mpf(self.system.until), 0, self.t
        while True:
            self.settle()
            if self.found.endless is not None:
                break
            s, turned = self.next_turn(end - self.t)
            if s is None:
                break
            self.flow(s)
            for k, rises in turned:
                event, memory = self.system.events[k], self.memory[k]
                if rises:
                    self.set_off(event, memory)
                else:
                    memory.armed = True
                    if not event.persistent:
                        memory.drop()
            count = count + 1 if self.t - instant <= SAME else 0
            instant = self.t
            if count > MOST_AT_ONCE:
                self.found.endless = self.t
                break
        if self.found.endless is None:
            self.flow(end - self.t)
        self.found.final = self.x
        return self.found

    def names(self) -> Numbers:
        return {**self.x, "t": self.t}

    def holds(self, event: RandomEvent, changed: set[str] | None = None) -> bool:
        """Whether a condition holds. What a reset that ``changed`` states left on its surface is what it is next."""

        def of(part: Comparison) -> bool:
            value = part.residual().value(self.names())
            if abs(value) > SAME:
                return value > 0
            if changed is None or changed & {name for name, _ in part.left.terms}:
                return not part.strict
            _, rate, bend = self.along(part)
            return rate > SAME or (rate >= -SAME and bend > SAME)

        return event.joined([of(part) for part in event.parts])

    def set_off(self, event: RandomEvent, memory: Memory, by: Literal["flow", "reset"] = "flow") -> None:
        """The condition turned true, with the values of this instant."""
        memory.armed = False
        if event.delay is None:
            memory.due, memory.times = by, memory.times + 1
            return
        delay = event.delay.value(self.names())
        values = None if event.at_execution else {x: value.value(self.names()) for x, value in event.reset.items()}
        memory.waits.append((self.t + max(delay, 0), values))
        memory.waits.sort(key=lambda one: one[0])  # stable: of equal times the first that began goes first
        self.found.most_waiting = max(self.found.most_waiting, len(memory.waits))

    def settle(self) -> None:
        """Make the events that are to be made at this instant, one by one."""
        for _ in range(MOST_AT_ONCE):
            ready = [k for k, memory in enumerate(self.memory) if self.is_ready(memory)]
            if not ready:
                return
            self.make(self.first_of(ready))
            if len(self.found.made) > MOST:
                raise Unbounded
        self.found.endless = self.t

    def is_ready(self, memory: Memory) -> bool:
        return bool(memory.due) or (bool(memory.waits) and memory.waits[0][0] <= self.t + SAME)

    def first_of(self, ready: list[int]) -> int:
        """What a reset set off goes before what the flow reached with no higher priority, and else M6 decides."""
        waiting = [k for k in ready if not self.memory[k].due]
        by_flow = [k for k in ready if self.memory[k].due == "flow"]
        set_off = [k for k in ready if self.memory[k].due == "reset"]
        if set_off:
            first = min((*set_off, *waiting), key=self.rank)
            if first in set_off and all(self.rank(k)[0] >= self.rank(first)[0] for k in by_flow):
                return first
        return min((*by_flow, *waiting), key=self.rank)

    def rank(self, k: int) -> tuple[Any, ...]:
        ranked = self.system.events[k].priority
        return (-ranked.value(self.names()), 0, k) if isinstance(ranked, Linear) else (-ranked, -ranked, k)

    def make(self, k: int) -> None:
        event, memory, before = self.system.events[k], self.memory[k], self.names()
        values = None if memory.due else memory.waits.pop(0)[1]
        memory.times -= bool(memory.due)
        memory.due = memory.due if memory.times else ""
        values = values or {x: value.value(before) for x, value in event.reset.items()}
        self.x = {**self.x, **values}
        self.found.made.append((self.t, event.name))
        changed = {x for x in values if self.x[x] != before[x]}
        for other, its in zip(self.system.events, self.memory, strict=True):
            read = {name for part in other.parts for name, _ in part.left.terms}
            if other is not event and not changed & read:
                self.turn_back(other, its, changed & {name for x in read for name in self.drivers(x)})
                continue
            if not self.holds(other, changed):
                its.armed = True
                if not other.persistent:
                    its.drop()
            elif its.armed:
                self.set_off(other, its, "reset")
            if its.due and other is not event:
                its.due = "reset"
        if self.system.ball is not None:
            self.rest(k, changed)

    def drivers(self, name: str) -> list[str]:
        """What the rate of a state depends on."""
        return [other for other, _ in self.system.flow[name].terms] if name in self.system.flow else []

    def turn_back(self, event: RandomEvent, memory: Memory, changed: set[str]) -> None:
        """Another reset changed rates alone: a strict comparison on its surface is what it is next along the flow."""
        if not changed:
            return
        memory.due = "reset" if memory.due else ""
        if all(part.strict for part in event.parts) and not self.holds(event, set()):
            memory.armed = True
            if not event.persistent:
                memory.drop()

    def rest(self, k: int, changed: set[str]) -> None:
        """Take a ball whose flights are short to its rest, and from it where something moves it."""
        height, speed = self.system.ball or ("", "")
        if k == 0:
            self.impacts.append(self.t)
            flights = [b - a for a, b in zip(self.impacts[-4:], self.impacts[-3:], strict=False)]
            if len(flights) == 3 and flights[-1] < flights[-2] < flights[-3] and flights[-1] < REST:
                self.x |= {height: mpmath.mpf(0), speed: mpmath.mpf(0)}
                self.rests = True
                self.memory[0].armed = False
                self.found.tails.append(self.t)
        elif changed & {height, speed}:
            self.rests, self.impacts = False, []

    def course(self, name: str) -> tuple[Any, Any, Any]:
        """The coefficients of a state along the flow from here."""
        if name == "t":
            return self.t, mpmath.mpf(1), mpmath.mpf(0)
        if self.rests and self.system.ball is not None and name in self.system.ball:
            return self.x[name], mpmath.mpf(0), mpmath.mpf(0)
        flow = self.system.flow[name]
        bend = sum((mpmath.mpf(a) * self.course(other)[1] for other, a in flow.terms), mpmath.mpf(0))
        return self.x[name], flow.value(self.names()), bend / 2

    def along(self, part: Comparison) -> tuple[Any, Any, Any]:
        """The coefficients along the flow of what is positive where a comparison holds."""
        own = part.residual()
        parts = [[mpmath.mpf(a) * c for c in self.course(name)] for name, a in own.terms]
        a, b, c = (sum(column, mpmath.mpf(0)) for column in zip(*parts, strict=True))
        a += mpmath.mpf(own.constant)
        return (mpmath.mpf(0) if abs(a) <= SAME else a), b, c

    def flow(self, s: Any) -> None:
        if s > 0:
            courses = {name: self.course(name) for name in self.x}
            self.t, self.x = self.t + s, {name: a + s * (b + s * c) for name, (a, b, c) in courses.items()}

    def next_turn(self, most: Any) -> tuple[Any, list[tuple[int, bool]]]:
        """The time to the next turn of a condition or execution, and the conditions that turn, with where to."""
        turns = [
            (s, (k, rises))
            for k in range(len(self.memory))
            if (s := self.turn(k, rises := self.memory[k].armed)) is not None
        ]
        waits = [memory.waits[0][0] - self.t for memory in self.memory if memory.waits]
        times = [s for s, _ in turns] + waits
        first = min(times, default=None)
        if first is None or first > most + SAME:
            return None, []
        return first, [turned for s, turned in turns if s <= first + SAME]

    def turn(self, k: int, wanted: bool) -> Any:
        """The first time from here behind which the condition of event k is true, or false."""
        event = self.system.events[k]
        if k == 0 and self.rests:
            return None
        courses = [self.along(part) for part in event.parts]
        places = sorted({mpmath.mpf(0), *(s for course in courses for s in _roots(*course) if s > SAME)})
        for s, following in zip(places, [*places[1:], places[-1] + 2], strict=True):
            middle = (s + following) / 2
            if event.joined([a + middle * (b + middle * c) > 0 for a, b, c in courses]) == wanted:
                return s
        return None


def _roots(a: Any, b: Any, c: Any) -> Iterator[Any]:
    if abs(c) <= SAME:
        if abs(b) > SAME:
            yield -a / b
        return
    inside = b * b - 4 * a * c
    if inside > 0:
        q = -(b + (mpmath.sqrt(inside) if b >= 0 else -mpmath.sqrt(inside))) / 2
        yield q / c
        if q != 0:
            yield a / q


def execute(system: EventSystem) -> Reference:
    """The execution of a system by M13; raises Unbounded where it makes too many transitions."""
    with mpmath.workdps(DIGITS):
        return Simulator(system).run()


def is_well_conditioned(system: EventSystem, share: float = 1e-7) -> bool:
    """Whether initial values that are a little off give the same events, about as far off."""
    one = execute(system)
    for way in (1, -1):
        initial = {
            name: value if name == "c" else str(mpmath.mpf(value) + way * share * (3 + k) / 7)
            for k, (name, value) in enumerate(system.initial.items())
        }
        try:
            other = execute(replace(system, initial=initial))
        except Unbounded:
            return False
        if [name for _, name in one.made] != [name for _, name in other.made]:
            return False
        if any(abs(a - b) > 1000 * share for (a, _), (b, _) in zip(one.made, other.made, strict=True)):
            return False
    return True


def random_system(seed: int) -> EventSystem:
    """A clock, states that drift or stand, perhaps a ball, and two to six events on them."""
    rng = random.Random(f"events {seed}")
    number = lambda low, high: f"{rng.uniform(low, high):.3f}"  # noqa: E731
    flow = {"c": Linear("1")}
    initial = {"c": "0"}
    ball = None
    for k in range(rng.randint(1, 3)):
        name = f"x{k}"
        bend = (("t", number(-0.1, 0.1)),) if rng.random() < 0.3 else ()
        flow[name] = Linear("0") if rng.random() < 0.3 else Linear(number(-1.5, 1.5), bend)
        initial[name] = number(-1, 1)
    events: list[RandomEvent] = []
    counts: set[str] = set()
    if rng.random() < 0.2:
        ball = ("h", "v")
        flow |= {"h": Linear("0", (("v", "1"),)), "v": Linear("-" + number(2, 10)), "n": Linear("0")}
        initial |= {"h": number(0.5, 2), "v": number(-1, 1), "n": "0"}
        counting = {"n": Linear("1", (("n", "1"),))} if rng.random() < 0.7 else {}
        counts.add("n")
        bounce = {"v": Linear("0", (("v", "-" + number(0.3, 0.7)),)), **counting}
        events.append(RandomEvent("bounce", (Comparison(Linear("0", (("h", "1"),)), "<=", "0"),), bounce))
    period = number(0.4, 2)
    moved = [name for name in flow if name[0] == "x"]
    tick = {"c": Linear("0")} | ({rng.choice(moved): _kick(rng, moved, number)} if rng.random() < 0.6 else {})
    clock = Comparison(Linear("0", (("c", "1"),)), ">=", period)
    events.append(RandomEvent("tick", (clock,), tick, priority=rng.choice((0, 0, 1, 5))))
    for k in range(rng.randint(1, 5)):
        events.append(_random_event(rng, f"e{k}", moved, events, float(period), number))
    if ball is not None and rng.random() < 0.5:
        kick = RandomEvent(
            "kick", (Comparison(Linear("0", (("t", "1"),)), ">=", number(5, 8)),), {"v": Linear(number(1, 4))}
        )
        events.append(kick)
    until = number(8, 25)
    if random.Random(f"surfaces {seed}").random() < 0.4:
        flow |= {"p": Linear("0", (("u", "1"),)), "u": Linear("0"), "m": Linear("0")}
        initial |= {"p": number(-0.9, 0.9), "u": number(0.3, 1.5), "m": "0"}
        events += _on_one_surface(rng, moved, number)
    return EventSystem(flow, initial, tuple(events), until, ball, frozenset(counts))


def _on_one_surface(
    rng: random.Random, moved: Sequence[str], number: Callable[[float, float], str]
) -> Iterator[RandomEvent]:
    """Events on the two ends of the way of p, which goes to and fro at the speed u: one of each turns it back."""
    for end, sign in (("low", -1), ("high", 1)):
        place = mpmath.mpf(sign * rng.randint(10, 20)) / 10
        back = Linear(f"{-sign * rng.uniform(0.3, 1.5):.3f}")
        resets = [{"u": back}, *({} for _ in range(rng.choice((0, 1, 1, 2))))]
        for k in range(1, len(resets)):
            kinds = ({"m": Linear("1", (("m", "1"),))}, {rng.choice(moved): _kick(rng, moved, number)})
            resets[k] = rng.choice((*kinds, {"u": Linear("0", (("u", rng.choice(("0.5", "1.25"))),))}))
        rng.shuffle(resets)
        for k, reset in enumerate(resets):
            share = rng.choice((1, 1, 2, -1, -0.5))
            operator = ("<" if share * sign < 0 else ">") + rng.choice(("=", "=", ""))
            part = Comparison(Linear("0", (("p", str(share)),)), operator, str(float(share * place)))
            wait = rng.choice((None, None, None, Linear("0"), Linear("0.125"))) if reset.get("u") != back else None
            yield RandomEvent(
                f"{end}{k}",
                (part,),
                reset,
                delay=wait,
                at_execution=wait is not None and ("u" in reset or rng.random() < 0.4),  # no stored u turns it forward
                persistent=reset.get("u") == back or rng.random() < 0.7,
                priority=rng.choice((0, 0, 0, 1, -1)),
            )


def _kick(rng: random.Random, moved: Sequence[str], number: Callable[[float, float], str]) -> Linear:
    share = rng.choice(("0.5", "-0.5", "1", "0.8", "0"))
    return Linear(number(-1.5, 1.5), () if share == "0" else ((rng.choice(moved), share),))


def _random_event(
    rng: random.Random,
    name: str,
    moved: Sequence[str],
    others: Sequence[RandomEvent],
    period: float,
    number: Callable[[float, float], str],
) -> RandomEvent:
    parts = tuple(_comparison(rng, moved, period, number) for _ in range(rng.choice((1, 1, 1, 2))))
    if rng.random() < 0.25:
        parts = next((e.parts for e in reversed(others) if e.name != "bounce"), parts)
    reset: dict[str, Linear] = {}
    for state in rng.sample(moved, min(len(moved), rng.choice((1, 1, 2)))):
        reset[state] = _kick(rng, moved, number)
    priority: int | Linear = rng.choice((0, 0, 0, 1, 2, -1))
    if rng.random() < 0.15:
        priority = Linear(number(-1, 1), ((rng.choice(moved), number(-2, 2)),))
    event = RandomEvent(name, parts, reset, rng.choice(("and", "or")), priority=priority, initially=rng.random() < 0.85)
    if rng.random() < 0.55:
        waiting = rng.choice((0, 0.3, 1.5, 4.5, 12.5, 49.5))
        delay = Linear("0") if waiting == 0 else Linear(f"{waiting * period + rng.uniform(0, 0.2):.3f}")
        if waiting and rng.random() < 0.25:
            delay = Linear(delay.constant, ((rng.choice(moved), number(-0.5, 0.5)),))
        event = replace(event, delay=delay, at_execution=rng.random() < 0.4, persistent=rng.random() < 0.8)
    return event if rng.random() < 0.85 else replace(event, persistent=False)


def _comparison(
    rng: random.Random, moved: Sequence[str], period: float, number: Callable[[float, float], str]
) -> Comparison:
    kind = rng.random()
    if kind < 0.3:
        return Comparison(Linear("0", (("c", "1"),)), rng.choice((">=", ">")), f"{period * rng.uniform(0.2, 0.9):.3f}")
    first = (rng.choice(moved), "1")
    terms = (
        (first,) if kind < 0.8 or len(moved) < 2 else (first, (next(x for x in moved if x != first[0]), number(-1, 1)))
    )
    return Comparison(Linear("0", terms), rng.choice((">=", "<=", ">", "<")), number(-1.5, 1.5))
