"""Units whose inputs the importing tool drives make the transitions of runs with the same inputs, whatever its habits."""

from __future__ import annotations

import math
import random
from bisect import bisect_left, bisect_right
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hsdsl
from hsdsl.export import files_of, source_of

fmpy = pytest.importorskip("fmpy", reason="FMPy is not installed: pip install 'hsdsl[export]'")
from export.importers import ENDS, EVENTS, Habit, Importer, Signal  # noqa: E402

pytestmark = pytest.mark.exports

UNTIL = 2.9
# each counts its transitions in n
MODELS = {
    "ball in wind": """
modes:
  fly: {flow: {h: v, v: u - 9.81, n: 0}, transitions: [{when: h <= 0, to: fly, reset: {v: -0.8*v, n: n + 1}}]}
initial: {mode: fly, h: 2, v: 0, n: 0}
""",
    "oscillator with a stop": """
modes:
  a: {flow: {x: v, v: 20*u - 0.1*v - 6.25*x, n: 0}, transitions: [{when: x >= 1, to: a, reset: {v: -0.9*v, n: n + 1}}]}
initial: {mode: a, x: 0, v: 1, n: 0}
""",
    "ball on a moving table": """
modes:
  fly: {flow: {h: v, v: -9.81, n: 0}, transitions: [{when: h <= 0.1*u, to: fly, reset: {v: 1 - 0.8*v, n: n + 1}}]}
initial: {mode: fly, h: 1, v: 0, n: 0}
""",
    "thermostat": """
modes:
  on: {flow: {x: 3 - x + u, n: 0}, transitions: [{when: x >= 2 + u/2, to: off, reset: {n: n + 1}}]}
  off: {flow: {x: u - x, n: 0}, transitions: [{when: x <= 1 + u/2, to: on, reset: {n: n + 1}}]}
initial: {mode: on, x: 0, n: 0}
""",
    "pulse width": """
modes:
  high: {flow: {c: 1, y: 1 - y, n: 0}, transitions: [{when: c >= 0.1*(2 + u), to: low, reset: {n: n + 1}}]}
  low: {flow: {c: 1, y: -y, n: 0}, transitions: [{when: c >= 0.31, to: high, reset: {c: 0, n: n + 1}}]}
initial: {mode: high, c: 0, y: 0, n: 0}
""",
    "levels of the input alone": """
modes:
  low: {flow: {x: -x, n: 0}, transitions: [{when: u >= 0.55, to: high, reset: {n: n + 1}}]}
  high: {flow: {x: 1 - x, n: 0}, transitions: [{when: u <= -0.35, to: low, reset: {n: n + 1}}]}
initial: {mode: low, x: 0, n: 0}
""",
    "thresholds that resets move": """
modes:
  a: {flow: {x: 0, y: u, n: 0}, transitions: [{when: u >= x, to: a, reset: {x: x + 0.3, n: n + 1}}]}
initial: {mode: a, x: 0.15, y: 0, n: 0}
""",
    "event": """
modes:
  a: {flow: {x: u - x, n: 0}, transitions: [{event: x >= 0.3, reset: {n: n + 1}}]}
initial: {mode: a, x: 0, n: 0}
""",
    "condition of a state": """
modes:
  a: {flow: {x: v, v: 4*u - 9*x, n: 0}, transitions: [{when: x >= 0.5, if: v > 0.5, to: a, reset: {v: -v, n: n + 1}}]}
initial: {mode: a, x: 0, v: 3, n: 0}
""",
}
LEVELS, STEPS = (0.2, 0.9, -0.7, 0.6), (0.7, 1.3, 2.1)


def stepped(times: tuple[float, ...], levels: tuple[float, ...]) -> Signal:
    return lambda t, behind: levels[(bisect_right if behind else bisect_left)(times, t)]


# what the run has for the input, the same for the importing tool, and where it jumps
INPUTS: dict[str, tuple[str, Signal, tuple[float, ...]]] = {
    "constant": ("0.4", lambda t, behind: 0.4, ()),
    "smooth": ("sin(3*t)", lambda t, behind: math.sin(3 * t), ()),
    "stepped": (f"{{times: [0, 0.7, 1.3, 2.1], values: {list(LEVELS)}, hold: zero}}", stepped(STEPS, LEVELS), STEPS),
}
# with how far a transition may be off; only a tool that sets inputs at every evaluation sees the whole of a smooth one
HABITS = {
    "at every evaluation": (Habit(), 1e-6),
    "in event mode": (Habit(sets=EVENTS), 0.02),
    "at ends of steps": (Habit(sets=ENDS, completes=True), 0.02),
    "Euler": (Habit(euler=True, locates=False, step=1e-3), 0.02),
    "Euler, at ends of steps": (Habit(sets=ENDS, euler=True, locates=False, step=1e-3), 0.02),
    "jumps as if they were smooth": (Habit(jumps=False), 0.02),
    "Euler, jumps as if they were smooth": (Habit(jumps=False, euler=True, locates=False, step=1e-3), 0.02),
}


def text_of(body: str, given: str, until: float = UNTIL) -> str:
    return f"hsdsl: 1\ninputs: {{u: {given}}}\n{body}experiment: {{until: {until}, scheme: located, tolerance: 1e-10}}\n"


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    """Units by text and version, each made once; the file's own input is zero."""
    known: dict[Any, str] = {}

    def make(text: str, version: int) -> str:
        if (text, version) not in known:
            ((name, content),) = files_of(source_of(hsdsl.loads(text), {}), f"fmi{version}").items()
            path = tmp_path_factory.mktemp("unit") / name
            path.write_bytes(content)
            known[text, version] = str(path)
        return known[text, version]

    yield make


def transitions_of(text: str) -> list[float]:
    """When a run counts."""
    run = hsdsl.loads(text).simulate()
    times = [made.time for made in run.transitions if "re-arms" not in made.edge]
    assert len(times) == run.final.state["n"]
    return times


@pytest.mark.parametrize(
    ("name", "version"),
    [
        pytest.param(name, version, marks=[] if k % 2 == i and k < 5 else pytest.mark.slow)
        for k, name in enumerate(MODELS)
        for i, version in enumerate((2, 3))  # one version of each in turn
    ],
)
@pytest.mark.parametrize("given", INPUTS)
def test_driven_units_make_the_transitions_of_runs(name: str, version: int, given: str, made: Any) -> None:
    body, (text, signal, jumps) = MODELS[name], INPUTS[given]
    exact = transitions_of(text_of(body, text))
    for label, (habit, error) in HABITS.items():
        tool = Importer(made(text_of(body, "0"), version), {"u": signal}, habit, jumps)
        tool.go_to(UNTIL)
        counts = [round(row[len(row) // 2 + place] - row[place]) for _, row in tool.rows for place in [tool.place("n")]]
        times = [time for (time, _), count in zip(tool.rows, counts, strict=True) for _ in range(count)]
        close = 1e-6 if not jumps and error < 1 and label.startswith("jumps") else error
        assert times == pytest.approx([time for time in exact if time > 0], abs=close), label
        assert tool.value("n") == len(exact)
