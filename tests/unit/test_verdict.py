"""The verdict: what is found about the theorem's hypotheses, on scenes whose answer is known by hand."""

import textwrap
from pathlib import Path

import pytest

import hsdsl

MODELS = Path(__file__).parents[2] / "models"
# A mass thrown up from 0 at speed v turns at v**2/2 after v seconds; a clock s beside it.
THROW = """
hsdsl: 1
modes:
  up:
    flow: {{x: v, v: -1, s: 1}}
    transitions:
      - {{name: touch, when: x >= {height}, {condition}to: done, reset: {{v: -v}}}}
  done: {{flow: {{x: v, v: -1, s: 1}}}}
initial: {{mode: up, x: 0, v: 1, s: 0}}
experiment: {{until: {until}, scheme: {scheme}, method: dopri5, {size}}}
"""
# Two guards on clocks that start a gap apart, with resets that shift z and double it.
PAIR = """
hsdsl: 1
modes:
  both:
    flow: {{a: 1, b: 1, z: 0}}
    transitions:
      - {{name: shift, when: a >= 1, to: no_shift, reset: {{z: {shift}}}}}
      - {{name: double, when: b >= 1, to: no_double, reset: {{z: {double}}}}}
  no_shift:
    flow: {{a: 1, b: 1, z: 0}}
    transitions: [{{name: late_double, when: b >= 1, to: end, reset: {{z: {double}}}}}]
  no_double:
    flow: {{a: 1, b: 1, z: 0}}
    transitions: [{{name: late_shift, when: a >= 1, to: end, reset: {{z: {shift}}}}}]
  end: {{flow: {{a: 1, b: 1, z: 0}}}}
initial: {{mode: both, a: 0, b: {start}, z: 1}}
experiment: {{until: 2, scheme: {scheme}, method: dopri5, tolerance: 1e-9}}
"""
SIGN = """
hsdsl: 1
modes: {{m: {{flow: {{x: {flow}}}}}}}
initial: {{mode: m, x: 1}}
experiment: {{until: 1, method: dopri5, tolerance: 1e-9, scheme: {scheme}}}
"""
BALL = """
hsdsl: 1
modes: {{fly: {{flow: {{h: v, v: -10}}, transitions: [{{name: bounce, when: h <= 0, to: fly, reset: {{v: -v/2}}}}]}}}}
initial: {{mode: fly, h: 5, v: 0}}
experiment: {{until: {until}, method: dopri5, tolerance: 1e-9, relaxation: 1e-7, scheme: {scheme}}}
"""
WALL = """
hsdsl: 1
modes: {{m: {{flow: {{x: 1}}, domain: [x <= 1]}}}}
initial: {{mode: m, x: 0}}
experiment: {{until: 2, method: dopri5, tolerance: 1e-9, scheme: {scheme}}}
"""
EARLY, LATE = "1 - sqrt(0.5) - 1e-9", "1 - sqrt(0.5) + 1e-10"  # before and after the crossing of x = 0.25
EASY = {"height": "0.25", "until": "2", "size": "tolerance: 1e-9", "condition": ""}
COMMUTING = {"shift": "z + 1", "double": "z + 2", "start": "0"}
CASES = [
    ("transversal", THROW, EASY, "holds", "1 transition, the surfaces rising at a rate of at least 0.7071"),
    ("missed by far", THROW, EASY | {"height": "0.6"}, "holds", "the nearest miss is of touch at t = 1, by"),
    ("missed by less than the error", THROW, EASY | {"height": "0.5 + 1e-12"}, "unknown", "turns back close to"),
    ("touched at the top", THROW, EASY | {"height": "0.5"}, ("unknown", "left"), "touch"),
    ("nearly tangential", THROW, EASY | {"height": "0.5 - 1e-10"}, "unknown", "touch"),
    ("just before the end", THROW, EASY | {"until": "1 - sqrt(0.5) + 1e-11"}, "unknown", "within the error of the end"),
    ("just behind the end", THROW, EASY | {"until": "1 - sqrt(0.5) - 1e-11"}, "unknown", "within the error of the end"),
    ("condition clear", THROW, EASY | {"condition": "if: s <= 0.5, "}, "holds", "1 transition"),
    ("condition clear and false", THROW, EASY | {"condition": "if: s <= 0.1, "}, "holds", "no transition"),
    ("condition near", THROW, EASY | {"condition": f"if: s <= {LATE}, "}, "unknown", "whether the condition"),
    ("condition near, false", THROW, EASY | {"condition": f"if: s <= {EARLY}, "}, "unknown", "whether the condition"),
    ("a fixed step", THROW, EASY | {"size": "step: 1e-2"}, "unknown", "a fixed step does not say"),
    ("together, commuting", PAIR, COMMUTING, "holds", "every order leads to the same point"),
    ("together, not commuting", PAIR, COMMUTING | {"double": "2*z"}, "left", "matters"),
    ("nearly together", PAIR, COMMUTING | {"double": "2*z", "start": "1e-11"}, "unknown", "and it matters"),
    ("nearly together, commuting", PAIR, COMMUTING | {"start": "1e-11"}, "holds", "2 transitions"),
    ("one after the other", PAIR, COMMUTING | {"double": "2*z", "start": "0.1"}, "holds", "2 transitions"),
    ("a flow that jumps", SIGN, {"flow": "sign(x - 2)"}, "unknown", "sign or floor"),
    ("a flow with a kink", SIGN, {"flow": "abs(x - 0.5)"}, "holds", "no transition"),
    ("before a Zeno point", BALL, {"until": "2.4"}, "holds", "transitions"),
    ("past a Zeno point", BALL, {"until": "4"}, "left", "Zeno"),
    ("out of the domain", WALL, {}, "left", "domain of mode m ends"),
]  # fmt: skip


@pytest.mark.parametrize("scheme", ["relaxed", "located"])
@pytest.mark.parametrize(("text", "values", "theorem", "says"), [c[1:] for c in CASES], ids=[c[0] for c in CASES])
def test_verdict(tmp_path, scheme, text, values, theorem, says):
    file = tmp_path / "model.yaml"
    file.write_text(textwrap.dedent(text).format(scheme=scheme, **values))
    verdict = hsdsl.load(file).simulate(relaxation=1e-12 if text is not BALL else None).verdict
    assert verdict.theorem in theorem
    assert any(says in reason for reason in verdict.reasons), verdict
    assert verdict.theorem in ("holds", "unknown", "left")


def test_a_finer_run_decides_where_a_fixed_step_cannot():
    model = hsdsl.load(MODELS / "oscillator-with-stop-1.yaml")
    run = model.simulate(until=20, step="1e-3", relaxation=1e-7, method="midpoint")
    assert run.verdict.theorem == "unknown"
    assert 1e-5 < model.estimate(run).largest["x"] < 1e-2
    assert run.estimated().verdict.theorem == "holds"
    wrong = model.simulate(until=20, step="0.2", relaxation=1e-7, method="euler")
    assert not model.estimate(wrong).same_transitions
    assert wrong.estimated().verdict.theorem == "unknown"
