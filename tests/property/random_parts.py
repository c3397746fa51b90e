"""Random systems of parts with the executions that they have, exact: clocks, switches, counters, timers, integrators.

All flows are constant between transitions, so crossings are rational numbers. `execution` is written from the pages on
systems of parts and events in docs/meaning.md, and shares no code with the package. It also says whether a system is
well conditioned: whether no order of what happens together matters, and nothing is almost reached.
"""

from __future__ import annotations

import copy
import random
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction as F
from typing import Any

Affine = dict[str, F]  # by name, that of the constant is ""
UNTIL = F(1009, 101)
NEAR = F(1, 10**6)
MOST = 250
LOAD = "load"


def line(constant: Any = 0, **terms: Any) -> Affine:
    """An affine expression; a dot in a name is written as two underscores."""
    return {"": F(constant)} | {name.replace("__", "."): F(value) for name, value in terms.items()}


def minus(one: Affine, other: Affine) -> Affine:
    return {name: one.get(name, F(0)) - other.get(name, F(0)) for name in one | other}


def text(of: Affine, owner: str) -> str:
    """An expression as a part writes it: its own names without its name."""
    terms = [f"{value}*{name.removeprefix(owner + '.')}" for name, value in of.items() if name and value]
    return " + ".join([*terms, str(of.get("", F(0)))]).replace("+ -", "- ")


@dataclass(frozen=True)
class Edge:
    """A transition: ``kind`` is `when`, `event` or `on`; of the first two ``surfaces`` are reached where they rise."""

    name: str
    kind: str
    surfaces: tuple[Affine, ...] = ()
    word: str = "and"
    on: str = ""
    condition: tuple[Affine, ...] = ()
    to: str = ""
    reset: Mapping[str, Affine] = field(default_factory=dict[str, Affine])
    priority: int = 0
    initially: bool = True
    delay: F | None = None


@dataclass
class Part:
    """A part: its modes with flows, numbers and transitions, and where it starts."""

    name: str
    flows: dict[str, dict[str, Affine]]
    edges: dict[str, list[Edge]]
    lets: dict[str, dict[str, F]]
    start: str
    initial: dict[str, F]

    @property
    def timed(self) -> bool:
        return any(f"{self.name}.since" in s for own in self.edges.values() for e in own for s in e.surfaces)


@dataclass
class System:
    """Parts in file order, and the samples of an input that they read."""

    parts: list[Part]
    times: list[F]
    values: list[F]


# ---- text ---------------------------------------------------------------------------------------------------------


def written(system: System) -> str:
    """The model's text."""
    rows = [
        "hsdsl: 1",
        "inputs:",
        f"  load: {{times: {_list(system.times)}, values: {_list(system.values)}, hold: zero}}",
    ]
    rows.append("automata:")
    for part in system.parts:
        rows += [f"  kind_{part.name}:", "    modes:"]
        for mode, flow in part.flows.items():
            rows += [f"      {mode}:", f"        flow: {_map(flow, part.name)}"]
            if part.lets.get(mode):
                rows.append(f"        let: {{{', '.join(f'{k}: {v}' for k, v in part.lets[mode].items())}}}")
            rows.append("        transitions:" if part.edges.get(mode) else "        transitions: []")
            rows += [f"          - {_edge(edge, part.name)}" for edge in part.edges.get(mode, [])]
    rows.append("system:")
    for part in system.parts:
        start = ", ".join([f"mode: {part.start}", *(f"{x.split('.')[1]}: {v}" for x, v in part.initial.items())])
        rows.append(f"  {part.name}: {{automaton: kind_{part.name}, initial: {{{start}}}}}")
    return "\n".join([*rows, f"experiment: {{until: {UNTIL}, max_transitions: 2000}}", ""])


def _list(numbers: Sequence[F]) -> str:
    return f"[{', '.join(map(str, numbers))}]"


def _map(values: Mapping[str, Affine], owner: str) -> str:
    return "{" + ", ".join(f"{x.removeprefix(owner + '.')}: {text(v, owner)}" for x, v in values.items()) + "}"


