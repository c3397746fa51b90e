"""Events of parts: random systems with constant rates against an interpreter in rational numbers."""

from __future__ import annotations

import random
from dataclasses import dataclass, field
from fractions import Fraction

import pytest

import hsdsl

PARTS, UNTIL = ("a", "b", "c"), Fraction(4)


@dataclass
class Rising:
    """An event of one mode of a part: comparisons `state >= level` or `state <= level`, and what it does."""

    name: str
    word: str
    comparisons: list[tuple[str, str, Fraction]]
    target: int | None
    reset: tuple[str, Fraction, str, Fraction]  # state, factor, other state, constant
    delay: Fraction | None = None
    persistent: bool = True
    initially: bool = True
    priority: int = 0

    def text(self) -> str:
        """How it is written."""
        condition = f" {self.word} ".join(f"{s} {o} {level}" for s, o, level in self.comparisons)
        state, factor, other, constant = self.reset
        items = [f"name: {self.name}", f"event: {condition}", f"reset: {{{state}: {factor}*{other} + {constant}}}"]
        items += [f"to: m{self.target}"] if self.target is not None else []
        items += [f"delay: {self.delay}"] if self.delay is not None else []
        items += [f"persistent: {str(self.persistent).lower()}", f"initially: {str(self.initially).lower()}"]
        return "{" + ", ".join([*items, f"priority: {self.priority}"]) + "}"


@dataclass
class Made:
    """A random system: rates and events of each mode of each part, listeners, and starts."""

    rates: dict[str, list[Fraction]]
    events: dict[str, list[list[Rising]]]
    listeners: dict[str, list[tuple[str, Fraction] | None]]  # what a mode listens to, and its state's next value
    start: dict[str, tuple[int, Fraction]]

    def text(self) -> str:
        """The model: an automaton for each part, whose state is x."""
        text = "hsdsl: 1\nautomata:\n"
        for part in PARTS:
            text += f"  k{part}:\n    modes:\n"
            for k, rate in enumerate(self.rates[part]):
                text += f"      m{k}:\n        flow: {{x: {rate}}}\n        transitions:\n"
                lines = [event.text() for event in self.events[part][k]]
                heard = self.listeners[part][k]
                lines += [] if heard is None else [f"{{name: h{k}, on: {heard[0]}, reset: {{x: {heard[1]}}}}}"]
                text += "".join(f"          - {line}\n" for line in lines)
        text += "system:\n"
        for part, (mode, x) in self.start.items():
            text += f"  {part}: {{automaton: k{part}, initial: {{mode: m{mode}, x: {x}}}}}\n"
        return text + f"experiment: {{until: {UNTIL}}}\n"


def number(draw: random.Random, most: int = 40) -> Fraction:
    return Fraction(draw.randint(-most, most), draw.choice((17, 19, 23)))


def system_of(seed: int) -> Made:
    """A random system of three parts with one or two modes each."""
    draw = random.Random(seed)
    counts = {part: draw.choice((1, 2, 2)) for part in PARTS}
    made = Made({}, {}, {}, {})
    for part in PARTS:
        modes = range(counts[part])
        made.rates[part] = [number(draw) for _ in modes]
        made.events[part] = [
            [_event(draw, part, f"e{k}{i}", counts[part]) for i in range(draw.choice((1, 1, 2)))] for k in modes
        ]
        other = draw.choice([p for p in PARTS if p != part])
        made.listeners[part] = [(f"{other}.e00", number(draw)) if draw.random() < 0.3 else None for _ in modes]
        made.start[part] = draw.randrange(counts[part]), number(draw)
    return made


def _event(draw: random.Random, part: str, name: str, modes: int) -> Rising:
    states = [draw.choice(("x", "x", *(f"{p}.x" for p in PARTS if p != part))) for _ in range(draw.choice((1, 1, 2)))]
    comparisons = [(state, draw.choice((">=", "<=")), number(draw)) for state in states]
    target = draw.choice((None, draw.randrange(modes)))
    reset = "x", Fraction(draw.choice((0, -1, 1)), 2), draw.choice(("x", f"{draw.choice(PARTS)}.x")), number(draw)
    delay = draw.choice((None, None, abs(number(draw, 20)) + Fraction(1, 29)))
    flags = draw.random() < 0.6, draw.random() < 0.6
    return Rising(name, draw.choice(("and", "or")), comparisons, target, reset, delay, *flags, draw.randint(0, 1))


class TooClose(Exception):
    """Two things that happen at one instant, or an event that waits already: no subject of the comparison."""


@dataclass
class Memory:
    """What an event remembers."""

    armed: bool
    due: bool = False
    waits: tuple[Fraction, Fraction] | None = None  # when, and the value


