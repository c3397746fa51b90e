"""Ten families of random scenes: a model with parameters, draws of them, and what is right for each draw."""

from __future__ import annotations

import math
import random
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from campaign.reference import Edge, Mode, Outcome, execute

Values = dict[str, float]


@dataclass(frozen=True)
class Family:
    """A model's text, how its parameters are drawn, and the right outcome of a draw.

    ``ordinary`` says whether the verdict on its runs should be `holds`.
    """

    text: str
    draw: Callable[[random.Random], Values]
    right: Callable[[Values], Outcome]
    ordinary: bool = True


def _yaml(modes: dict[str, Mode], start: tuple[str, dict[str, str]], values: str, until: str, extra: str = "") -> str:
    lines = ["hsdsl: 1", f"parameters: {{{values}}}", *([extra] if extra else []), "modes:"]
    for name, mode in modes.items():
        flow = ", ".join(f'{state}: "{text}"' for state, text in mode.flow.items())
        lines += [f"  {name}:", f"    flow: {{{flow}}}"]
        if mode.walls:
            lines.append(f"    domain: [{', '.join(repr(w + ' <= 0') for w in mode.walls)}]")
        lines.append(f"    transitions: {'' if mode.edges else '[]'}")
        for edge in mode.edges:
            reset = ", ".join(f'{state}: "{text}"' for state, text in edge.reset.items())
            condition = "" if edge.condition == "True" else f', if: "{edge.condition}"'
            lines.append(
                f'      - {{name: {edge.name}, when: "{edge.when} >= 0", to: {edge.to}{condition}, reset: {{{reset}}}}}'
            )
    states = ", ".join(f"{state}: {text}" for state, text in start[1].items())
    lines += [f"initial: {{mode: {start[0]}, {states}}}", f"experiment: {{until: {until}}}"]
    return "\n".join(lines) + "\n"


def _integrated(
    modes: dict[str, Mode],
    start: tuple[str, dict[str, str]],
    names: dict[str, tuple[float, float]],
    until: float,
    fixed: dict[str, Any] | None = None,
    cuts: tuple[float, ...] = (),
    extra: str = "",
) -> Family:
    """A family whose right outcome is integrated: parameters drawn between bounds."""

    def draw(r: random.Random) -> Values:
        return {name: round(r.uniform(*bounds), 4) for name, bounds in names.items()}

    def right(values: Values) -> Outcome:
        state = {name: float(eval(text, dict(values))) for name, text in start[1].items()}
        return execute(modes, (start[0], state), until, {**values, **(fixed or {})}, cuts)

    middle = ", ".join(f"{name}: {(a + b) / 2}" for name, (a, b) in names.items())
    return Family(_yaml(modes, start, middle, str(until), extra), draw, right)


STOP = {"v": "-c*v"}
PENDULUM = Mode({"q": "v", "v": "-sin(q) - d*v + a*cos(w*t)"}, (Edge("hit", "q - s", "m", STOP),))
DUFFING = Mode({"q": "v", "v": "q - q**3 - d*v + a*cos(w*t)"}, (Edge("hit", "q - s", "m", STOP),))
VAN_DER_POL = Mode({"q": "v", "v": "d*(1 - q**2)*v - q"}, (Edge("hit", "q - s", "m", STOP),))
BOUNDS = {"a": (0.2, 1.0), "c": (0.4, 0.9), "d": (0.05, 0.4), "w": (0.7, 1.6), "s": (0.4, 1.1), "q0": (-0.5, 0.2)}
MASSES = Mode(
    {"x": "u", "y": "v", "z": "w", "u": "k*(y - 2*x)", "v": "k*(x - 2*y + z) - b*y**3", "w": "k*(y - 2*z)"},
    (Edge("left", "-x - s", "m", {"u": "-c*u"}), Edge("right", "z - s", "m", {"w": "-c*w"})),
)
SWITCHED = {
    "m": Mode({"x": "v", "v": "-k*x", "s": "1"}, (Edge("go", "x - a", "n", {"s": "0"}, "s >= b"),)),
    "n": Mode({"x": "v", "v": "-k*x - v/4", "s": "1"}, (Edge("back", "-x - a/2", "m", {"v": "1 + v/2"}, "s <= e"),)),
}
WALLED = Mode(
    {"x": "1 - b*y", "y": "x - y/4"}, (Edge("turn", "x - a", "m", {"x": "-x/2"}),), ("y - e", "-x - 3"),
)  # fmt: skip
MOVING = Mode({"h": "v", "v": "-g"}, (Edge("hit", "a*sin(w*t) - h", "m", {"v": "-c*v + (1 + c)*a*w*cos(w*t)"}),))
HEATED = {
    "m": Mode({"T": "p*u(t) - l*T"}, (Edge("hot", "T - s", "n"),)),
    "n": Mode({"T": "-l*T"}, (Edge("cold", "s - e - T", "m"),)),
}
TIMES, LEVELS = (0.0, 1.3, 2.9, 4.2, 6.6), (1.0, 0.2, 1.4, 0.6, 1.1)