def _edge(edge: Edge, owner: str) -> str:
    parts = [f"name: {edge.name}"]
    sides = [f"{text(s | {'': F(0)}, owner)} >= {-s.get('', F(0))}" for s in edge.surfaces]
    if edge.kind == "on":
        parts.append(f"on: {edge.on}")
    else:
        parts.append(f"{edge.kind}: {f' {edge.word} '.join(sides)}")
    if edge.condition:
        parts.append("if: " + " and ".join(f"{text(c, owner)} >= 0" for c in edge.condition))
    if edge.to:
        parts.append(f"to: {edge.to}")
    if edge.reset:
        parts.append(f"reset: {_map(edge.reset, owner)}")
    if edge.priority:
        parts.append(f"priority: {edge.priority}")
    if not edge.initially:
        parts.append("initially: false")
    if edge.delay is not None:
        parts.append(f"delay: {edge.delay}")
    return "{" + ", ".join(parts) + "}"


# ---- execution ----------------------------------------------------------------------------------------------------


@dataclass
class World:
    """A state of a system: modes, values, what events remember, and the number of the input's sample."""

    system: System
    t: F
    modes: dict[str, str]
    values: dict[str, F]
    sample: int
    armed: dict[tuple[str, str], bool] = field(default_factory=dict[tuple[str, str], bool])
    due: set[tuple[str, str]] = field(default_factory=set[tuple[str, str]])
    waiting: list[tuple[F, str, str, dict[str, F]]] = field(default_factory=list[tuple[F, str, str, dict[str, F]]])
    made: list[tuple[str, F]] = field(default_factory=list[tuple[str, F]])
    ill: set[str] = field(default_factory=set[str])

    def same(self, other: World) -> bool:
        names = ("modes", "values", "sample", "armed", "due")
        alike = all(getattr(self, name) == getattr(other, name) for name in names)
        return alike and sorted(self.waiting, key=str) == sorted(other.waiting, key=str)

    def copy(self) -> World:
        system = self.system
        self.system = None  # type: ignore[assignment]
        found = copy.deepcopy(self)
        self.system = found.system = system
        return found

    def number(self, name: str) -> F:
        if name == "":
            return F(1)
        if name == LOAD:
            return self.system.values[self.sample]
        if name in self.values:
            return self.values[name]
        part = next(p for p in self.system.parts if p.name == name.split(".")[0])
        return part.lets[self.modes[part.name]][name.split(".")[1]]

    def value(self, of: Affine) -> F:
        return sum((c * self.number(name) for name, c in of.items() if c), F(0))

    def slope(self, name: str) -> F:
        part = next((p for p in self.system.parts if p.name == name.split(".")[0]), None)
        if part is None or name not in self.values:
            return F(0)
        if name.endswith(".since"):
            return F(1)
        return self.value(part.flows[self.modes[part.name]].get(name, line()))

    def rate(self, of: Affine) -> F:
        return sum((c * self.slope(name) for name, c in of.items() if c and name), F(0))

    def flows(self, of: Affine) -> bool:
        """Whether states that may flow are in it."""
        return any(c and name in self.values and self.slope(name) != 0 for name, c in of.items())

    def own(self) -> Iterator[tuple[int, Part, Edge]]:
        """The transitions of all parts' modes, in order."""
        k = 0
        for part in self.system.parts:
            for edge in part.edges.get(self.modes[part.name], []):
                yield k, part, edge
                k += 1

    def holds(self, condition: Sequence[Affine]) -> bool:
        if any(self.flows(c) and abs(self.value(c)) < NEAR for c in condition):
            self.ill.add("a condition is decided at its boundary")
        return all(self.value(c) >= 0 for c in condition)

    # -- events --

    def true(self, edge: Edge) -> bool:
        """Whether an event's condition holds at the values."""
        return _joined(edge, [self.value(s) >= 0 for s in edge.surfaces])

    def true_next(self, edge: Edge) -> bool:
        """Whether it holds next along the flow."""
        values = [(self.value(s), self.rate(s)) for s in edge.surfaces]
        return _joined(edge, [v > 0 or (v == 0 and rate >= 0) for v, rate in values])

    def remember(self, part: Part, edge: Edge) -> None:
        """An event where its mode is entered, or the run starts."""
        holds = self.true(edge)
        self.armed[part.name, edge.name] = not holds or not edge.initially
        if holds and not edge.initially:
            self.due.add((part.name, edge.name))

    # -- what goes --

    def entries(self, jumped: frozenset[int] = frozenset()) -> list[int]:
        """Transitions that fire at once; ``jumped`` were not reached before the input jumped."""
        found: list[int] = []
        for k, part, edge in self.own():
            if edge.kind == "when" and not edge.condition:
                r = self.value(edge.surfaces[0])
                if r > 0 or (r == 0 and k in jumped):
                    found.append(k)
            elif edge.kind == "event" and (part.name, edge.name) in self.due:
                found.append(k)
        return found

    def standing(self) -> list[tuple[int, str]]:
        """Transitions on whose guards the state is, with the flow pointing out: numbers, and what they do."""
        found: list[tuple[int, str]] = []
        for k, part, edge in self.own():
            if edge.kind == "when":
                if self.crosses(edge.surfaces[0]) and self.holds(edge.condition):
                    found.append((k, "fires"))
            elif edge.kind == "event":
                armed = self.armed[part.name, edge.name]
                if armed and any(map(self.crosses, edge.surfaces)) and self.true_next(edge):
                    found.append((k, "fires" if edge.delay is None else "triggers"))
                if not armed and any(self.crosses(minus({}, s)) for s in edge.surfaces) and not self.true_next(edge):
                    found.append((k, "re-arms"))
                if any(at == self.t and (p, e) == (part.name, edge.name) for at, p, e, _ in self.waiting):
                    found.append((k, "executes"))
        return found

    def crosses(self, surface: Affine) -> bool:
        return self.value(surface) == 0 and self.rate(surface) > 0

    def first(self, among: Sequence[tuple[int, str]]) -> tuple[int, str]:
        """The one that goes: by priority, then by order; what only triggers goes before all others."""
        edges = {k: edge for k, _, edge in self.own()}
        return min(among, key=lambda each: (each[1] != "triggers", -edges[each[0]].priority, each[0]))

    def go(self, k: int, how: str) -> None:
        _, part, edge = next(each for each in self.own() if each[0] == k)
        key = part.name, edge.name
        if how == "re-arms":
            self.armed[key] = True
            return
        if edge.kind == "event" and how != "executes" and edge.delay is not None:
            self.due.discard(key)
            self.armed[key] = False
            values = {x: self.value(v) for x, v in edge.reset.items()}
            self.waiting.append((self.t + edge.delay, *key, values))
            return
        stored = None
        if how == "executes":
            at = min(range(len(self.waiting)), key=lambda i: (self.waiting[i][1:3] != key, self.waiting[i][0], i))
            stored = self.waiting.pop(at)[3]
        self.made.append((f"{part.name}.{edge.name}", self.t))
        self.joint(part, edge, stored, how)

    def joint(self, part: Part, edge: Edge, stored: dict[str, F] | None, how: str) -> None:
        """Make a transition with all that listen to it."""
        moving, queue, taken = [(part, edge)], [(part, edge)], {part.name}
        while queue:
            source, heard = queue.pop(0)
            for other in self.system.parts:
                if other.name in taken:
                    continue
                listening = [
                    (i, e) for i, e in enumerate(other.edges.get(self.modes[other.name], []))
                    if e.kind == "on" and e.on == f"{source.name}.{heard.name}" and self.holds(e.condition)
                ]  # fmt: skip
                if listening:
                    chosen = min(listening, key=lambda each: (-each[1].priority, each[0]))[1]
                    taken.add(other.name)
                    moving.append((other, chosen))
                    queue.append((other, chosen))
        new: dict[str, F] = {}
        for _, each in moving:
            given = stored if stored is not None and each is edge else {x: self.value(v) for x, v in each.reset.items()}
            if new.keys() & given.keys():
                self.ill.add("two parts set one state")
            new |= given
        rising = {(p.name, e.name) for _, p, e in self.own() if e.kind == "event" and self.rises(e)}
        before = {(p.name, e.name): [self.value(s) for s in e.surfaces] for _, p, e in self.own() if e.kind == "event"}
        entered: set[str] = set()
        for one, each in moving:
            if each.to and each.to != self.modes[one.name]:
                entered.add(one.name)
            if f"{one.name}.since" in self.values and not (each.kind == "event" and not each.to):
                new[f"{one.name}.since"] = F(0)
        for one, each in moving:
            if each.to:
                self.modes[one.name] = each.to
        self.values |= new
        self.after(part, edge, how, entered, rising, before)

    def rises(self, edge: Edge) -> bool:
        values = [(self.value(s), self.rate(s)) for s in edge.surfaces]
        return _joined(edge, [v > 0 or (v == 0 and rate > 0) for v, rate in values])

    def after(
        self, part: Part, edge: Edge, how: str, entered: set[str], rising: set[tuple[str, str]],
        before: dict[tuple[str, str], list[F]],
    ) -> None:  # fmt: skip
        """What events remember after a transition."""
        for name in entered:
            self.due = {key for key in self.due if key[0] != name}
            self.waiting = [each for each in self.waiting if each[1] != name]
        for _, p, e in self.own():
            key = p.name, e.name
            if e.kind != "event":
                continue
            if p.name in entered:
                self.remember(p, e)
                continue
            touched = [self.value(s) for s in e.surfaces] != before.get(key)
            if p is part and e is edge and how != "executes":
                if how == "entry" or touched:
                    self.armed[key] = not self.true_after_firing(e, before[key])
                else:
                    self.armed[key] = False
                self.due.discard(key)
            elif touched:
                holds = self.true(e)
                if self.armed[key] and (holds or key in rising):
                    self.due.add(key)
                self.armed[key] = self.armed[key] or not holds

    def true_after_firing(self, edge: Edge, before: list[F]) -> bool:
        """Its condition after it fired: comparisons that stay are what they are next."""
        found: list[bool] = []
        for s, old in zip(edge.surfaces, before, strict=True):
            r = self.value(s)
            found.append(r >= 0 if r != old else r > 0 or (r == 0 and self.rate(s) >= 0))
        return _joined(edge, found)

    def settle(self, jumped: frozenset[int] = frozenset()) -> bool:
        """Make all that happens at this instant; False where that has no end."""
        for _ in range(40):
            if entries := self.entries(jumped):
                k = self.first([(k, "fires") for k in entries])[0]
                self.go(k, "entry")
                jumped = frozenset()
                continue
            jumped = frozenset()
            standing = self.standing()
            if not standing:
                return True
            self.go(*self.first(standing))
        self.ill.add("no end")
        return False

    def choices(self) -> None:
        """Note where the order of what happens together matters."""
        standing = self.standing()
        if len(standing) < 2 or self.entries():
            return
        worlds: list[World] = []
        for each in standing:
            world = self.copy()
            world.go(*each)
            world.settle()
            worlds.append(world)
        if not all(world.same(worlds[0]) for world in worlds):
            self.ill.add("the order of transitions matters")

    def next_time(self) -> F:
        found = [UNTIL, *(at for at, *_ in self.waiting if at > self.t)]
        if self.sample + 1 < len(self.system.times):
            found.append(self.system.times[self.sample + 1])
        for _, _, edge in self.own():
            for s in edge.surfaces:
                r, rate = self.value(s), self.rate(s)
                if r * rate < 0:
                    found.append(self.t - r / rate)
                if r and abs(r) < NEAR:
                    self.ill.add("a surface is near")
        return min(found)

    def flow(self, until: F) -> None:
        slopes = {name: self.slope(name) for name in self.values}
        self.values = {name: value + (until - self.t) * slopes[name] for name, value in self.values.items()}
        self.t = until

    def jump(self) -> None:
        """The input jumps: what it sets off at once goes, then what is reached."""
        inside = frozenset(
            k for k, _, e in self.own() if e.kind == "when" and not e.condition and self.value(e.surfaces[0]) < 0
        )
        other = self.copy()
        other.choices()
        self.ill |= other.ill
        other.settle()
        other.sample += 1
        other.settle()
        self.sample += 1
        self.settle(inside)
        if not self.same(other):
            self.ill.add("the order of a jump and a transition matters")


