"""Functions of a file, and initial values that use each other."""

from __future__ import annotations

import math

import pytest

import hsdsl
from hsdsl.base.errors import ModelError, UsageError
from hsdsl.language.elaborate import elaborate

HILL = """hsdsl: 1
functions:
  hill: {of: [x, k], is: x**2/(k**2 + x**2)}
  gain: {of: [x], is: "rate*hill(x, 2)"}
parameters: {rate: 3}
modes:
  cell:
    flow: {x: "1 - %s", y: %s}
    transitions: [{when: "%s >= 1/3", to: cell, reset: {x: "%s"}}]
initial: {mode: cell, x: 0, y: 1}
experiment: {until: 4}
"""
CALLS = ("hill(x, rate)", "gain(x + y) - y", "hill(x, 2)", "gain(1)")
WRITTEN = ("x**2/(rate**2 + x**2)", "rate*((x + y)**2/(2**2 + (x + y)**2)) - y", "x**2/(2**2 + x**2)", "rate*(1/5)")


def test_a_call_is_the_expression_written_out():
    called, written = (elaborate("m.yaml", text=(HILL % texts).encode()) for texts in (CALLS, WRITTEN))
    assert called.modes[0].flow == written.modes[0].flow
    assert called.modes[0].edges[0].reset == written.modes[0].edges[0].reset
    assert called.modes[0].edges[0].surface.residual == written.modes[0].edges[0].surface.residual


def test_functions_are_known_to_overrides():
    model = hsdsl.loads(HILL % CALLS)
    run = model.simulate(until=0, parameters={"rate": "hill(1, 3)"}, initial={"x": "gain(2)"})
    assert run.final.state["x"] == 0.1 / 2
    with pytest.raises(UsageError, match="`hill` takes 2 arguments, not 1"):
        model.simulate(parameters={"rate": "hill(1)"})


def test_many_nested_calls_are_written_out_once():
    """Without memory of what was written out, 2**60 calls."""
    nest = "\n".join(f"  f{i}: {{of: [x], is: f{i + 1}(f{i + 1}(x))}}" for i in range(60))
    text = f"hsdsl: 1\nfunctions:\n{nest}\n  f60: {{of: [x], is: x}}\nmodes: {{m: {{flow: {{x: f0(x)}}}}}}\n"
    made = elaborate("m.yaml", text=(text + "initial: {mode: m, x: 1}\nexperiment: {until: 1}\n").encode())
    assert str(made.modes[0].flow[0]) == "x"


def test_functions_that_grow_without_end_are_refused():
    nest = "\n".join(f"  f{i}: {{of: [x], is: f{i + 1}(x) + sin(f{i + 1}(x + {i}))}}" for i in range(60))
    text = f"hsdsl: 1\nfunctions:\n{nest}\n  f60: {{of: [x], is: x}}\nmodes: {{m: {{flow: {{x: f0(x)}}}}}}\n"
    with pytest.raises(ModelError) as raised:
        elaborate("m.yaml", text=(text + "initial: {mode: m, x: 1}\nexperiment: {until: 1}\n").encode())
    assert [d.code for d in raised.value.diagnostics] == ["HS120"]


START = """hsdsl: 1
parameters: {a: 2}
modes:
  m:
    flow: {x: -x, y: x, z: y - z}
initial: {mode: m, x: y**2 + a, z: x*y, y: a}
experiment: {until: 1}
"""


@pytest.fixture
def start():
    return hsdsl.loads(START)


FOLLOWING = [
    ({}, (6, 2, 12)),
    ({"y": 3}, (11, 3, 33)),
    ({"y": "a + 1"}, (11, 3, 33)),
    ({"x": 1}, (1, 2, 2)),
    ({"x": 1, "z": "a/4"}, (1, 2, 0.5)),
]


@pytest.mark.parametrize(("given", "expected"), FOLLOWING)
def test_values_follow_those_that_are_given(start, given, expected):
    assert tuple(start.simulate(until=0, initial=given).final.state.values()) == expected


def test_values_follow_in_ensembles(start):
    runs = start.ensemble(initial={"y": [1.0, 2.0, 3.0]}, until=0)
    assert [list(runs.state[name]) for name in "xz"] == [[3, 6, 11], [3, 12, 33]]


@pytest.mark.parametrize("given", [{}, {"y": 3}, {"y": "a + 1"}])
def test_derivatives_go_through_initial_values(start, given):
    """With x = X e^-t and y = Y + X - x, z' + z = y gives z(1) = Z/e + (Y + X) (1 - 1/e) - X/e."""
    found = start.sensitivity(["initial.y", "a"], initial=given).final.state["z"]
    y, e = 3 if given else 2, math.exp(-1)
    for name, dy, by_a in (("initial.y", 1, 0), ("a", 0 if given.get("y") == 3 else 1, 1)):
        dx = 2 * y * dy + by_a
        dz = dx * y + (y**2 + 2) * dy
        assert found[name] == pytest.approx(dz * e + (dy + dx) * (1 - e) - dx * e, rel=1e-9)


SINCE = """hsdsl: 1
modes:
  on:
    flow: {x: "exp(-since)"}
    transitions: [{when: since >= 1/3, to: off}]
  off:
    flow: {x: 0}
    transitions: [{when: t >= 1, to: on}]
initial: {mode: on, x: 0}
experiment: {until: 3/2}
"""


def test_time_in_a_mode_is_a_state_of_the_modes_that_use_it():
    made = elaborate("m.yaml", text=SINCE.encode())
    assert [mode.states for mode in made.modes] == [("x", "since"), ("x",)]
    assert [edge.target_states for mode in made.modes for edge in mode.edges] == [("x",), ("x", "since")]
    plain = elaborate("m.yaml", text=SINCE.replace("since", "t").encode())
    assert plain.states == ("x",)


def test_a_name_of_the_file_goes_before_the_timer():
    text = SINCE.replace("modes:", "parameters: {since: 2}\nmodes:", 1)
    assert elaborate("m.yaml", text=text.encode()).states == ("x",)


def test_derivatives_through_a_dwell():
    """The mode is left when since = rest, entered at 0: x = 1 - exp(-rest) then."""
    text = SINCE.replace("1/3", "rest").replace("modes:", "parameters: {rest: 1/3}\nmodes:")
    found = hsdsl.loads(text).sensitivity("rest", until="3/4").final.state["x"]
    assert found["rest"] == pytest.approx(math.exp(-1 / 3), rel=1e-9)


def test_completions_as_text_refuse_the_timer():
    mode = "{flow: {h: v, v: -1}, transitions: [{when: h <= 0, to: m, reset: {v: -v/2}}], outputs: {s: since}}"
    text = f"hsdsl: 1\nmodes: {{m: {mode}}}\ninitial: {{mode: m, h: 1, v: 0}}\nexperiment: {{until: 9}}\n"
    with pytest.raises(UsageError, match="`since` or events cannot be written with its completions"):
        hsdsl.loads(text).completed()
