"""What the located scheme does off the smooth road: strips, kinks, fast surfaces, inputs, tangential restarts."""

from __future__ import annotations

from math import asin, pi, sqrt
from typing import Any

import pytest
from engines import assert_engines_agree, needs_compiler

import hsdsl
from hsdsl.engine.simulate.located_steps import SeriesSteps

METHODS = ["taylor", "dopri5"]


def run(text: str, **more: Any) -> Any:
    return hsdsl.loads("hsdsl: 1\n" + text).simulate(scheme="located", **more)


CHATTER = """
modes:
  a: {flow: {x: 1}, transitions: [{when: x >= 1e-5, to: b}]}
  b: {flow: {x: -1}, transitions: [{when: x <= -1e-5, to: a}]}
initial: {mode: a, x: -1}
experiment: {until: 1.1, relaxation: 1e-3}
"""


@pytest.mark.parametrize("method", METHODS)
def test_strips_open_only_after_sixteen_transitions_within_the_relaxation(method: str) -> None:
    made = run(CHATTER, method=method)
    delays = [t.resumed - t.time for t in made.transitions if t.resumed is not None]
    assert delays[:16] == [0] * 16
    assert delays[16:] == pytest.approx([1e-3] * len(delays[16:]), abs=1e-12)
    assert 97 <= len(delays[16:]) <= 99  # of 1.02 ms with the way between the surfaces, in the last tenth of a second
    assert made.verdict.theorem == "left" and "in a strip" in made.verdict.reasons[0]


KINKED = """
modes:
  a: {flow: {x: v, v: -x}, transitions: [{when: abs(x) >= 0.9, to: b}]}
  b: {flow: {x: v, v: -x}, transitions: [{when: abs(x) <= 0.1, to: c}]}
  c: {flow: {x: v, v: -x}}
initial: {mode: a, x: 0, v: 1}
experiment: {until: 4, tolerance: 1e-12}
"""


@pytest.mark.parametrize("method", METHODS)
def test_kinked_surfaces(method: str) -> None:
    made = run(KINKED, method=method)
    assert [t.time for t in made.transitions] == pytest.approx([asin(0.9), pi - asin(0.1)], abs=1e-10)


def test_a_jumping_surface_is_met_and_named_as_uncertain() -> None:
    text = "modes: {a: {flow: {x: 1}, transitions: [{when: sign(x - 1) >= 0, to: b}]}, b: {flow: {x: 0}}}\n"
    made = run(text + "initial: {mode: a, x: 1/3}\nexperiment: {until: 2}\n", method="dopri5")
    assert [t.time for t in made.transitions] == pytest.approx([2 / 3], abs=1e-9)
    assert "no polynomial fits surface" in made.verdict.reasons[0]


FAST = """
modes:
  a: {flow: {x: 1}, transitions: [{when: sin(200*t) >= 0.999999, to: b}]}
  b: {flow: {x: 1}}
initial: {mode: a, x: 0}
experiment: {until: 1}
"""


@pytest.mark.parametrize("method", METHODS)
def test_a_surface_far_faster_than_the_flow(method: str) -> None:
    """Above for 14 millionths at a time, while the flow alone would allow steps of a tenth."""
    made = run(FAST, method=method)
    assert [t.time for t in made.transitions] == pytest.approx([asin(0.999999) / 200], abs=1e-11)


GRAZE = """
modes:
  a: {flow: {x: 1, y: "-2*(x - 1)"}, transitions: [{when: y >= 1, to: b}]}
  b: {flow: {x: 0, y: 0}}
initial: {mode: a, x: 0, y: 1e-9}
experiment: {until: 3}
"""


@pytest.mark.parametrize("method", METHODS)
def test_a_visit_of_a_billionth_within_one_step(method: str) -> None:
    assert run(GRAZE, method=method).final.state["x"] == pytest.approx(1 - sqrt(1e-9), abs=1e-9)
    below = run(GRAZE.replace("y: 1e-9", "y: -1e-9"), method=method)
    assert below.transitions == () and below.stop.reason == "until"


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize(("push", "fires"), [("t**2", True), ("-t**2", False), ("t - t**2/2", True)])
def test_a_restart_on_the_guard_that_leaves_it_tangentially(push: str, fires: bool, method: str) -> None:
    """From r = 0 with L_f r = 0: outwards it goes at once, inwards never."""
    text = f"modes: {{a: {{flow: {{x: {push}}}, transitions: [{{when: x >= 0, to: b}}]}}, b: {{flow: {{x: 0}}}}}}\n"
    made = run(text + "initial: {mode: a, x: 0}\nexperiment: {until: 1}\n", method=method)
    assert [t.time for t in made.transitions] == ([0] if fires else [])


TWICE = """
modes:
  a: {flow: {x: 1}, transitions: [{when: "(t - 1)*(t - 1.5)*(t - 1.8) >= 0", if: t > 1.7, to: b}]}
  b: {flow: {x: 0}}
initial: {mode: a, x: 0}
experiment: {until: 3}
"""


@pytest.mark.parametrize("method", ["taylor", "rk4"])
def test_a_second_rise_in_one_step_behind_a_shallow_dip(method: str) -> None:
    """Up at 1, where `if` is false, down by less than a hundredth at 1.5, up again at 1.8."""
    made = run(TWICE, method=method, step=3)
    assert [t.time for t in made.transitions] == pytest.approx([1.8], abs=1e-12)
    assert len(made.times) == 4


@needs_compiler
@pytest.mark.parametrize("priority", [0, 1])
def test_a_clock_at_the_end_fires_over_a_state_that_comes_to_rest_there(priority: int) -> None:
    text = f"""modes:
  wait: {{flow: {{y: 1}}, transitions: [{{name: go, when: y >= 1, to: push, reset: {{x: 0}}}}]}}
  push:
    flow: {{x: 1}}
    transitions:
      - {{name: hold, priority: {priority}, when: x >= 0, to: push, reset: {{x: 0}}}}
      - {{name: clock, when: t >= 1.0000000000005, to: slow}}
  slow: {{flow: {{x: -1}}}}
initial: {{mode: wait, y: 0}}
experiment: {{until: 1}}
"""
    made = run(text, method="dopri5", engine="python")
    assert [t.edge for t in made.transitions] == ["go", "clock"]
    assert made.stop.reason == "until"
    assert_engines_agree(hsdsl.loads("hsdsl: 1\n" + text), method="dopri5")


def masses(count: int) -> str:
    """As many masses as given that hit their stops at one instant, each twice in the run."""
    names = [f"{i}" for i in range(count)]
    flow = ", ".join(f"x{i}: v{i}, v{i}: 1" for i in names)
    stops = "".join(f"      - {{when: x{i} >= 1/2, to: move, reset: {{v{i}: -v{i}/2}}}}\n" for i in names)
    start = ", ".join(f"x{i}: 0, v{i}: 0" for i in names)
    return f"modes:\n  move:\n    flow: {{{flow}}}\n    transitions:\n{stops}initial: {{mode: move, {start}}}\n"


def test_transitions_of_one_instant_share_a_step(monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[float] = []
    step = SeriesSteps.next
    monkeypatch.setattr(SeriesSteps, "next", lambda self, *a: made.append(a[0]) or step(self, *a))  # pyright: ignore
    counts: list[int] = []
    for count in (1, 5):
        made.clear()
        found = run(masses(count) + "experiment: {until: 2.1}\n", method="taylor", engine="python")
        counts.append(len(made))
        assert [t.time for t in found.transitions] == pytest.approx([1.0] * count + [2.0] * count, abs=1e-14)
    assert counts[0] == counts[1]