def _joined(edge: Edge, values: list[bool]) -> bool:
    return all(values) if edge.word == "and" else any(values)


def execution(system: System) -> World:
    """The execution of a system, to its end or to more transitions than are of interest."""
    values = {name: value for part in system.parts for name, value in part.initial.items()}
    values |= {f"{part.name}.since": F(0) for part in system.parts if part.timed}
    world = World(system, F(0), {part.name: part.start for part in system.parts}, values, 0)
    for _, part, edge in world.own():
        if edge.kind == "event":
            world.remember(part, edge)
    world.settle()
    while world.t < UNTIL and len(world.made) < MOST and "no end" not in world.ill:
        last, world_t = world.t, world.next_time()
        if world_t - last < NEAR:
            world.ill.add("two instants are near")
        world.flow(world_t)
        if world.sample + 1 < len(system.times) and system.times[world.sample + 1] == world.t:
            world.jump()
        elif world.t < UNTIL:
            world.choices()
            world.settle()
    return world


# ---- random systems -----------------------------------------------------------------------------------------------


class Draw:
    """A random system under construction."""

    def __init__(self, seed: int) -> None:
        self.r, self.parts = random.Random(seed), list[Part]()
        self.sounds: list[str] = []  # transitions to listen to
        self.levels: list[tuple[str, F]] = [(LOAD, F(2))]  # numbers that do not flow, and their sizes
        self.integrated: list[tuple[str, F]] = []  # states that flow, and their sizes

    def number(self, least: int = 1, most: int = 24) -> F:
        return F(self.r.randint(least, most), self.r.choice((4, 6, 7, 8, 10, 11, 12)))

    def clock(self, name: str) -> None:
        c, period = f"{name}.c", self.r.choice((F(1), F(1, 2), F(3, 2), self.number(5)))
        reset = self.r.choice(({c: line()}, {c: line(-period, **{c: 1})}))
        tick = Edge("tick", "when", (line(-period, **{c: 1}),), reset=reset, priority=self.r.choice((0, 0, 1)))
        phase = self.r.choice((F(0), period / 3))
        self.add(Part(name, {"run": {c: line(1)}}, {"run": [tick]}, {}, "run", {c: phase}), [tick])

    def pulses(self, name: str) -> None:
        c, d, period = f"{name}.c", f"{name}.d", self.r.choice((F(1), F(1, 2), self.number(6, 18)))
        level, size = self.r.choice(self.levels)
        width = line(period / 5, **{level: period / 2 / size}) if self.r.random() < 0.7 else line(period / 3)
        off = Edge("off", "when", (line(**{c: 1, d: -1}),), to="low")
        on = Edge("on", "when", (line(-period, **{c: 1}),), to="high", reset={c: line(), d: width})
        flow = {c: line(1), d: line()}
        start = {c: F(0), d: period / 3}
        part = Part(
            name,
            {"high": flow, "low": flow},
            {"high": [off], "low": [on]},
            {"high": {"u": F(1)}, "low": {"u": F(0)}},
            "high",
            start,
        )
        self.add(part, [on, off], [(f"{name}.u", F(1))])

    def switch(self, name: str) -> None:
        x, high, low = f"{name}.x", self.number(6), -self.number(1, 8)
        level, size = self.r.choice(self.levels)
        share = self.r.choice((F(0), 1 / (3 * size)))
        up, down = self.number(3, 12), self.number(3, 12)
        rise = Edge("high", "when", (line(-high, **{x: 1}),), to="down")
        fall = Edge("low", "when", (line(low, **{x: -1}),), to="up")
        flows = {"up": {x: line(up, **{level: up * share})}, "down": {x: line(-down, **{level: down * share})}}
        lets = {"up": {"u": F(1)}, "down": {"u": F(-1)}}
        self.add(
            Part(name, flows, {"up": [rise], "down": [fall]}, lets, "up", {x: F(0)}),
            [rise, fall],
            [(f"{name}.u", F(1))],
        )
        self.integrated.append((x, high))

    def integrator(self, name: str) -> None:
        x, high = f"{name}.x", self.number(4)
        level, size = self.r.choice(self.levels)
        flow = line(self.number(2, 10), **{level: self.r.choice((-1, 1)) * self.number(1, 8) / size / 2})
        kind = self.r.choice(("when", "event"))
        full = Edge("full", kind, (line(-high, **{x: 1}),), reset={x: line(self.r.choice((0, -high / 3)))})
        empty = Edge(
            "empty",
            kind,
            (line(-high, **{x: -1}),),
            reset={x: line()},
            initially=kind == "when" or self.r.random() < 0.7,
        )
        self.add(Part(name, {"run": {x: flow}}, {"run": [full, empty]}, {}, "run", {x: F(0)}), [full, empty])
        self.integrated.append((x, high))

    def counter(self, name: str) -> None:
        n, most = f"{name}.n", self.r.randint(2, 4)
        heard = self.r.choice(self.sounds)
        up = Edge("up", "on", on=heard, reset={n: line(1, **{n: 1})})
        reset = {n: line()}
        if self.integrated and self.r.random() < 0.4:
            x, _ = self.r.choice(self.integrated)
            reset[x] = line(0, **{x: F(1, 2)})
        threshold = most if self.r.random() < 0.6 else most - F(1, 2)
        full = Edge(
            "full",
            self.r.choice(("when", "event")),
            (line(-threshold, **{n: 1}),),
            reset=reset,
            priority=self.r.choice((0, 1, -1)),
        )
        self.add(
            Part(name, {"count": {n: line()}}, {"count": [up, full]}, {}, "count", {n: F(0)}),
            [full, up],
            [(n, F(most))],
        )

    def timer(self, name: str) -> None:
        since, long_ = f"{name}.since", self.number(3, 14)
        n = f"{name}.n"
        condition = ()
        if len(self.levels) > 1 and self.r.random() < 0.3:
            level, size = self.r.choice(self.levels[1:])
            condition = (line(size / 3, **{level: -1}),)
        go = Edge("go", "on", on=self.r.choice(self.sounds), to="busy", condition=condition)
        over = Edge(
            "over",
            self.r.choice(("when", "event")),
            (line(-long_, **{since: 1}),),
            to="idle",
            reset={n: line(1, **{n: 1})},
        )
        flow = {n: line()}
        lets = {"idle": {"u": F(0)}, "busy": {"u": F(1)}}
        self.add(
            Part(name, {"idle": flow, "busy": flow}, {"idle": [go], "busy": [over]}, lets, "idle", {n: F(0)}),
            [go, over],
            [(f"{name}.u", F(1))],
        )

    def watcher(self, name: str) -> None:
        n = f"{name}.n"
        x, size = self.r.choice(self.integrated)
        surfaces = [line(-size / 2, **{x: 1})]
        if self.r.random() < 0.5 and len(self.levels) > 1:
            level, most = self.r.choice(self.levels[1:])  # an event may not jump with an input
            other = line(-most / 3, **{level: 1}) if self.r.random() < 0.7 else line(size / 4, **{x: -1})
            surfaces.append(other)
        word = self.r.choice(("and", "or"))
        delay = self.r.choice((None, None, F(0), self.number(1, 4)))
        seen = Edge(
            "seen",
            "event",
            tuple(surfaces),
            word,
            reset={n: line(1, **{n: 1})},
            delay=delay,
            initially=self.r.random() < 0.8,
        )
        self.add(Part(name, {"watch": {n: line()}}, {"watch": [seen]}, {}, "watch", {n: F(0)}), [seen], [(n, F(8))])

    def add(self, part: Part, heard: Sequence[Edge], levels: Sequence[tuple[str, F]] = ()) -> None:
        self.parts.append(part)
        self.sounds += [f"{part.name}.{edge.name}" for edge in heard]
        self.levels += levels


def random_system(seed: int) -> System:
    """A system of two to six parts; equal seeds give equal systems."""
    draw = Draw(seed)
    kinds = [draw.clock, draw.pulses, draw.switch, draw.integrator]
    draw.r.choice(kinds)("a")
    for name in "bcdef"[: draw.r.randint(1, 5)]:
        more = [draw.counter, draw.counter, draw.timer] + ([draw.watcher, draw.watcher] if draw.integrated else [])
        draw.r.choice(kinds + more)(name)
    draw.r.shuffle(draw.parts)
    step = draw.r.choice((F(1), F(1, 2), draw.number(8, 30)))
    count = draw.r.randint(2, 4)
    return System(draw.parts, [step * k for k in range(count)], [F(draw.r.randint(1, 4), 2) for _ in range(count)])