@dataclass
class Run:
    """The execution of a system, in rational numbers: M6, M7 and M13 word by word."""

    made: Made
    t: Fraction = Fraction(0)
    modes: dict[str, int] = field(default_factory=dict)
    x: dict[str, Fraction] = field(default_factory=dict)
    memory: dict[tuple[str, str], Memory] = field(default_factory=dict)
    transitions: list[tuple[Fraction, str]] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.modes = {part: mode for part, (mode, _) in self.made.start.items()}
        self.x = {part: x for part, (_, x) in self.made.start.items()}
        for part in PARTS:
            self.enter(part)
        while len(self.transitions) < 60:
            if not self.at_once() and not self.later():
                return

    def active(self):
        return [(part, event) for part in PARTS for event in self.made.events[part][self.modes[part]]]

    def rate(self, part: str) -> Fraction:
        return self.made.rates[part][self.modes[part]]

    @staticmethod
    def owner(part: str, state: str) -> str:
        return part if state == "x" else state[0]

    def truths(self, part: str, event: Rising, ahead: bool) -> list[bool]:
        """Whether each comparison holds now, or with ``ahead`` right after."""
        found = []
        for state, operator, level in event.comparisons:
            one = self.owner(part, state)
            beyond = (self.x[one] - level) * (1 if operator == ">=" else -1)
            rate = self.rate(one) * (1 if operator == ">=" else -1)
            found.append(beyond > 0 or (beyond == 0 and (rate >= 0 or not ahead)))
        return found

    def holds(self, part: str, event: Rising, ahead: bool = False) -> bool:
        return (all if event.word == "and" else any)(self.truths(part, event, ahead))

    def enter(self, part: str) -> None:
        for event in self.made.events[part][self.modes[part]]:
            holds = self.holds(part, event)
            self.memory[part, event.name] = Memory(not holds) if event.initially else Memory(True, holds)

    def at_once(self) -> bool:
        """Make one transition that is due at this instant."""
        ready = [(part, event) for part, event in self.active() if self.memory[part, event.name].due]
        if not ready:
            return False
        triggers = [pair for pair in ready if pair[1].delay is not None]
        self.turns_true(*(triggers or ready)[0] if triggers else max(ready, key=lambda pair: pair[1].priority))
        return True

    def turns_true(self, part: str, event: Rising) -> None:
        memory, holds = self.memory[part, event.name], self.holds(part, event, True)
        memory.due, memory.armed = False, not holds
        if event.delay is None:
            self.fire(part, event, self.value(part, event))
            return
        if memory.waits is not None:
            raise TooClose
        self.transitions.append((self.t, f"{part}.{event.name} triggers"))
        memory.waits = self.t + event.delay, self.value(part, event)

    def value(self, part: str, event: Rising) -> Fraction:
        _, factor, other, constant = event.reset
        return factor * self.x[self.owner(part, other)] + constant

    def fire(self, part: str, event: Rising, value: Fraction) -> None:
        self.transitions.append((self.t, f"{part}.{event.name}"))
        news = {part: value}
        waiting = [(part, event.name)]
        while waiting:
            heard = {f"{sender}.{name}" for sender, name in waiting}
            waiting = []
            for other in PARTS:
                listener = self.made.listeners[other][self.modes[other]]
                if other not in news and listener is not None and listener[0] in heard:
                    news[other] = listener[1]
                    waiting.append((other, f"h{self.modes[other]}"))
        self.x |= news
        entered = event.target is not None and event.target != self.modes[part]
        if entered:
            self.modes[part] = event.target
            self.enter(part)
        for one, other in self.active():
            if not (entered and one == part):
                self.changed(one, other, one == part and other is event and event.delay is None)

    def changed(self, part: str, event: Rising, itself: bool) -> None:
        memory, holds = self.memory[part, event.name], self.holds(part, event, itself)
        if itself:
            memory.armed, memory.due = not holds, False
            return
        memory.due = (memory.due and (holds or event.persistent)) or (memory.armed and holds)
        memory.armed = memory.armed or not holds
        if not holds and not event.persistent:
            memory.waits = None

    def later(self) -> bool:
        """Follow the flow to the next instant at which something happens."""
        times: dict[Fraction, set] = {}
        for part, event in self.active():
            for state, _, level in event.comparisons:
                one = self.owner(part, state)
                if self.rate(one) and (when := (level - self.x[one]) / self.rate(one)) > 0:
                    times.setdefault(self.t + when, set()).add((part, event.name))
            waits = self.memory[part, event.name].waits
            if waits is not None:
                times.setdefault(waits[0], set()).add((part, event.name, "waits"))
        if not times or (then := min(times)) >= UNTIL:
            return False
        if len(times[then]) > 1:
            raise TooClose
        for one in PARTS:
            self.x[one] += self.rate(one) * (then - self.t)
        self.t = then
        ((part, name, *waits),) = times[then]
        event = next(event for event in self.made.events[part][self.modes[part]] if event.name == name)
        memory, holds = self.memory[part, name], self.holds(part, event, True)
        if waits:
            value, memory.waits = memory.waits[1], None
            self.fire(part, event, value)
        elif memory.armed and holds:
            self.turns_true(part, event)
        elif not holds and not memory.armed:
            self.transitions.append((self.t, f"{part}.{name} re-arms"))
            memory.armed = True
            memory.waits = memory.waits if event.persistent else None
        return True


