"""A state at rest is to everything else a state that does not move: random guards of time and inputs (M11)."""

from __future__ import annotations

import random
from typing import Any

import pytest

from hsdsl.interface.model import Model
from hsdsl.language.elaborate import elaborate

HIT = "{name: hit, when: x <= 0, to: a, reset: {v: -v/2}}"
METHODS: list[dict[str, Any]] = [
    {}, {"method": "dopri5"}, {"method": "dop853"}, {"method": "radau"}, {"method": "rk4", "step": 0.1},
]  # fmt: skip


def number(rng: random.Random, most: float = 2) -> str:
    return f"{rng.uniform(-most, most):.3f}"


def guard(rng: random.Random) -> str:
    kinds = ("{a}*(t - {c})", "{a} + sin({c} + 2*t)", "u + {a}", "{a}*t + {b}*u + {c}", "(t - 4 - {a})*(t - 4 - {b})",
             "w + {a}*t", "x + v + {a}*cos(t)", "floor(t/3) - 1.5")  # fmt: skip
    left = rng.choice(kinds).format(a=number(rng), b=number(rng), c=number(rng, 8))
    return f"{left} {rng.choice(('>=', '<='))} {number(rng, 1)}"


def edges(rng: random.Random) -> str:
    found = ""
    for k in range(rng.randint(1, 3)):
        given = f", if: '{guard(rng)}'" if rng.random() < 0.6 else ""
        found += f", {{name: e{k}, when: '{guard(rng)}'{given}, to: z}}"
    return found


def text(flow: str, transitions: str, seed: int) -> str:
    rng = random.Random(seed)
    values = [[number(rng) for _ in range(5)] for _ in range(2)]
    return f"""hsdsl: 1
inputs:
  u: {{times: [1, 2.5, 4, 6, 7], values: [{", ".join(values[0])}], hold: linear}}
  w: {{times: [0, 3, 5, 6, 7.5], values: [{", ".join(values[1])}], hold: zero}}
modes:
  a: {{flow: {flow}, transitions: [{transitions}{edges(rng)}]}}
  z: {{flow: {{x: 0, v: 0}}}}
initial: {{mode: a, x: 0, v: 0}}
experiment: {{until: 9}}
"""


def made(model: str, arguments: Any) -> list[tuple[str, float, bool]]:
    run = Model(elaborate("random.yaml", text=model.encode())).simulate(engine="python", scheme="located", **arguments)
    assert run.stop.reason == "until", run.stop
    return [(t.edge, round(t.time, 9), t.entry) for t in run.transitions]


def check(seeds: range) -> int:
    count = 0
    for seed in seeds:
        # the edge that never fires keeps the names and the order of the others
        frozen = text("{x: 0, v: 0}", HIT.replace("x <= 0", "x <= -1"), seed)
        for arguments in METHODS:
            expected = made(frozen, arguments)
            assert made(text("{x: v, v: -9.81}", HIT, seed), arguments) == expected, (seed, arguments)
            count += bool(expected) and not expected[0][2]
    return count


def test_guards_of_time_and_inputs_fire_while_a_state_rests() -> None:
    assert check(range(12)) > 12


@pytest.mark.campaign
def test_many_guards_fire_while_a_state_rests() -> None:
    assert check(range(100, 500)) > 400
