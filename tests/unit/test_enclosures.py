"""Interval arithmetic: every value in a box lies in the enclosure of the box."""

from __future__ import annotations

import numpy as np
import pytest

from hsdsl.analysis.metrics.space import formula
from hsdsl.language.expression import parse, symbolic
from hsdsl.language.expression.scope import Scope, state, symbol

SCOPE = Scope({"x": state("x"), "y": state("y")})

# Expression, centre and half width of the boxes' coordinates: every function of the language.
CASES = [
    ("x*y - x**2*y + 3/7", 0.0, 3.0),
    ("x**3 - y**4 + x**9", 0.0, 1.5),
    ("sin(3*x) + cos(5*y)*x", 0.0, 4.0),
    ("tan(x) - y", 0.0, 1.2),
    ("sqrt(x) + 1/y", 2.0, 1.5),
    ("exp(x) - log(y)", 2.0, 1.5),
    ("sinh(x) + cosh(y) + tanh(x*y)", 0.0, 2.0),
    ("asin(x/4) + acos(y/4) + atan(x)", 0.0, 3.5),
    ("asinh(x) + acosh(x + 4) + atanh(y/4)", 0.0, 2.5),
    ("atan2(x, y + 3)", 0.0, 2.5),
    ("abs(x) - max(x, y) + min(x, 2*y, 1)", 0.0, 2.0),
    ("x**(1/3) + y**(-2)", 2.0, 1.5),
    ("x**y", 2.0, 1.2),
    ("sign(x) + floor(2*y)", 0.0, 2.0),
    ("pi*x - exp(1)*y", 0.0, 2.0),
]


def made(text):
    return formula((symbolic.number(parse(text), SCOPE, text).expr,), (symbol("x"), symbol("y")))


@pytest.mark.parametrize(("text", "centre", "width"), CASES)
def test_values_and_differences_lie_in_their_enclosures(text, centre, width):
    rng = np.random.default_rng(3)
    compiled = made(text)
    middle = rng.uniform(centre - width, centre + width, size=(40, 2))
    half = rng.uniform(0, width, size=(40, 2)) * 10.0 ** rng.integers(-6, 1, size=(40, 1))
    low, high = np.maximum(middle - half, centre - width), np.minimum(middle + half, centre + width)
    below, above = compiled.ranges(low, high)
    slope_below, slope_above = compiled.slopes(low, high)
    bounded = 0
    for k in range(len(low)):
        points = rng.uniform(low[k], high[k], size=(30, 2))
        values = np.array([compiled(p) for p in (*points, low[k], high[k])])
        assert np.all((below[k] <= values) & (values <= above[k]))
        bounded += np.isfinite(above[k, 0] - below[k, 0])
        way, rise = points[1:] - points[:-1], np.diff(values[:30])
        most = np.maximum(slope_below[k, 0] * way, slope_above[k, 0] * way).sum(axis=1)
        least = np.minimum(slope_below[k, 0] * way, slope_above[k, 0] * way).sum(axis=1)
        rounding = 1e-14 * (1 + np.abs(values).max())
        assert np.all((least - rounding <= rise) & (rise <= most + rounding))
    assert bounded >= 20  # an enclosure that is always everything would prove nothing


def test_enclosures_of_points_are_as_narrow_as_rounding():
    compiled = made("sin(x)*exp(y) - x/(1 + y**2)")
    x = np.random.default_rng(0).normal(size=(20, 2))
    below, above = compiled.ranges(x, x)
    assert np.all(above - below <= 1e-13)


def test_pi_is_enclosed_where_it_is_a_bound():
    """The nearest float is below pi: where atan2 jumps and acos ends, the enclosure goes beyond it."""
    low, high = np.array([[-1.0, -1.0]]), np.array([[1.0, -0.5]])
    below, above = made("atan2(x, y)").ranges(low, high)
    assert below[0, 0] < -np.pi and above[0, 0] > np.pi
    assert made("acos(x)").ranges(np.array([[-1.0, 0.0]]), np.array([[-1.0, 0.0]]))[1][0, 0] > np.pi


def test_where_a_formula_has_no_value_nothing_is_concluded():
    low, high = np.array([[-1.0, 0.0]]), np.array([[1.0, 0.0]])
    for text in ("sqrt(x)", "log(x)", "1/x", "asin(2*x)", "tan(2*x)"):
        below, above = made(text).ranges(low, high)
        assert (below[0, 0], above[0, 0]) == (-np.inf, np.inf), text