def held(t: float) -> float:
    """The sampled input: its last sample."""
    return LEVELS[max(k for k, start in enumerate(TIMES) if t >= start)]


def _tangency() -> Family:
    modes = {"m": Mode({"x": "v", "v": "-g"}, (Edge("touch", "x - h", "n"),)), "n": Mode({"x": "v", "v": "-g"})}

    def draw(r: random.Random) -> Values:
        g, v = r.uniform(0.5, 20), r.uniform(0.5, 20)
        return {"g": g, "v0": v, "h": v * v / (2 * g) * (1 + r.choice((-1, 1)) * 10 ** r.uniform(-12, -3))}

    def right(values: Values) -> Outcome:
        from fractions import Fraction

        g, v, h = (Fraction(values[k]) for k in ("g", "v0", "h"))
        inside = v * v - 2 * g * h
        if inside <= 0:
            return Outcome((), (), "until")
        return Outcome(("touch",), (float((v - Fraction(math.sqrt(inside))) / g),), "until")

    text = _yaml(modes, ("m", {"x": "0", "v": "v0"}), "g: 1, v0: 1, h: 0.25", "3*v0/g")
    return Family(text, draw, right, ordinary=False)


def _narrow() -> Family:
    modes = {"m": Mode({"s": "b"}, (Edge("in", "exp(-((s - c)/w)**2) - 1/2", "n"),)), "n": Mode({"s": "b"})}

    def draw(r: random.Random) -> Values:
        return {"b": r.uniform(0.3, 3), "c": r.uniform(1, 9), "w": 10 ** r.uniform(-5, 0)}

    def right(values: Values) -> Outcome:
        first = values["c"] - values["w"] * math.sqrt(math.log(2))
        within = 0 < first < 10 * values["b"]
        return Outcome(("in",) * within, (first / values["b"],) * within, "until")

    text = _yaml(modes, ("m", {"s": "0"}), "b: 1, c: 5, w: 0.1", "10")
    return Family(text, draw, right, ordinary=False)


def _fast() -> Family:
    modes = {
        "m": Mode({"x": "v", "v": "-x"}, (Edge("up", "sin(w*t + p) - a", "n"),)),
        "n": Mode({"x": "v", "v": "-x"}, (Edge("down", "a - sin(w*t + p)", "m"),)),
    }

    def draw(r: random.Random) -> Values:
        return {"w": 10 ** r.uniform(0, 2.5), "a": r.uniform(-0.9, 0.9), "p": r.uniform(-3, 3)}

    def right(values: Values) -> Outcome:
        w, p, rise = values["w"], values["p"], math.asin(values["a"])
        turns = [
            (n * 2 * math.pi + at, name)
            for n in range(-1, int(w) + 2)
            for at, name in ((rise, "up"), (math.pi - rise, "down"))
        ]
        made = sorted(((at - p) / w, name) for at, name in turns if 0 < at - p < 5 * w)
        if math.sin(p) > values["a"]:
            made = [(0.0, "up"), *made]
        return Outcome(tuple(name for _, name in made), tuple(t for t, _ in made), "until")

    text = _yaml(modes, ("m", {"x": "1", "v": "0"}), "w: 3, a: 0.5, p: 0", "5")
    return Family(text, draw, right, ordinary=False)


