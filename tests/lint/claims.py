"""Random models, and attempts to contradict by runs what lint claims of them.

A model has states x, y and z, one or two modes, and guards and flows of several families: powers of odd and even
order, kinks, jumps, surfaces in time, inputs, chains of integrators, conditions, walls, resets into each other. Levels
come from a short list, so that surfaces meet in corners, and starts and resets lie on them.
"""

from __future__ import annotations

import math
import random
import re
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import hsdsl
from hsdsl.analysis.lint import lint, selected
from hsdsl.base.errors import ModelError, UsageError

LEVELS = ("0", "1", "-1", "1/2")
NAMES = ("x", "y", "z")
FUNCTIONS = {name: getattr(math, name) for name in ("sin", "cos", "exp", "tanh", "sqrt", "floor")}
FUNCTIONS |= {"abs": abs, "min": min, "max": max, "sign": lambda v: (v > 0) - (v < 0), "__builtins__": {}}
SELECTED = selected(["mathematics", "HS406", "HS427", "HS428"])


@dataclass
class Edge:
    """An edge as text: its surface function, its condition, where it leads to."""

    name: str
    residual: str
    target: str
    condition: str = ""
    reset: dict[str, str] = field(default_factory=dict)
    priority: int = 0

    def text(self, condition: str) -> str:
        """It in a file, with a condition."""
        parts = [f"name: {self.name}", f'when: "{self.residual} >= 0"', f"to: {self.target}"]
        parts += [f'if: "{condition}"'] if condition else []
        parts.append("reset: {" + ", ".join(f'{k}: "{v}"' for k, v in self.reset.items()) + "}")
        parts.append(f"priority: {self.priority}")
        return "      - {" + ", ".join(parts) + "}"


@dataclass
class Model:
    """A random model."""

    flows: dict[str, dict[str, str]]
    walls: dict[str, list[str]]
    edges: dict[str, list[Edge]]
    until: float = 1.5

    def text(self, off: str = "") -> str:
        """The file; also with one edge that never fires."""
        lines = ["hsdsl: 1", "inputs:", "  u: {times: [0, 0.4, 0.9], values: [1, -1, 0.5], hold: zero}"]
        lines += ["  w: {times: [0, 0.7, 1.5], values: [-1, 1, 0], hold: linear}", "modes:"]
        for mode, flow in self.flows.items():
            lines += [f"  {mode}:", "    flow: {" + ", ".join(f'{k}: "{v}"' for k, v in flow.items()) + "}"]
            lines.append("    domain: [" + ", ".join(f'"{wall} <= 0"' for wall in self.walls[mode]) + "]")
            lines.append("    transitions:" if self.edges[mode] else "    transitions: []")
            for edge in self.edges[mode]:
                lines.append(edge.text("x < x - 1" if edge.name == off else edge.condition))
        lines.append("outputs: {" + ", ".join(f'r_{e.name}: "{e.residual}"' for e in self.all()) + "}")
        lines.append("initial: {mode: a, x: -1/3, y: -1/4, z: 1/5}")
        return "\n".join([*lines, f"experiment: {{until: {self.until}, max_transitions: 60}}", ""])

    def all(self) -> Iterator[Edge]:
        """Every edge."""
        return (edge for edges in self.edges.values() for edge in edges)

    def edge(self, name: str) -> tuple[str, Edge]:
        """The edge of a name, and its mode."""
        return next((mode, e) for mode, edges in self.edges.items() for e in edges if e.name == name)


def _affine(rng: random.Random) -> str:
    one, other = rng.sample(NAMES, 2)
    level = rng.choice(LEVELS)
    return rng.choice((f"{one} - ({level})", f"-({one}) + {level}", f"{one} + {other} - ({level})", f"{one} - {other}"))


