"""Expressions at a point: against SymPy's own evaluation, and where there is no value."""

from fractions import Fraction

import mpmath
import pytest
import sympy as sp

from hsdsl.analysis.lint.subject import BEYOND, INSIDE, ON, evaluate, holds, leaves, rational, sample_at, side
from hsdsl.language.expression import parse, symbolic
from hsdsl.language.expression.scope import Scope, Value, symbol
from hsdsl.language.system import TIME, Mode, SampledInput, Surface

X, Y = symbol("x"), symbol("y")
SCOPE = Scope({"x": Value(X), "y": Value(Y), "t": Value(TIME)})
POINT = {X: rational(Fraction(3, 7)), Y: rational(-2), TIME: rational(0)}


def read(text):
    return symbolic.number(parse(text), SCOPE, text).expr


def arguments(text):
    return symbolic.condition(parse(text, "condition"), SCOPE, text)


@pytest.mark.parametrize(
    "text",
    [
        "x**2 - 3*x*y + y/7",
        "sin(x)*cos(y) + tan(x/3) - atan2(y, x)",
        "exp(x*y) + log(x) - sqrt(x)/3",
        "x**(1/3) + y**3 + (x + 1)**y",
        "asin(x) + acos(x) + atan(y) + asinh(y) + acosh(3 + x) + atanh(x)",
        "sinh(x) + cosh(y) - tanh(x)",
        "pi*x + exp(1)",
    ],
)
def test_smooth_functions(text):
    exact = read(text).subs({X: sp.Rational(3, 7), Y: -2}).evalf(40)
    assert abs(evaluate(read(text), POINT) - mpmath.mpf(str(exact))) < mpmath.mpf("1e-15")


@pytest.mark.parametrize(
    ("text", "value"),
    [("abs(y)", 2), ("sign(y)", -1), ("floor(x - 1)", -1), ("min(x, y, 5)", -2), ("max(x, y)", Fraction(3, 7))],
)
def test_kinked_functions(text, value):
    assert evaluate(read(text), POINT) == rational(value)


@pytest.mark.parametrize(
    "text", ["1/t", "log(t)", "sqrt(y)", "y**(1/2)", "asin(y)", "x + log(y)", "exp(exp(exp(9 + x)))"]
)
def test_without_a_value(text):
    assert mpmath.isnan(evaluate(read(text), POINT))


def test_a_symbol_without_a_value():
    assert mpmath.isnan(evaluate(X + Y, {X: rational(1)}))


@pytest.mark.parametrize(
    ("text", "truth"),
    [
        ("x > 0 and y < 0", True),
        ("x > 0 and not y < 0", False),
        ("x == 3/7", True),
        ("x != 3/7 or y >= -2", True),
        ("1/t > 0", None),
        ("x > 1 and 1/t > 0", False),
        ("x < 1 or 1/t > 0", True),
        ("x > 1 or 1/t > 0", None),
        ("not 1/t > 0", None),
        ("true", True),
    ],
)
def test_conditions(text, truth):
    assert holds(arguments(text), POINT) is truth


@pytest.mark.parametrize(
    ("hold", "time", "value"),
    [
        ("zero", -1, 5),
        ("zero", 0, 5),
        ("zero", 1, 5),
        ("zero", 2, 9),
        ("zero", 7, 9),
        ("linear", 1, 7),
        ("linear", 3, 9),
    ],
)
def test_sampled_inputs_just_after_a_time(hold, time, value):
    given = SampledInput("u", hold, (Fraction(0), Fraction(2)), (Fraction(5), sp.Integer(9)))
    assert sample_at(given, rational(time), {}) == rational(value)


def surface(text):
    return Surface(read(text), sp.S.Zero, read(text), text)


def mode(x, y):
    return Mode("m", ("x", "y"), (read(x), read(y)), (x, y), (), (), ())


@pytest.mark.parametrize(("text", "where"), [("7*x - 3", ON), ("x", BEYOND), ("y", INSIDE), ("x - 3/7 + 1e-15", ON)])
def test_sides(text, where):
    point = {**POINT, X: rational(Fraction(3 / 7))}
    found = Surface(read(text) + 3, sp.Integer(3), read(text), text)
    assert side(found, point) == where


@pytest.mark.parametrize(
    ("text", "flow", "out"),
    [
        ("x", ("1", "0"), True),
        ("x", ("-1", "0"), False),
        ("x", ("y", "1"), True),
        ("x", ("y", "-1"), False),
        ("x", ("t**3", "0"), True),
        ("x", ("-t**2", "0"), False),
        ("x", ("0", "0"), None),
        ("x", ("1/y", "0"), None),
    ],
)
def test_whether_the_flow_leaves(text, flow, out):
    origin = {X: rational(0), Y: rational(0), TIME: rational(0)}
    assert leaves(mode(*flow), surface(text), origin) is out
