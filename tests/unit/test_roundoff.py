"""Round-off of starts, resets and flows in the error: followed by an arithmetic, and carried by runs."""

from __future__ import annotations

from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from engines import needs_compiler

import hsdsl
from hsdsl.base.numbers.arithmetic import FLOAT64, Arithmetic, multiprecision
from hsdsl.base.numbers.roundoff import Rounded, following, moved

NUMBERS = {"a": "0.1", "b": "2.7", "c": "1e9", "d": "-3"}
FORMULAS = (
    "a + b - a*b",
    "(sqrt(d*d + c*c) - c)*c",
    "pow(a + b, d)/(b - a)",
    "sin(b)*cos(c) - tan(a)",
    "exp(a) - exp(-a)*log(b)",
    "atan(b) + asin(a) - acos(a)*tanh(d)",
    "sinh(a) + cosh(d) - asinh(c) + acosh(b) - atanh(a)",
    "atan2(d, a) + pow(b, a)",
    "min(a, b, d)*max(d, a) + abs(d)",
    "below(a, b, c + a, d) - below(b, a, a, c)",
    "floor(b)*sign(d) + heaviside(a)",
    "((c + b)*(c - b) - c*c)/a",
)


def evaluated(formula: str, arithmetic: Arithmetic) -> Any:
    names = {name: arithmetic.constant(Fraction(text)) for name, text in NUMBERS.items()}
    return eval(formula, {**arithmetic.functions, **names})


@pytest.mark.parametrize("formula", FORMULAS)
@pytest.mark.parametrize("digits", [None, 25])
def test_followed_round_off_is_what_is_lost(formula: str, digits: int | None) -> None:
    base, reference = FLOAT64 if digits is None else multiprecision(digits), multiprecision(80)
    right = evaluated(formula, reference)
    traced, bounded = (evaluated(formula, following(base, traced)) for traced in (True, False))
    known = reference.zero + traced.value + traced.error
    assert abs(known - right) <= traced.off + 8 * base.unit * abs(traced.error) + base.unit**2 * abs(right) * 1e12
    assert abs(reference.zero + bounded.value - right) <= bounded.off + base.unit**2 * abs(right)
    assert traced.value == bounded.value


def test_what_is_exact_has_no_round_off() -> None:
    arithmetic = following(FLOAT64, traced=True)
    three, half = (arithmetic.constant(Fraction(text)) for text in ("3", "1/2"))
    found: Rounded = (three * three + half) / half - arithmetic.functions["pow"](three, three)
    assert (found.value, found.error, found.off) == (-8, 0, 0)
    assert moved(found) == -8
    third = half / three
    assert moved(third) > third.value and moved(-third) < -third.value  # 1/6 is rounded down


CANCEL = "(sqrt(({x})**2 + big**2) - big)*big"  # half of x**2, of which no digit is left
CLOCK = "tau: 1, z: 0"
PLACES = {
    "reset": dict(
        a=f"{{flow: {{{CLOCK}}}, transitions: [{{when: tau >= 1, to: b, reset: {{z: {CANCEL.format(x='z')}}}}}]}}",
        b="{flow: {tau: 1, z: 1}, transitions: [{when: z >= 10, to: b, reset: {z: 0}}]}",
    ),
    "initial value": dict(
        a="{flow: {tau: 1, z: 1}, transitions: [{when: z >= 10, to: a, reset: {z: 0}}]}", z=CANCEL.format(x="start")
    ),
    "parameter": dict(
        parameters=f", low: {CANCEL.format(x='start')}",
        a="{flow: {tau: 1, z: 1}, transitions: [{when: z >= low + 7, to: a, reset: {z: 0}}]}",
    ),
    "input": dict(
        inputs=f"u: {CANCEL.format(x='start')}",
        a="{flow: {tau: 1, z: 0}, transitions: [{when: tau >= 1 + u/7, to: a, reset: {tau: 0}}]}",
    ),
    "sample": dict(
        inputs=f"u: {{times: [0, 4.2], values: [1, '{CANCEL.format(x='start')}'], hold: linear}}",
        a="{flow: {tau: 1, z: u}, transitions: [{when: z >= 7, to: b, reset: {z: 0}}]}",
        b="{flow: {tau: 1, z: 1}}",
    ),
    "guard": dict(
        a=f"{{flow: {{{CLOCK}}}, transitions: [{{when: tau >= {CANCEL.format(x='z')}, to: b, reset: {{tau: 0}}}}]}}",
        b="{flow: {tau: 1, z: 1}}",
    ),
    "flow": dict(
        a=f"{{flow: {{tau: 1, z: {CANCEL.format(x='tau')}}}, transitions: [{{when: z >= 36, to: b}}]}}",
        b="{flow: {tau: 1, z: 0}}",
        z="0",
    ),
}