def residual(rng: random.Random) -> str:
    """A surface function."""
    one, other = _affine(rng), _affine(rng)
    kind = rng.randrange(16)
    odd, even = rng.choice((3, 5, 7)), rng.choice((2, 4))
    choices = {
        5: f"({one})**{odd}", 6: f"{rng.choice(('', '-'))}({one})**{even}", 7: f"min({one}, {other})",
        8: f"max({one}, {other})", 9: f"abs({one}) - {rng.choice(('0', '1/2'))}", 10: f"({one})*abs({one})",
        11: f"sign({one}) - {rng.choice(('0', '1/2', '2'))}", 12: f"floor({one}) - {rng.choice(('0', '1/2'))}",
        13: rng.choice((f"{one} - sin(3*t)/2", f"{one} - t", "sin(5*t) - 1/2", f"{one} + t**3",
                        f"{one} - sign(2*t - 1)/2", f"{one} + floor(2*t)", "floor(2*t) - 1")),
        14: rng.choice((f"({one})**3 - 2*({one})**2 + {one}", "x**2 + y**2 - 1", f"exp({one}) - 1", "1 - x**2 - y*y")),
        15: rng.choice((f"{one} - u", f"{one} + w/2", f"({one})*({other})")),
    }  # fmt: skip
    return choices.get(kind, one)


def _rate(rng: random.Random, name: str) -> str:
    other = rng.choice([n for n in NAMES if n != name])
    return rng.choice((
        "1", "-1", "0", "1/2", f"{other}", f"-{other}", f"-{name}", f"1 - {name}", f"{name}", f"{other}**2",
        f"-abs({other})", f"abs({name})", f"sign({other})", f"-sign({name})", f"max({other}, 0)", f"min({name}, 1) - 1",
        f"{other}**3", "t - 1/2", "t**2", "u", "w", f"-{name}**3", f"{name}**2", f"floor({other})", f"-{other} + u/2",
        "floor(2*t) - 1", f"{other}*sign(2*t - 1)",
    ))  # fmt: skip


def _flow(rng: random.Random) -> dict[str, str]:
    fixed = {
        0: {"x": "y", "y": "z", "z": rng.choice(("1", "-1"))},
        1: {"x": "y", "y": "-x", "z": "0"},
        2: {"x": "1", "y": rng.choice(("1", "-1", "0")), "z": "0"},
    }
    return fixed.get(rng.randrange(6)) or {name: _rate(rng, name) for name in NAMES}


def _condition(rng: random.Random) -> str:
    if rng.random() < 0.6:
        return ""
    parts = [f"{_affine(rng)} {rng.choice(('>=', '<=', '<', '>'))} 0" for _ in range(rng.randint(1, 2))]
    return rng.choice((" and ", " or ")).join(parts)


def _reset(rng: random.Random) -> dict[str, str]:
    def value(name: str) -> str:
        return rng.choice((*LEVELS, f"-{name}", f"{name}/2", f"{name} + 1", "y", "x", f"abs({name})"))

    return {name: value(name) for name in NAMES if rng.random() < 0.35}


def drawn(seed: int) -> Model:
    """A random model; equal seeds give equal ones."""
    rng = random.Random(seed)
    modes = rng.choice((("a",), ("a", "b"), ("a", "b", "c")))
    edges: dict[str, list[Edge]] = {}
    for mode in modes:
        edges[mode] = []
        for k in range(rng.randint(1, 3)):
            earlier = [e.residual for found in edges.values() for e in found]
            surface = rng.choice(earlier) if earlier and rng.random() < 0.25 else residual(rng)
            surface = f"-({surface})" if rng.random() < 0.1 else surface
            priority = rng.choice((0, 0, 0, 1, -1))
            edges[mode].append(Edge(f"{mode}{k}", surface, rng.choice(modes), _condition(rng), _reset(rng), priority))
    walls = {mode: [_affine(rng) for _ in range(rng.choice((0, 0, 1, 2)))] for mode in modes}
    return Model({mode: _flow(rng) for mode in modes}, walls, edges)


def value(text: str, at: dict[str, float]) -> float:
    """An expression of a model at a point; NaN where it has no value."""
    try:
        return float(eval(text, FUNCTIONS, at))
    except (ZeroDivisionError, ValueError, OverflowError):
        return math.nan


