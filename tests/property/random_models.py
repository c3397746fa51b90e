"""Random models that are not kind: kinks, poles, roots of negative numbers, jumping inputs, guards in time, cycles.

They need not make sense. They are for comparing engines, which must agree on nonsense as well.
"""

from __future__ import annotations

import random
import re

LEAVES = ("x", "y", "t", "u", "w", "a", "1/3", "0.7", "2", "-1")
FUNCTIONS = ("sin", "cos", "tan", "exp", "tanh", "atan", "sqrt", "log", "abs", "sign", "floor", "asin", "acosh")
SETTINGS = (
    {"method": "euler", "step": 0.07},
    {"method": "midpoint", "step": "1/8"},
    {"method": "rk4", "step": 0.11},
    {"method": "dopri5", "step": 0.3},
    {"tolerance": 1e-4},
    {"method": "dop853", "tolerance": 1e-7},
    {"method": "radau", "tolerance": 1e-4},
    {"method": "radau", "step": 0.1},
)

WITHOUT_KINK = {"abs": "sin", "sign": "tanh", "floor": "atan", "min": "atan2", "max": "atan2"}
SMOOTH_SETTINGS = (
    {"method": "taylor", "step": 0.11},
    {"method": "taylor", "tolerance": 1e-5},
    {"method": "taylor", "tolerance": 1e-11},
)


def expression(rng: random.Random, depth: int) -> str:
    """An expression of states x and y, time, inputs u and w and the parameter a."""
    if depth == 0 or rng.random() < 0.2:
        return rng.choice(LEAVES)
    inner = [expression(rng, depth - 1) for _ in range(2)]
    kind = rng.randrange(9)
    if kind < 2:
        return f"{rng.choice(FUNCTIONS)}({inner[0]})"
    if kind == 2:
        return f"({inner[0]})**{rng.choice(('2', '3', '0.5', '-1', '1.5'))}"
    if kind == 3:
        return f"{rng.choice(('min', 'max', 'atan2'))}({inner[0]}, {inner[1]})"
    return f"({inner[0]}) {rng.choice(('+', '-', '*', '*', '/'))} ({inner[1]})"


def _bounded(rng: random.Random, depth: int) -> str:
    text = expression(rng, depth)
    return f"{rng.choice(('2', '1', '0.5'))}*tanh({text}) {rng.choice(('+ 0.3', '- 0.4', '+ 0.1*y', '- 0.2*x', ''))}"


def _guard(rng: random.Random) -> str:
    sides = [
        rng.choice(("x", "y", "x + y", "x - y/2", "x**2 + y**2", "t - x")),
        rng.choice(("0", "1/2", "u", "-1", "a")),
    ]
    if rng.random() < 0.25:
        sides[0] = expression(rng, 2)
    return f"{sides[0]} {rng.choice(('>=', '<='))} {sides[1]}"


def _edge(rng: random.Random, index: int, modes: int) -> list[str]:
    target = "end" if rng.random() < 0.05 else f"m{rng.randrange(modes)}"
    lines = [f"      - name: e{index}", f'        when: "{_guard(rng)}"', f"        to: {target}"]
    if rng.random() < 0.3:
        lines.append(f'        if: "{_guard(rng)} {rng.choice(("and", "or"))} {_guard(rng)}"')
    if rng.random() < 0.6:
        lines.append(
            f'        reset: {{x: "{_bounded(rng, 2)}", y: "{rng.choice(("y", "-0.8*y", _bounded(rng, 1)))}"}}'
        )
    if rng.random() < 0.3:
        lines.append(f"        priority: {rng.randint(-1, 1)}")
    return lines


def random_model(seed: int) -> str:
    """A model's text; equal seeds give equal texts."""
    rng = random.Random(seed)
    modes = rng.randint(1, 3)
    lines = [
        "hsdsl: 1", "parameters: {a: 0.4}", "inputs:",
        "  u: {times: [0, 0.5, 1.3, 2], values: [1, -1, 0.5, 2], hold: zero}",
        "  w: {times: [0.2, 0.9, 1.3], values: [0, 1, -1], hold: linear}",
        "modes:",
    ]  # fmt: skip
    for k in range(modes):
        fields = _bounded(rng, 3), rng.choice((_bounded(rng, 3), expression(rng, 2), "x - y"))
        lines += [f"  m{k}:", f'    flow: {{x: "{fields[0]}", y: "{fields[1]}"}}']
        if rng.random() < 0.3:
            lines.append(f'    domain: ["{_guard(rng)}"]')
        lines.append("    transitions:")
        for i in range(rng.randint(1, 3)):
            lines += _edge(rng, i, modes)
    start = {s: rng.choice(("0", "-1", "0.3", "2", "1/7")) for s in "xy"}
    return "\n".join([
        *lines, "  end: {final: true}", f'outputs: {{q: "{expression(rng, 2)}", r: x + y}}',
        f"initial: {{mode: m0, x: {start['x']}, y: {start['y']}}}", "experiment: {until: 2.5, relaxation: 1e-3}", "",
    ])  # fmt: skip


def smooth_model(seed: int) -> str:
    """The same model with functions that have Taylor series in place of those that have none."""
    return re.sub(r"\b(abs|sign|floor|min|max)\b(?=\()", lambda found: WITHOUT_KINK[found[1]], random_model(seed))