def place(name: str, big: str, start: str = "2.2") -> hsdsl.Model:
    """A model with half of a square by cancellation in one place."""
    case = PLACES[name]
    modes = "\n".join(f"  {mode}: {case[mode]}" for mode in "ab" if mode in case)
    return hsdsl.loads(f"""
hsdsl: 1
parameters: {{big: {big}, start: {start}{case.get("parameters", "")}}}
inputs: {{{case.get("inputs", "")}}}
modes:
{modes}
initial: {{mode: a, tau: 0, z: {case.get("z", "start")}}}
experiment: {{until: 9.3}}
""")


@pytest.mark.parametrize("method", ["dopri5", "dop853", "radau"])
@pytest.mark.parametrize("name", PLACES)
def test_round_off_in_any_place_is_seen(name: str, method: str) -> None:
    for big, theorem in (("30", "holds"), ("4e9", "unknown")):
        run = place(name, big).simulate(method=method, tolerance=1e-7, engine="python")
        assert run.verdict.theorem == theorem, run.verdict.reasons


@pytest.mark.parametrize("name", ["reset", "initial value", "parameter"])
@pytest.mark.parametrize("given", [{"scheme": "relaxed"}, {"precision": 18}, {"method": "taylor"}])
def test_round_off_is_seen_in_every_run(name: str, given: dict[str, Any]) -> None:
    big = "4e14" if "precision" in given else "4e9"
    run = place(name, big).simulate(engine="python", **given)
    assert run.verdict.theorem == "unknown"
    assert run.verdict.reasons[0].startswith("the run is unreliable from t = ")


def sampled(resets: str, start: str, condition: str, until: str, inputs: str = "") -> hsdsl.Model:
    """A map at each second, whose transitions depend on where it is."""
    states = ", ".join(f"{part.split(':')[0].strip()}: 0" for part in start.split(","))
    other = condition.replace(">=", "<")
    return hsdsl.loads(f"""
hsdsl: 1
inputs: {{{inputs}}}
modes:
  a:
    flow: {{tau: 1, {states}}}
    transitions:
      - {{name: one, when: tau >= 1, if: {condition}, to: a, reset: {{tau: 0, {resets}}}}}
      - {{name: other, when: tau >= 1, if: {other}, to: a, reset: {{tau: 0, {resets}}}}}
initial: {{mode: a, tau: 0, {start}}}
experiment: {{until: {until}}}
""")


MAPS = {  # with numbers of samples after which digits are left, and after which none is
    "logistic": ("z: 3.8*z*(1 - z)", "z: 0.37", "z >= 0.62", 30, 130),
    "Henon": ("z: 1 - 1.4*z**2 + y, y: 0.3*z", "z: 0.1, y: 0.2", "z >= 0.31", 25, 120),
    "Muller": ("z: y, y: 111 - (1130 - 3000/z)/y", "z: 11/2, y: 61/11", "y >= 20.3", 4, 25),
    "doubling": ("z: 2*z - floor(2*z)", "z: 0.3", "z >= 0.45", 20, 60),
}


