"""Random planar models with constant flows and affine guards and resets, against an event-driven solution in fractions.

Where every flow is constant the relaxed execution is the execution delayed: states at transitions, their order and
their times less the delays spent in strips are those of the hybrid system itself, whatever the relaxation.
"""

from __future__ import annotations

import random
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import pytest

from hsdsl.interface.model import Model
from hsdsl.interface.model.estimate import corrected_times
from hsdsl.language.elaborate import elaborate

UNTIL, MOST = 12, 12  # after many transitions round-off decides what lands on a guard by coincidence
METHODS = [{"method": "euler", "step": "1/7"}, {"method": "midpoint", "step": "0.9"}, {"tolerance": "1e-6"}]


@dataclass(frozen=True)
class Half:
    """The inequality a x + b y >= c."""

    a: int
    b: int
    c: Fraction

    def value(self, x: tuple[Fraction, Fraction]) -> Fraction:
        return self.a * x[0] + self.b * x[1] - self.c

    def rate(self, f: tuple[int, int]) -> int:
        return self.a * f[0] + self.b * f[1]

    def __str__(self) -> str:
        return f"{self.a}*x + {self.b}*y >= {self.c}"


@dataclass(frozen=True)
class Edge:
    target: int
    when: Half
    condition: Half | None
    reset: tuple[tuple[int, int, Fraction], tuple[int, int, Fraction]]
    priority: int

    def after(self, x: tuple[Fraction, Fraction]) -> tuple[Fraction, Fraction]:
        first, second = (p * x[0] + q * x[1] + r for p, q, r in self.reset)
        return first, second


@dataclass(frozen=True)
class Mode:
    flow: tuple[int, int]
    edges: tuple[Edge, ...]
    walls: tuple[Half, ...]


def draw(rng: random.Random) -> tuple[Mode, ...]:
    """A random model; small whole numbers make ties and coincidences common."""
    count = rng.randint(1, 4)

    def half(odd: bool = False) -> Half:
        a, b = rng.choice([(1, 0), (-1, 0), (0, 1), (0, -1), (1, 1), (1, -1), (-1, 1), (2, 1), (-1, -2)])
        return Half(a, b, Fraction(rng.randint(-6, 6), 2) + (Fraction(1, 7) if odd else 0))

    def edge() -> Edge:
        rows = rng.choice(
            [((1, 0, 0), (0, 1, 0))] * 4
            + [((0, 1, 0), (1, 0, 0)), ((1, 0, -1), (0, 1, 0)), ((-1, 0, 0), (0, 1, 1)), ((0, 0, 0), (0, 2, 0))]
        )
        reset = tuple((p, q, Fraction(r)) for p, q, r in rows)
        condition = half(odd=True) if rng.random() < 0.3 else None
        return Edge(rng.randrange(count), half(), condition, reset, rng.choice([0, 0, 0, 1, -1]))  # type: ignore[arg-type]

    flows = [(1, 0), (0, 1), (1, 1), (-1, 1), (1, -1), (-1, -1), (2, 1), (-1, 2), (0, 0), (-1, 0), (0, -1)]
    return tuple(
        Mode(
            rng.choice(flows),
            tuple(edge() for _ in range(rng.randint(1, 3))),
            tuple(Half(h.a, h.b, h.c - 4) for h in (half(odd=True) for _ in range(rng.randint(0, 1)))),
        )
        for _ in range(count)
    )


def text(modes: tuple[Mode, ...], start: tuple[Fraction, Fraction]) -> str:
    """The model in the language."""
    lines = ["hsdsl: 1", "modes:"]
    for k, mode in enumerate(modes):
        lines += [f"  m{k}:", f"    flow: {{x: {mode.flow[0]}, y: {mode.flow[1]}}}"]
        if mode.walls:
            lines.append(f"    domain: [{', '.join(map(str, mode.walls))}]")
        lines.append("    transitions:")
        for i, edge in enumerate(mode.edges):
            condition = f"if: {edge.condition}, ".replace(">=", ">") if edge.condition else ""
            x, y = (f"{p}*x + {q}*y + {r}" for p, q, r in edge.reset)
            lines.append(
                f"      - {{name: e{k}{i}, when: {edge.when}, {condition}to: m{edge.target}, "
                f"reset: {{x: {x}, y: {y}}}, priority: {edge.priority}}}"
            )
    return "\n".join(
        [*lines, f"initial: {{mode: m0, x: {start[0]}, y: {start[1]}}}", f"experiment: {{until: {UNTIL}}}"]
    )


