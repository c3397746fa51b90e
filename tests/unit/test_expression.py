"""Expressions: precedence, exactness, conditions, and what must stay cheap."""

import time

import pytest
import sympy as sp

from hsdsl.base.functions import absolute, atan2, maximum, minimum
from hsdsl.language.expression import ExpressionError, parse, symbolic
from hsdsl.language.expression.scope import Refusal, Scope, Value, state, symbol
from hsdsl.language.expression.timebox import deep_stack

NAMES = ["x", "y", "a", "E", "I", "S", "N", "Q", "beta", "gamma", "lambda", "zeta", "class", "def", "None", "é", "x_1"]
SCOPE = Scope({**{name: state(name) for name in NAMES}, "t": Value(symbol("t"))})
X, Y = symbol("x"), symbol("y")


def number(text):
    tree = parse(text)
    assert SCOPE.faults(tree) == []
    with deep_stack():
        return symbolic.number(tree, SCOPE, text).expr


def condition(text):
    return symbolic.condition(parse(text, "condition"), SCOPE, text)


def fault(text, exact="number"):
    with pytest.raises(ExpressionError) as raised:
        tree = parse(text, exact)
        for error in SCOPE.faults(tree):
            raise error
        (condition if exact == "condition" else number)(text)
    return raised.value


NUMBERS = {
    "-x**2": -(X**2),
    "2**-1": sp.Rational(1, 2),
    "2**3**2": sp.Integer(512),
    "-y - -0.7": sp.Rational(7, 10) - Y,
    "+x": X,
    "- - -x": -X,
    "x--y": X + Y,
    "x - y - 1": X - Y - 1,
    "x/y/2": X / Y / 2,
    "x/y*2": 2 * X / Y,
    "2*-x": -2 * X,
    "-2**2": sp.Integer(-4),
    "(-2)**2": sp.Integer(4),
    "x**-y": X**-Y,
    "1/3": sp.Rational(1, 3),
    "0.1": sp.Rational(1, 10),
    "1e-3": sp.Rational(1, 1000),
    "1E+2": sp.Integer(100),
    ".5": sp.Rational(1, 2),
    "5.": sp.Integer(5),
    "010": sp.Integer(10),
    "0x1F": sp.Integer(31),
    "0o17": sp.Integer(15),
    "1e20": sp.Integer(10) ** 20,
    "1000000000000000000": sp.Integer(10) ** 18,
    "pi": sp.pi,
    "sin(pi)": sp.Integer(0),
    "exp(1)": sp.E,
    "sqrt(8)": 2 * sp.sqrt(2),
    "abs(-3)": sp.Integer(3),
    "abs(x)": absolute(X),
    "sqrt(x**2)": absolute(X),
    "max(x, y)": maximum(X, Y),
    "min(x, y, 2)": minimum(minimum(X, Y), 2),
    "floor(2.5)": sp.Integer(2),
    "atan2(y, x)": atan2(Y, X),
    "atan2(1/3, abs(pi))": atan2(sp.Rational(1, 3), absolute(sp.pi)),
    "0**0": sp.Integer(1),
    "x\n + y": X + Y,
}


@pytest.mark.parametrize(("text", "expected"), NUMBERS.items())
def test_numbers(text, expected):
    assert number(text) == expected


@pytest.mark.parametrize("name", NAMES)
def test_names_are_plain_real_symbols(name):
    assert number(name) == sp.Symbol(name, real=True)
    assert number(f"{name}*{name}") == sp.Symbol(name, real=True) ** 2


def test_names_have_one_spelling():
    assert number("e\u0301") == number("é")


CONDITIONS = {
    "x > 0": [(1, 0, True), (0, 0, False)],
    "x > 0 and y > 0 or x < -1": [(1, 1, True), (1, 0, False), (-2, 0, True)],
    "x > 0 and (y > 0 or x < 2)": [(1, 0, True), (3, 0, False)],
    "not x > 0 and y > 0": [(0, 1, True), (1, 1, False)],
    "not (x > 0 and y > 0)": [(0, 1, True), (1, 1, False)],
    "0 < x <= 2": [(2, 0, True), (0, 0, False)],
    "x < y == 2": [(1, 2, True), (1, 3, False)],
    "(x + 1) > 0": [(0, 0, True), (-1, 0, False)],
    "(x)+(1) > (y)": [(1, 1, True), (0, 1, False)],
    "x != 0": [(1, 0, True), (0, 0, False)],
    "true": [(0, 0, True)],
    "false or x >= 1": [(1, 0, True), (0, 0, False)],
    "not not x > 0": [(1, 0, True), (0, 0, False)],
    "abs(x) > 1 and not true": [(5, 0, False)],
}


@pytest.mark.parametrize(("text", "values"), CONDITIONS.items())
def test_conditions(text, values):
    made = condition(text)
    for x, y, expected in values:
        assert bool(made.subs({X: x, Y: y})) is expected


