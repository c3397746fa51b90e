"""Generated routines against the mathematics: random expressions, their gradients and rates, floats and many digits."""

from __future__ import annotations

from fractions import Fraction

import mpmath
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import hsdsl
from hsdsl.base.numbers.arithmetic import FLOAT64, multiprecision
from hsdsl.engine.backends.python import PythonKernel
from hsdsl.interface.model import Model
from hsdsl.language.elaborate import elaborate

MANY = multiprecision(40)
# every expression stays within [-50, 50] on [-2, 2]^2, and so do its first two derivatives' parts: errors are absolute
LEAVES = st.sampled_from(["x", "v", "a", "t", "u", "1/3", "0.7", "2", "pi"])


def _grown(inner):
    return st.one_of(
        st.builds("sin({})".format, inner),
        st.builds("cos({})".format, inner),
        st.builds("tanh({})".format, inner),
        st.builds("atan2({}, 2 + cos({}))".format, inner, inner),
        st.builds("sqrt(1 + tanh({})**2)".format, inner),
        st.builds("exp(sin({}))".format, inner),
        st.builds("({} - {})/2".format, inner, inner),
        st.builds("tanh({})*cos({})".format, inner, inner),
        st.builds("sin({})/(2 + cos({}))".format, inner, inner),
        st.builds("tanh({})**3".format, inner),
        st.builds("(2 + sin({}))**-2".format, inner),
        st.builds("(2 + sin({}))**1.5".format, inner),
        st.builds("-cos({})**2".format, inner),
        st.builds("max({}, {})".format, inner, inner),
        st.builds("abs({})".format, inner),
    )


FEW_LEAVES, EXPRESSIONS = (st.recursive(LEAVES, _grown, max_leaves=most) for most in (3, 5))
POINTS = st.tuples(*[st.floats(-2, 2).map(lambda v: round(v, 6) + 1e-4) for _ in range(3)])


def kernels(flow: str, guard: str):
    text = f"""
hsdsl: 1
parameters: {{a: 0.35}}
inputs: {{u: {{times: [0, 10], values: [1, 3], hold: linear}}}}
modes:
  m:
    flow: {{x: "{flow}", v: "1 - x*v/4"}}
    transitions: [{{when: "{guard} >= v/3", to: m, reset: {{x: "{flow}", v: x}}}}]
outputs: {{y: "{flow}"}}
initial: {{mode: m, x: 0, v: 0}}
experiment: {{until: 1}}
"""
    program = Model(elaborate("random.yaml", text=text.encode())).program
    bound = []
    for arithmetic in (FLOAT64, MANY):
        kernel = PythonKernel(program, arithmetic)
        data = [kernel.constant("parameter_0", ())[0], *(arithmetic.zero + n for n in (1, 0, 0))]
        data[2] = arithmetic.constant(Fraction(1, 5))
        bound.append(kernel.bind(0, [*data, *(arithmetic.zero + 1 for _ in program.switches)]))
    return bound


def check(flow, guard, point):
    """Floats agree with forty digits, whose gradients are slopes and whose rates follow the flow."""
    quick, exact = kernels(flow, guard)
    at = tuple(MANY.zero + p for p in point)
    for name in ("flow", "surfaces", "magnitudes", "outputs"):
        for a, b in zip(getattr(quick, name)(*point), getattr(exact, name)(*at), strict=True):
            assert abs(a - b) < 1e-11
    gradient, rate = exact.gradients[0](*at), exact.rates[0](*at)[0]
    assert abs(quick.rates[0](*point)[0] - rate) < 1e-11
    assert quick.resets[0](*point)[1] == point[1]
    h = mpmath.mpf(10) ** -12
    for i, (rounded, slope) in enumerate(zip(quick.gradients[0](*point), gradient, strict=True)):
        assert abs(rounded - slope) < 1e-11
        up, down = list(at), list(at)
        up[i], down[i] = at[i] + h, at[i] - h
        assert abs((exact.surfaces(*up)[0] - exact.surfaces(*down)[0]) / (2 * h) - slope) < 1e-9
    f = exact.flow(*at)
    assert abs(gradient[0] + gradient[1] * f[0] + gradient[2] * f[1] - rate) < 1e-30


@settings(max_examples=8, deadline=None)
@given(FEW_LEAVES, FEW_LEAVES, POINTS)
def test_routines_of_small_expressions_are_right(flow, guard, point):
    check(flow, guard, point)


@pytest.mark.campaign
@settings(max_examples=200, deadline=None)
@given(EXPRESSIONS, EXPRESSIONS, POINTS)
def test_routines_of_many_expressions_are_right(flow, guard, point):
    check(flow, guard, point)


NAMES = ["E", "I", "S", "beta", "lambda", "None_", "exec", "import_", "q_1_2", "x0", "p0", "w0", "nan", "e", "class"]


@pytest.mark.parametrize("name", NAMES)
def test_names_reach_the_generated_text_only_as_numbers(name):
    text = f"""
hsdsl: 1
parameters: {{par_{name}: 3}}
modes:
  m:
    flow: {{{name}: "{name}*par_{name} + 1"}}
    transitions: [{{when: {name} >= 5, to: m, reset: {{{name}: -{name}}}}}]
initial: {{mode: m, {name}: 1}}
experiment: {{until: 0}}
"""
    system = elaborate("names.yaml", text=text.encode())
    program = Model(system).program
    source = program.modes[0].routines.source
    assert f"par_{name}" not in source
    kernel = PythonKernel(program, FLOAT64)
    assert kernel.bind(0, [3.0]).flow(0.0, 2.0) == (7.0,)
    assert hsdsl.Model(system).simulate().final.state == {name: 1.0}