def solve(modes: tuple[Mode, ...], x: tuple[Fraction, Fraction]) -> tuple[list[Any], str]:
    """The execution: (edge, time, state before, alternatives, entry) of each transition, and how it ends."""
    t, k, events = Fraction(0), 0, []
    visited: set[Any] = set()
    while len(events) < MOST:
        mode = modes[k]
        beyond = [i for i, e in enumerate(mode.edges) if e.condition is None and e.when.value(x) > 0]
        if beyond:
            if (k, x) in visited:
                return events, "zeno"
            visited.add((k, x))
            chosen, at = min(beyond, key=lambda i: (-mode.edges[i].priority, i)), t
            others = [i for i in beyond if i != chosen]
        else:
            visited = set()
            if any(w.value(x) < 0 for w in mode.walls):
                return events, "left_domain"
            times = {
                i: -e.when.value(x) / e.when.rate(mode.flow)
                for i, e in enumerate(mode.edges)
                if e.when.value(x) <= 0 and e.when.rate(mode.flow) > 0
            }
            times = {
                i: s
                for i, s in times.items()
                if (c := mode.edges[i].condition) is None or c.value(moved(x, mode.flow, s)) > 0
            }
            leaving = [w.value(x) / -w.rate(mode.flow) for w in mode.walls if w.rate(mode.flow) < 0]
            first = min(times.values(), default=None)
            if leaving and (first is None or min(leaving) < first) and t + min(leaving) < UNTIL:
                return events, "left_domain"
            if first is None or t + first > UNTIL:
                return events, "until"
            tied = [i for i, s in times.items() if s == first]
            chosen = min(tied, key=lambda i: (-mode.edges[i].priority, i))
            others, at, x = [i for i in tied if i != chosen], t + first, moved(x, mode.flow, first)
        events.append((f"e{k}{chosen}", at, x, {f"e{k}{i}" for i in others}, bool(beyond)))
        t, x, k = at, mode.edges[chosen].after(x), mode.edges[chosen].target
    return events, "many"


def moved(x: tuple[Fraction, Fraction], f: tuple[int, int], s: Fraction) -> tuple[Fraction, Fraction]:
    return x[0] + s * f[0], x[1] + s * f[1]


def check(seed: int, precision: int | None = None) -> None:
    """One random model, by every method."""
    rng = random.Random(seed)
    modes, start = draw(rng), (Fraction(rng.randint(-4, 4), 3), Fraction(rng.randint(-4, 4), 3))
    expected, end = solve(modes, start)
    model = Model(elaborate("random.yaml", text=text(modes, start).encode()))
    for settings in METHODS:
        run = model.simulate(relaxation="1e-5", max_transitions=MOST, precision=precision, **settings)
        compare(expected, end, run, f"seed {seed}, {settings}\n{text(modes, start)}")


def compare(expected: list[Any], end: str, run: Any, label: str) -> None:
    times = corrected_times(run.transitions)
    for found, time, (edge, at, state, others, entry) in zip(run.transitions, times, expected, strict=False):
        assert (found.edge, found.entry, set(found.alternatives)) == (edge, entry, others), (found.index, label)
        assert abs(time - at) < 1e-9, (found.index, label)
        for name, value in zip("xy", state, strict=True):
            assert abs(found.before[name] - value) < 1e-9 * max(1, abs(value)), (found.index, label)
    counts = end == "many" and run.stop.reason == "zeno"  # without end at one instant, where a state only counts
    if counts or run.stop.message.startswith("sliding"):  # what follows is at the same instant
        last = expected[len(run.transitions) - 1][1]
        assert all(at == last for _, at, *_ in expected[len(run.transitions) :]), label
    elif end in ("until", "many"):  # delays may keep the last transitions from happening
        late = run.transitions[-1].time - times[-1] + 1e-3 if run.transitions else 1e-3
        missing = expected[len(run.transitions) :]
        assert all(at > UNTIL - late for _, at, *_ in missing), label
    elif end == "zeno":  # a cycle closes to the last bit only after round-off has settled
        assert len(run.transitions) >= len(expected), label
    else:
        assert len(run.transitions) == len(expected), label
    if end != "many":
        assert run.stop.reason in ({"until", "left_domain"} if end == "left_domain" else {end}), (run.stop, label)


@pytest.mark.parametrize("block", range(6))
def test_random_models_follow_the_exact_execution(block: int) -> None:
    for seed in range(5 * block, 5 * block + 5):
        check(seed)


@pytest.mark.parametrize(
    "block", [pytest.param(k, marks=pytest.mark.campaign if k > 2 else pytest.mark.slow) for k in range(12)]
)
def test_many_random_models_follow_the_exact_execution(block: int) -> None:
    for seed in range(1000 + 20 * block, 1020 + 20 * block):
        check(seed)
