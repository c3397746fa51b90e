"""One scene in other units makes the same run: to the last bit where the units differ by powers of two."""

from __future__ import annotations

import numpy as np
import pytest

import hsdsl

HEAD = "hsdsl: 1\nparameters: {{T: {T}, X: {X}, W: {W}}}\nmodes:\n{modes}initial: {{{initial}}}\n"
SCENES = {  # modes, start, until: T is the unit of time, X that of x, W that of v; y has none
    "an oscillator, driven from rest at zero, with a stop and a clock": (
        """\
  free:
    flow: {x: X/T*(v/W), v: W/T*(20*cos(2.5*t/T) - 0.1*(v/W) - 6.25*(x/X))}
    transitions:
      - {when: x/X >= 1.5, to: free, reset: {v: -0.9*v}}
      - {when: sin(3*t/T) <= -0.5, to: other, reset: {y: x/X}}
  other:
    flow: {x: X/T*(v/W), v: W/T*(-10*(v/W) - 6.25*(x/X)), y: (x/X - y)/T}
    transitions: [{when: sin(3*t/T) >= 0.25, to: free}]
""",
        "mode: free, x: 0, v: 3*W",
        6,
    ),
    "a ball that comes to rest": (
        """\
  air:
    flow: {x: X/T*(v/W), v: -W/T}
    transitions: [{when: x <= 0, to: air, reset: {v: -0.7*v}}]
""",
        "mode: air, x: X, v: 0",
        20,
    ),
    "a relaxation oscillator with something stiff": (
        """\
  up: {flow: {x: (X - x)/T, v: -200/T*(v - W*cos(t/T))}, transitions: [{when: x >= 0.75*X, to: down}]}
  down: {flow: {x: -x/T, v: -200/T*(v - W*cos(t/T))}, transitions: [{when: x <= 0.25*X, to: up}]}
""",
        "mode: up, x: 0, v: 0",
        6,
    ),
    "a mass that hangs at rest, its speed no more than round-off": (
        """\
  hang: {flow: {x: X/T*(v/W), v: W/T*(0.7 - 0.1*(x/X)*9.81)}, transitions: [{when: sin(t/T) >= 0.5, to: pulled}]}
  pulled: {flow: {x: X/T*(v/W), v: W/T*(0.8 - 0.1*(x/X)*9.81)}, transitions: [{when: sin(t/T) <= 0.4, to: hang}]}
""",
        "mode: hang, x: 0.7/0.981*X, v: 0",
        10,
    ),
}
UNITS = [(-40, 0, 0), (40, 0, 0), (0, -40, 0), (0, 40, 0), (0, 0, -37), (-30, 12, -9), (21, -17, 40)]  # exponents of 2
METHODS = ("taylor", "dopri5", "dop853", "radau")
FACTORS = {"x": 1, "v": 2, "y": None}


def in_units(name: str, factors: tuple[float, float, float], **given: object) -> hsdsl.Execution:
    modes, initial, until = SCENES[name]
    numbers = dict(zip("TXW", map(repr, factors), strict=True))
    text = HEAD.replace("{modes}", modes.replace("{", "{{").replace("}", "}}")).format(initial=initial, **numbers)
    return hsdsl.loads(f"{text}experiment: {{until: {until}*T}}\n").simulate(**given)


def assert_scaled(one: hsdsl.Execution, other: hsdsl.Execution, factors: tuple[float, float, float]) -> None:
    """Whether ``other`` is ``one`` in other units, bit by bit."""
    assert [t.edge for t in one.transitions] == [t.edge for t in other.transitions]
    assert (one.stop.reason, one.times.shape) == (other.stop.reason, other.times.shape)
    assert np.array_equal(one.times * factors[0], other.times)
    for arc in one.arcs:
        for i, state in enumerate(arc.states):
            by = FACTORS[state]
            rows = slice(arc.first, arc.last + 1)
            assert np.array_equal(one.values[rows, i] * (1 if by is None else factors[by]), other.values[rows, i])


def powers(exponents: tuple[int, int, int]) -> tuple[float, float, float]:
    t, x, w = exponents
    return 2.0**t, 2.0**x, 2.0**w


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("name", SCENES)
def test_located_runs_do_not_know_units(name: str, method: str) -> None:
    one = in_units(name, (1.0, 1.0, 1.0), method=method, relaxation=2.0**-20)
    for exponents in UNITS:
        factors = powers(exponents)
        other = in_units(name, factors, method=method, relaxation=2.0**-20 * factors[0])
        assert_scaled(one, other, factors)
    assert one.transitions


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("name", list(SCENES)[1:])
def test_relaxed_runs_do_not_know_units_that_the_relaxation_has(name: str, method: str) -> None:
    one = in_units(name, (1.0, 1.0, 1.0), scheme="relaxed", method=method, relaxation=2.0**-10)
    for exponent in (-20, 5, 20):
        factors = powers((exponent, exponent, exponent))
        given = {"scheme": "relaxed", "method": method, "relaxation": 2.0**-10 * factors[0]}
        assert_scaled(one, in_units(name, factors, **given), factors)