def _units() -> Family:
    """An impact oscillator whose lengths and times are multiplied by powers of ten."""
    modes = {
        "m": Mode({"x": "v", "v": "-(x/T**2) - d/T*v + a*L/T**2*cos(w*t/T)"}, (Edge("hit", "x - s*L", "m", STOP),))
    }
    plain = {"m": Mode({"x": "v", "v": "-x - d*v + a*cos(w*t)"}, (Edge("hit", "x - s", "m", STOP),))}

    def draw(r: random.Random) -> Values:
        drawn = {name: round(r.uniform(*BOUNDS[name]), 4) for name in ("a", "c", "d", "w", "s")}
        return drawn | {"L": 10.0 ** r.randint(-12, 12), "T": 10.0 ** r.randint(-12, 12)}

    def right(values: Values) -> Outcome:
        found = execute(plain, ("m", {"x": 0.0, "v": 1.0}), 15.0, values)
        return Outcome(found.edges, tuple(t * values["T"] for t in found.times), found.stop)

    text = _yaml(modes, ("m", {"x": "0", "v": "L/T"}), "a: 1, c: 1/2, d: 0.1, w: 1, s: 0.7, L: 1, T: 1", "15*T")
    return Family(text, draw, right)


def _sampled() -> str:
    return f"inputs:\n  u: {{times: {list(TIMES)}, values: {list(LEVELS)}, hold: zero}}"


def _heated() -> Family:
    family = _integrated(
        HEATED, ("m", {"T": "1/2"}), {"p": (2, 6), "l": (0.6, 1.5), "s": (1.2, 2.2), "e": (0.2, 0.6)}, 8.0,
        {"u": held}, TIMES[1:], _sampled(),
    )  # fmt: skip
    return Family(family.text.replace("u(t)", "u"), family.draw, family.right)


WITH_START = {"q": "q0", "v": "0"}
FAMILIES: dict[str, Family] = {
    "pendulum": _integrated({"m": PENDULUM}, ("m", WITH_START), BOUNDS, 12.0),
    "duffing": _integrated({"m": DUFFING}, ("m", WITH_START), BOUNDS, 10.0),
    "van der pol": _integrated({"m": VAN_DER_POL}, ("m", {"q": "q0", "v": "1"}), BOUNDS, 10.0),
    "masses": _integrated(
        {"m": MASSES}, ("m", {"x": "0", "y": "y0", "z": "0", "u": "0", "v": "0", "w": "0"}),
        {"k": (0.5, 3), "b": (0, 1), "s": (0.2, 0.6), "c": (0.4, 0.9), "y0": (0.4, 1.2)}, 10.0,
    ),
    "if": _integrated(
        SWITCHED, ("m", {"x": "0", "v": "1", "s": "0"}),
        {"k": (1, 4), "a": (0.1, 0.4), "b": (0.5, 2), "e": (1, 4)}, 12.0,
    ),
    "walls": _integrated(
        {"m": WALLED}, ("m", {"x": "0", "y": "0"}), {"a": (0.6, 1.4), "b": (0.3, 1.2), "e": (0.9, 2.5)}, 12.0
    ),
    "moving guards": _integrated(
        {"m": MOVING}, ("m", {"h": "h0", "v": "0"}),
        {"g": (1, 10), "a": (0.02, 0.1), "w": (1, 6), "c": (0.5, 0.8), "h0": (0.8, 2)}, 1.6,
    ),
    "inputs with jumps": _heated(),
    "tangency": _tangency(),
    "narrow visits": _narrow(),
    "fast guards": _fast(),
    "units": _units(),
}  # fmt: skip