def test_conditions_are_kept_as_written():
    assert condition("x**2 >= 0") == sp.Ge(X**2, 0, evaluate=False)


FAULTS = [
    ("x +", "number", "HS102", 2, 3),
    ("x + foo", "number", "HS111", 4, 7),
    ("2*(x + 1", "number", "HS103", 2, 3),
    ("x + 5y", "number", "HS104", 4, 6),
    ("x > 0 and y", "condition", "HS115", 10, 11),
    ("1 + (x > 0)", "number", "HS114", 5, 10),
    ("y + 1/0", "number", "HS118", 6, 7),
    ("x + (-8)**(1/3)", "number", "HS118", 4, 15),
    ("x**1001", "number", "HS119", 3, 7),
    ("x + sin(x, y)", "number", "HS113", 4, 13),
]


@pytest.mark.parametrize(("text", "exact", "code", "start", "end"), FAULTS)
def test_faults_have_places(text, exact, code, start, end):
    error = fault(text, exact)
    assert (error.code, error.start, error.end) == (code, start, end)


LARGE = {
    "sum": "+".join(["x"] * 5000),
    "product": "*".join(["x"] * 5000),
    "quotient": "1" + "/x" * 4999,
    "signs": "-" * 9999 + "x",
    "parentheses": "(" * 200 + "x" + ")" * 200,
    "functions": "sin(" * 100 + "x" + ")" * 100,
    "nested sums": "(1+2*" * 200 + "x" + ")" * 200,
    "products of sums": "(1+x*" * 100 + "x" + ")" * 100,
    "powers": "x**" * 100 + "x",
    "decimals": "+".join(f"x*3.{i}1" for i in range(900)),
    "quotients": "+".join(f"x**{i}/3.{i}1" for i in range(700)),
    "floor of a sum of roots": "floor((sqrt(2)+sqrt(3)+sqrt(5)+sqrt(7)+sqrt(11))**100)",
    "sign of what no precision tells": "sign(10**300*pi - floor(10**300*pi))",
    "largest of equal roots": "max(sqrt(2)+sqrt(3), sqrt(5+2*sqrt(6)))",
}


@pytest.mark.parametrize("text", LARGE.values(), ids=LARGE.keys())
def test_large_expressions_work(text):
    began = time.process_time()
    number(text)
    assert time.process_time() - began < 5


REFUSED = {
    "parentheses": ("(" * 201 + "x" + ")" * 201, "HS123"),
    "powers": ("x**" * 201 + "x", "HS123"),
    "functions": ("sin(" * 101 + "x" + ")" * 101, "HS120"),
    "products of sums": ("(1+x*" * 105 + "x" + ")" * 105, "HS120"),
    "length": ("x" * 10_001, "HS110"),
    "tower": ("9**9**9", "HS119"),
    "nested towers": ("(((2*x)**1000)**1000)**1000", "HS120"),
    "coefficient beyond floats": ("1e300*x*1e300", "HS118"),
    "coefficient out of an exponential": ("exp(log(x) + 1000*log(7))", "HS118"),
    "constant tower": ("(2**1000)**1000", "HS118"),
    "shrinking tower": ("((1/3)**1000)**1000", "HS120"),
    "near one": ("(1 - 1e-15)**(1e9 + 0.5)", "HS119"),
    "products": ("*".join(["10**18"] * 200), "HS118"),
    "exponential of a logarithm": ("exp(-1e17*log(3))", "HS119"),
    "exponents that meet": ("2**(x + 10**9)*2**(-x)", "HS120"),
    "harmonic": ("+".join(f"1/({i}**30 + 1)" for i in range(3, 600)), "HS120"),
    "exponential tower": ("exp(exp(exp(9)))", "HS118"),
    "literal exponent": ("1e999999999", "HS118"),
    "many digits": ("1." + "3" * 5000, "HS124"),
}


@pytest.mark.parametrize(("text", "code"), REFUSED.values(), ids=REFUSED.keys())
def test_what_would_fill_the_memory_is_refused_at_once(text, code):
    began = time.process_time()
    assert fault(text).code == code
    assert time.process_time() - began < 2


def test_nothing_in_the_scope_is_reached_but_names():
    for text in ("__import__('os')", "x.__class__", "(lambda: 1)()", "eval(x)", "open(x)", "x.subs(1)", "[x][0]"):
        assert fault(text).code in ("HS109", "HS112", "HS102", "HS104")


def test_all_faults_of_names_at_once():
    scope = Scope({"x": state("x"), "u": Refusal("HS117", "'u' is an input")}, frozenset(), "the mode 'A'")
    assert [e.code for e in scope.faults(parse("x + u + q + frob(1) + sin"))] == [
        "HS117",
        "HS117",
        "HS111",
        "HS112",
        "HS112",
    ]