@pytest.mark.parametrize("inputs", ["", "u: {times: [0, 2.5], values: [0, 1], hold: zero}"])
@pytest.mark.parametrize("name", MAPS)
def test_a_map_holds_until_its_digits_are_lost(name: str, inputs: str) -> None:
    *parts, few, many = MAPS[name]
    for samples, theorem in ((few, "holds"), (many, "unknown")):
        run = sampled(*parts, until=f"{samples}.5", inputs=inputs).simulate(engine="python")
        assert run.verdict.theorem == theorem, run.verdict.reasons
    assert run.verdict.reasons[0].startswith("the run is unreliable from t = ")


def test_an_error_is_that_of_the_run() -> None:
    """Of z in exact arithmetic 1/4 remains what it is, and 1/10 does not; the estimate has either."""
    for start, exact in (("1/4", True), ("1/10", False)):
        loaded = sampled("z: z*4 - 3*z", f"z: {start}", "z >= 0.9", "200.5")
        run = loaded.simulate(engine="python", method="dop853")
        found = loaded.estimate(run).final
        assert found is not None and (found["z"] == 0) == exact


def test_a_filter_forgets_its_round_off() -> None:
    """Its error is no more than what the longest run of errors with one sign adds up to."""
    pole, samples = 0.98, 150
    loaded = sampled(
        f"w: {2 * pole * np.cos(0.7):.4f}*w - {pole**2}*v + 0.3, v: w", "w: 0.3, v: 0.1", "w >= 0.45", f"{samples}.5"
    )
    for method in ("taylor", "dop853"):
        run: Any = loaded.simulate(engine="python", method=method)
        sizes = np.abs(run.values).max(axis=0)
        apart = np.abs(run.finer.values[-1] - run.values[-1])
        assert np.all(apart <= 64 * 2.0**-53 / (1 - pole) * sizes)


@needs_compiler
@pytest.mark.parametrize("method", ["dopri5", "dop853", "radau"])
@pytest.mark.parametrize(
    "reset",
    [
        "3.7*z*(1 - z)", "sin(5*z)/2 + cos(z)/3 + tan(y/3)", "min(z*1.3, 0.7) + max(y, 0.1) - abs(z - 0.4)/3",
        "tanh(z)*1.3 + asinh(z)/9 + atan2(z, 1 + y)/5", "(1 + z**2)**1.5/4 + z**9/30",
        "select(z - 0.3, z/3, 0.9*z + 0.3)", "floor(3*z)/5 + sign(z - 0.2)/9 + 0.11",
        "asin(z/9)*4 + cosh(z/3)/7 + atanh(z/5) + acosh(1.1 + z**2)/4",
    ],
)  # fmt: skip
def test_both_engines_move_a_run_alike(reset: str, method: str) -> None:
    loaded = hsdsl.loads(f"""
hsdsl: 1
parameters: {{a: 0.1, b: "sqrt(2)/3", c: "exp(a) - 1"}}
inputs: {{w: {{times: [0, 0.33, 1.3], values: [0.1, "b/3", 0.3], hold: linear}}}}
modes:
  m:
    flow: {{tau: 1, z: "-z/5 + (sqrt(t**2 + 1e12) - 1e6)*1e3", y: "c - y + w + z/10"}}
    transitions: [{{when: tau >= 7*a, to: m, reset: {{tau: 0, z: "{reset}", y: y/3 + atan(z)/7}}}}]
initial: {{mode: m, tau: 0, z: 0.3 + a, y: b}}
experiment: {{until: 5.2}}
""")
    runs: list[Any] = [loaded.simulate(engine=engine, method=method, tolerance=1e-6) for engine in ("c", "python")]
    one, other = (run.finer for run in runs)
    assert np.array_equal(one.times, other.times) and np.array_equal(one.values, other.values)
    assert not np.array_equal(one.values[0], runs[0].values[0])
    assert runs[0].verdict == runs[1].verdict