NUMBER = r"-?\d[\d.]*(?:e[+-]?\d+)?"


def point(message: str) -> dict[str, float]:
    """The first point that a message names."""
    found = re.search(r"at ((?:\w+ = \S+,? ?)+)", message)
    return {k: float(v) for k, v in re.findall(rf"(\w+) = ({NUMBER})", found[1])} if found else {}


def box(message: str) -> dict[str, tuple[float, float]]:
    """The bounds that a message states."""
    ends = {name: (-float(v), float(v)) for name, v in re.findall(rf"\|(\w+)\| <= ({NUMBER})", message)}
    for low, name, high in re.findall(rf"({NUMBER}) <= (\w+) <= ({NUMBER})", message):
        ends[name] = float(low), float(high)
    for name, sign, level in re.findall(rf"(?:within|,) (\w+) (<=|>=) ({NUMBER})", message):
        ends.setdefault(name, (-math.inf, float(level)) if sign == "<=" else (float(level), math.inf))
    return ends


class Attack:
    """One model and the findings about it; ``wrong`` gathers the claims that runs contradict."""

    def __init__(self, seed: int, starts: int = 6) -> None:
        self.seed, self.starts, self.rng = seed, starts, random.Random(seed + 1)
        self.model = drawn(seed)
        text = self.model.text()
        self.findings = lint(f"random-{seed}.yaml", SELECTED, text=text.encode()).findings
        self.wrong: list[str] = []
        self.tried: Counter[str] = Counter()
        self._runs: dict[str, hsdsl.Model] = {}

    def all(self) -> Attack:
        """Try every claim."""
        for finding in self.findings:
            attack = CLAIMS.get(finding.code)
            if attack and (verdict := attack(self, finding.message)) is not None:
                self.tried[finding.code] += 1
                if verdict:
                    self.wrong.append(f"seed {self.seed}: {finding.code} {finding.message} -- {verdict}")
        return self

    def run(self, mode: str, at: dict[str, float], until: float | None = None, scheme: str = "located", **text):
        """A run from a point; None where it has none."""
        key = self.model.text(**text)
        try:
            if key not in self._runs:
                self._runs[key] = hsdsl.loads(key)
            states = {name: at.get(name, 0.3) for name in NAMES}
            initial = {"mode": mode, **states}
            return self._runs[key].simulate(
                until or self.model.until,
                initial=initial,
                scheme=scheme,
                engine="python",
                relaxation=1e-6,
                method="rk4",
                step=0.01,
            )
        except (ModelError, UsageError):
            return None

    def points(self) -> Iterator[dict[str, float]]:
        """Starts, many of them on surfaces and in corners."""
        for _ in range(self.starts):
            some = (0.0, 1.0, -1.0, 0.5, -0.5, self.rng.uniform(-1.5, 1.5), self.rng.gauss(0, 0.3))
            yield {name: self.rng.choice(some) for name in NAMES}


def _at(run: hsdsl.Execution, time: float) -> dict[str, float]:
    found = run(time)
    return {name: float(found[name]) for name in NAMES} | {"t": time}


def _named(message: str) -> list[str]:
    return re.findall(r"'([abc]\d)'", message)


def never_crossed(attack: Attack, message: str) -> str:
    """HS501: no run crosses the guard, but by an error that does not grow."""
    (name, *_), limits = _named(message), box(message)
    mode, edge = attack.model.edge(name)
    for at in attack.points():
        for scheme in ("located", "relaxed"):
            run = attack.run(mode, at, scheme=scheme)
            for t in run.transitions if run else ():
                place = {**t.before, "t": t.time}
                inside = all(low <= place.get(k, 0.0) <= high for k, (low, high) in limits.items())
                if t.edge != name or t.entry or not inside or (scheme == "relaxed" and "along" in message):
                    continue
                if "along" not in message or _rises(attack, mode, edge, t.before, t.time):
                    return f"{scheme} from {mode} {at} crosses it at {place}"
    return ""