@pytest.mark.parametrize("name", SCENES)
def test_the_python_loop_does_not_either(name: str) -> None:
    given = {"engine": "python", "tolerance": 1e-6}
    one = in_units(name, (1.0, 1.0, 1.0), relaxation=2.0**-20, **given)
    factors = powers((21, -17, 33))
    assert_scaled(one, in_units(name, factors, relaxation=2.0, **given), factors)


@pytest.mark.parametrize("name", SCENES)
@pytest.mark.parametrize("factors", [(1e-9, 1.0, 1e9), (1e12, 1e-12, 1e-12), (1.0, 1e12, 1e12), (1e-12, 1e5, 1e-9)])
def test_any_units_by_default_settings(name: str, factors: tuple[float, float, float]) -> None:
    one, other = in_units(name, (1.0, 1.0, 1.0)), in_units(name, factors)
    common = min(len(one.transitions), len(other.transitions))  # how long a Zeno tail is followed: `relaxation`
    assert common == len(one.transitions) or "ball" in name
    assert [t.edge for t in one.transitions[:common]] == [t.edge for t in other.transitions[:common]]
    pairs = zip(one.transitions[:common], other.transitions[:common], strict=True)
    assert max(abs(a.time * factors[0] - b.time) / factors[0] for a, b in pairs) < 1e-6
    assert one.stop.reason == other.stop.reason == "until"


@pytest.mark.parametrize("scheme", ["located", "relaxed"])
def test_an_oscillator_of_a_nanosecond(scheme: str) -> None:
    text = """
hsdsl: 1
parameters: {tau: 1e-9, u: 5}
modes:
  charge: {flow: {x: (u - x)/tau}, transitions: [{when: x >= 2/3*u, to: drain}]}
  drain: {flow: {x: -x/tau}, transitions: [{when: x <= u/3, to: charge}]}
initial: {mode: charge, x: 0}
experiment: {until: 1e-7}
"""
    run = hsdsl.loads(text).simulate(scheme=scheme, tolerance=1e-9)
    assert len(run.transitions) == int((1e-7 - 1e-9 * np.log(3)) / (1e-9 * np.log(2))) + 1


@pytest.mark.parametrize("scale", [1e-12, 1.0, 1e9])
@pytest.mark.parametrize("method", METHODS)
def test_surfaces_of_time_alone_are_crossed_once(scale: float, method: str) -> None:
    text = f"""
hsdsl: 1
modes:
  a: {{flow: {{x: 1}}, transitions: [{{when: sin(10*t/{scale!r}) <= 0, to: b}}]}}
  b: {{flow: {{x: -1}}, transitions: [{{when: sin(10*t/{scale!r}) >= 0, to: a}}]}}
initial: {{mode: a, x: 0}}
experiment: {{until: {20 * scale!r}}}
"""
    run = hsdsl.loads(text).simulate(method=method)
    times = np.array([t.time for t in run.transitions])
    expected = np.pi / 10 * scale * np.arange(1, 64)
    assert np.allclose(times[times > 0.01 * scale], expected, rtol=1e-12)
    assert len(times) <= len(expected) + 1  # at the start the surface is zero: one that is crossed then, or none


@pytest.mark.parametrize("method", ("taylor", "dopri5", "radau"))
def test_given_sizes_of_states_count_until_states_are_larger(method: str) -> None:
    text = """\
hsdsl: 1
parameters: {size: 1e-12}
modes:
  a: {flow: {x: y, y: -x, z: 1e-9*cos(40*t)}, transitions: [{when: x >= 0.5, to: b, reset: {w: 0}}]}
  b: {flow: {w: 1 - w}}
initial: {mode: a, x: 0, y: 1, z: 0}
experiment: {until: 5, scale: {z: size, w: 1}}
"""
    model = hsdsl.loads(text)
    runs = {
        engine: [model.simulate(engine=engine, method=method, parameters={"size": s}) for s in (1e-15, 1e3)]
        for engine in ("c", "python")
    }
    for c, python in zip(*runs.values(), strict=True):
        assert np.array_equal(c.times, python.times)
        assert np.array_equal(c.values, python.values, equal_nan=True)
    small, large = runs["c"]
    assert len(large.times) <= len(small.times)
    assert len(large.times) < len(
        hsdsl.loads(text.replace(", scale: {z: size, w: 1}", "")).simulate(method=method).times
    )
    both = model.ensemble(method=method, parameters={"size": np.array([1e-15, 1e3])})
    assert list(both.state["w"]) == [run.final.state["w"] for run in (small, large)]