def compared(seed: int, engine: str) -> int:
    """How many transitions a random system makes, each as the interpreter makes it."""
    made = system_of(seed)
    try:
        expected = Run(made)
    except TooClose:
        return 0
    run = hsdsl.loads(made.text()).simulate(engine=engine, max_transitions=60)
    count = min(59, len(expected.transitions))
    if run.stop.reason == "zeno":  # at one instant for ever
        assert expected.transitions[-1][0] == pytest.approx(run.stop.time) and count == 59
        count = len(run.transitions)
    assert [t.edge for t in run.transitions][:count] == [name for _, name in expected.transitions][:count]
    assert [t.time for t in run.transitions][:count] == pytest.approx(
        [float(t) for t, _ in expected.transitions][:count], abs=1e-9
    )
    if run.stop.reason == "until":
        assert len(run.transitions) == count
        for part in PARTS:
            assert run.final.mode.split()[PARTS.index(part)] == f"{part}=m{expected.modes[part]}"
            last = expected.x[part] + expected.rate(part) * (UNTIL - expected.t)
            assert run.final.state[f"{part}.x"] == pytest.approx(float(last), abs=1e-9)
    return count


def test_random_systems_run_as_in_rational_numbers():
    assert sum(compared(seed, "python") for seed in range(5)) > 12


def test_priorities_across_parts_count_at_the_instant():
    """Of three that are reached together each raises the rank of another one."""
    text = """
    hsdsl: 1
    automata:
      one:
        inputs: [rank]
        modes:
          off: {flow: {x: 0, n: 0}}
          on: {flow: {x: 1, n: 0}, transitions: [{name: e, event: x >= 1, priority: 100*rank, reset: {n: last.n + 1}}]}
      last: {modes: {m: {flow: {n: 0}, transitions: [{on: one.e, reset: {n: n + 1}}]}}}
    system:
      a: {automaton: one, initial: {mode: on, x: 0, n: 0}, inputs: {rank: 0.1 + b.n}}
      b: {automaton: one, initial: {mode: on, x: 0, n: 0}, inputs: {rank: c.n}}
      c: {automaton: one, initial: {mode: on, x: 0, n: 0}, inputs: {rank: 0.2 - a.n}}
      d: {automaton: one, initial: {mode: off, x: 2, n: 0}, inputs: {rank: 9}}
      last: {automaton: last, initial: {n: 0}}
    experiment: {until: 2}
    """
    run = hsdsl.loads(text).simulate()
    assert [t.edge for t in run.transitions] == ["c.e", "b.e", "a.e"]
    assert [run.final.state[f"{name}.n"] for name in "abcd"] == [3, 2, 1, 0]


@pytest.mark.campaign
def test_many_random_systems_run_as_in_rational_numbers():
    assert sum(compared(seed, "python") for seed in range(100, 400)) > 900


@pytest.mark.parametrize(("n", "edges"), [("-1/5", ["lamp.off", "lamp.up"]), ("1/5", [])])
def test_a_part_starts_in_the_mode_that_is_given(n, edges):
    """What its event remembers there follows from the values that are given."""
    text = """
    hsdsl: 1
    automata:
      lamp:
        modes:
          dark: {flow: {n: 1}, transitions: [{name: up, event: n >= 0, reset: {n: n/2}}]}
          bright: {flow: {n: 0}, transitions: [{name: off, event: n < 0, initially: false, to: dark}]}
    system: {lamp: {automaton: lamp, initial: {mode: dark, n: 1}}}
    experiment: {until: 1}
    """
    run = hsdsl.loads(text).simulate(initial={"lamp.mode": "bright", "lamp.n": n})
    assert [t.edge for t in run.transitions if "re-arms" not in t.edge] == edges
    assert [t.time for t in run.transitions] == pytest.approx([0.0, 0.2][: len(edges)])