def _rises(attack: Attack, mode: str, edge: Edge, at: dict[str, float], time: float) -> bool:
    """Whether the surface function goes on to rise where the edge never fires, and nothing else does."""
    run = attack.run(mode, at, off=edge.name) if "t" not in edge.residual and "u" not in edge.residual else None
    if run is None or run.transitions:
        return False
    return max(value(edge.residual, _at(run, 0.01 * k)) for k in range(20)) > 1e-5


def commutes(attack: Attack, message: str) -> str | None:
    """HS508: which of two transitions goes first changes nothing, or something, where that is the claim."""
    first, second = _named(message)[:2]
    mode, one = attack.model.edge(first)
    other = attack.model.edge(second)[1]
    claims = {"they commute": True, "; it matters": False, "order leads to the same state there": True}
    same = next((verdict for says, verdict in claims.items() if says in message), None)
    if same is None or not _plain(point(message)) or "u" in one.residual + other.residual:
        return None
    for _ in range(4 if "they commute" in message else 1):
        free = {name: attack.rng.choice((0.0, 0.7, -0.4, 1.0)) for name in NAMES}
        at = {**free, **point(message)}
        ends = [_at_once(attack, mode, at, go, (first, second)) for go in (first, second)]
        if None in ends:
            continue
        if _alike(*ends) is not same:
            return f"from {mode} {at}: {ends}"
    return ""


def _at_once(attack: Attack, mode: str, at: dict[str, float], go: str, both: tuple[str, str]):
    """The mode and the states after what happens at once when an edge goes first; None where both are not tied."""
    run = attack.run(mode, at, until=1e-9)
    first = run.transitions[0] if run and run.transitions else None
    if first is None or first.entry or not {*both} <= {first.edge, *first.alternatives}:
        return None
    edge = attack.model.edge(go)[1]
    after = {name: value(edge.reset.get(name, name), at) for name in NAMES}
    run = attack.run(edge.target, after, until=1e-9)
    return (run.final.mode, run.final.state) if run and run.stop.reason == "until" else None


def _alike(one, other) -> bool:
    return one[0] == other[0] and all(abs(one[1][k] - other[1][k]) < 1e-6 for k in one[1])


def met(attack: Attack, message: str) -> str | None:
    """HS505: what the flow does at a point of the guard where the rate vanishes."""
    signs = {"graze": -1, "goes out": 1, "comes in": -1, "only by resting": 1}
    sign = next((s for says, s in signs.items() if says in message), None)
    return None if sign is None else _met(attack, message, sign)


def _met(attack: Attack, message: str, sign: int) -> str | None:
    @somewhere
    def check(attack: Attack, message: str, at: dict[str, float]) -> str | None:
        mode, edge = attack.model.edge(_named(message)[0])
        run = attack.run(mode, at, until=0.02, off=edge.name)
        if run is None or run.transitions or run.stop.reason != "until":
            return None
        values = [value(edge.residual, _at(run, 0.0025 * k)) for k in range(1, 9)]
        return f"r goes {values} from {at}" if min(sign * v for v in values) < -1e-12 else ""

    return check(attack, message)


def signed(attack: Attack, message: str) -> str | None:
    """HS517: a surface function has no positive, or no negative value."""
    text, limits = re.search(r"surface '(.*?) [<>]= 0'", message), box(message)
    sign = 1 if "nowhere positive" in message else -1 if "nowhere negative" in message else 0
    if not text or not sign:
        return None
    wall = " <= 0'" in message
    for _ in range(300):
        at = {name: attack.rng.uniform(-3, 3) for name in (*NAMES, "u", "w")}
        at["t"] = attack.rng.uniform(0, attack.model.until)
        if all(low <= at[k] <= high for k, (low, high) in limits.items()) and sign * value(text[1], at) > 1e-12:
            return f"it is {value(text[1], at)} at {at} {wall}"
    return ""


