"""Surfaces along a step: which are affine, and that their polynomials then are the surfaces themselves."""

from fractions import Fraction

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hsdsl.engine.scheme.polynomials import value_of
from hsdsl.engine.simulate.surfaces import affine_curve, at
from hsdsl.interface.model import Model
from hsdsl.language.elaborate import elaborate

TEXT = """
hsdsl: 1
parameters: {{a: 2}}
inputs:
  held: {{times: [0, 1, 2], values: [0, 1, 0]}}
  ramp: {{times: [0, 1, 2], values: [0, 1, 0], hold: linear}}
  wave: cos(t)
modes:
  m:
    flow: {{x: v, v: -x}}
    transitions: [{{when: "{guard}", to: m, reset: {{x: 0}}}}]
initial: {{mode: m, x: 1, v: 0}}
experiment: {{until: 1}}
"""
AFFINE = {
    "x >= 3": True,
    "x >= a*v - 2*t + 1": True,
    "a**2*x <= sin(a)*v": True,
    "t >= 1": True,
    "x >= ramp": True,
    "x + held <= 0": True,
    "(x + v)*(x - v) + v**2 - x**2 + x >= 1": True,
    "x*v >= 1": False,
    "t*x >= 1": False,
    "x >= wave": False,
    "abs(x) >= 1": False,
    "max(x, v) >= 1": False,
    "x - floor(x) >= 0.5": False,
    "x + sign(v) >= 0": False,
    "x/v >= 1": False,
    "x**a >= 1": False,
}


@pytest.mark.parametrize(("guard", "affine"), AFFINE.items())
def test_what_is_affine(guard, affine):
    system = elaborate("guard.yaml", text=TEXT.format(guard=guard).encode())
    assert Model(system).program.modes[0].affine is affine


number = st.fractions(-3, 3, max_denominator=8)
pair = st.tuples(number, number)


@given(pair, st.lists(pair, min_size=1, max_size=5), st.tuples(number, number, number), number, st.fractions(0, 1))
def test_an_affine_surface_is_its_polynomial(x, piece, slopes, h, share):
    """r(t, x) = slopes . (t, x), t from 0 on: what the polynomial gives is r at the point, in exact numbers."""
    start = slopes[1] * x[0] + slopes[2] * x[1]
    (curve,) = affine_curve(start, slopes, h, tuple(piece), Fraction(0))
    point = at(x, tuple(piece), share)
    found = value_of(curve.coefficients, len(curve.coefficients) - 1, share)
    assert found == slopes[0] * h * share + slopes[1] * point[0] + slopes[2] * point[1]