def somewhere(check: Callable[[Attack, str, dict[str, float]], str | None]) -> Callable[[Attack, str], str | None]:
    """A claim about a point of which a message names some coordinates: it holds for some values of the others."""

    def attempt(attack: Attack, message: str) -> str | None:
        at = point(message)
        if not _plain(at):
            return None
        found = [check(attack, message, {**free, **at}) for free in ({}, *attack.points(), *attack.points())]
        answer = [verdict for verdict in found if verdict is not None]
        return "" if "" in answer else answer[0] if answer else None

    return attempt


def _plain(at: dict[str, float]) -> bool:
    """Whether a point is one of a start: written exactly, at time 0, and not about an input."""
    return (
        bool(at) and at.get("t", 0) == 0 and not {"u", "w"} & at.keys() and all(len(f"{v:g}") < 8 for v in at.values())
    )


@somewhere
def lands(attack: Attack, message: str, at: dict[str, float]) -> str | None:
    """HS506: a transition from the point lands beyond, and what the message says happens."""
    found = re.search(r"where '(\w+)' fires at once", message)
    run = _fired(attack, _named(message)[0], at)
    if run is None or (not found and "where the run stops" not in message):
        return None
    if found:
        ok = len(run.transitions) > 1 and run.transitions[1].edge == found[1] and run.transitions[1].entry
    else:
        ok = run.stop.reason == "left_domain" and len(run.transitions) == 1
    return "" if ok else f"{[t.edge for t in run.transitions[:3]]}, {run.stop.reason} from {at}"


def _fired(attack: Attack, name: str, at: dict[str, float]) -> hsdsl.Execution | None:
    """A run from a point in which an edge goes first, at once; None where another does."""
    run = attack.run(attack.model.edge(name)[0], at, until=1e-3)
    good = run and run.transitions and run.transitions[0].edge == name and not run.transitions[0].entry
    return run if good and run.transitions[0].time < 1e-9 else None


@somewhere
def endless(attack: Attack, message: str, at: dict[str, float]) -> str | None:
    """HS509, HS510: transitions without end at one place."""
    run = _fired(attack, _named(message)[0], at)
    if run is None:
        return None
    ended = len(run.transitions) >= 17 or run.stop.reason == "zeno"
    return "" if ended else f"{[t.edge for t in run.transitions]}, {run.stop.reason} from {at}"


@somewhere
def passed(attack: Attack, message: str, at: dict[str, float]) -> str | None:
    """HS503: from the point, the flow passes the surface and nothing fires."""
    mode, edge = attack.model.edge(_named(message)[0])
    run = attack.run(mode, at, until=1e-3)
    if run is None or re.search(r"\b[uw]\b", edge.residual):
        return None
    if run.stop.reason != "until" or run.transitions:
        return f"{[t.edge for t in run.transitions]}, {run.stop.reason} from {at}"
    beyond = value(edge.residual, _at(run, 1e-3))
    if beyond == 0:  # so slow that round-off hides it
        return None
    return "" if beyond > 0 else f"r = {beyond} from {at}"


def unentered(attack: Attack, message: str) -> str:
    """HS406: no run from the initial mode enters the mode."""
    (name,) = re.findall(r"the mode '(\w+)'", message)
    for at in attack.points():
        run = attack.run("a", at)
        if run and any(t.target == name for t in run.transitions):
            return f"entered from {at}"
    return ""


CLAIMS: dict[str, Callable[[Attack, str], str | None]] = {
    "HS406": unentered, "HS501": never_crossed, "HS503": passed, "HS505": met, "HS506": lands, "HS508": commutes,
    "HS509": endless, "HS510": endless, "HS517": signed,
}  # fmt: skip


if __name__ == "__main__":
    import sys

    total: Counter[str] = Counter()
    for seed in range(int(sys.argv[1]), int(sys.argv[2])):
        attack = Attack(seed).all()
        total.update(attack.tried)
        print(*attack.wrong, sep="\n", end="\n" if attack.wrong else "", flush=True)
    print(dict(total))
