"""The mathematics of lint rules: bounds that hold, answers that are right, points that are what they claim."""

from fractions import Fraction

import mpmath
import numpy as np
import pytest
import sympy as sp
from hypothesis import example, given, settings
from hypothesis import strategies as st

from hsdsl.base.functions import FUNCTIONS
from hsdsl.mathematics.decisions.decide import Decider
from hsdsl.mathematics.decisions.polynomial import NormalForms, expression
from hsdsl.mathematics.decisions.search import SearchRange, StraightLine, at_most_zero, negative, positive, zero

x, y, v, t = sp.symbols("x y v t", real=True)
pi = sp.pi
half = sp.Rational(1, 2)
FREE = {s: SearchRange(None, None, (-100.0, 100.0), 1.0) for s in (x, y, v)}
RANGES = {**FREE, t: SearchRange(Fraction(0), Fraction(10), (0.0, 10.0), 0.0)}

LEAVES = st.one_of(st.sampled_from([x, y]), st.integers(-3, 3).map(sp.Integer), st.just(sp.Rational(1, 3)), st.just(pi))


def applied(call):
    """What SymPy makes of a call; no number where an argument is none, which it does not take everywhere."""
    function, *arguments = call
    if any(a.has(sp.nan, sp.zoo) or (a.is_number and a.count_ops() > 3) for a in arguments):
        return sp.nan  # SymPy takes minutes for the digits of some numbers with functions in functions
    return function(*arguments)


def grown(parts):
    one = st.sampled_from([FUNCTIONS[n][0] for n in FUNCTIONS if n not in ("min", "max", "atan2", "select")])
    two = st.sampled_from([FUNCTIONS["min"][0], FUNCTIONS["max"][0], FUNCTIONS["atan2"][0], sp.Add, sp.Mul])
    return st.one_of(
        st.tuples(one, parts).map(applied),
        st.tuples(two, parts, parts).map(applied),
        st.tuples(parts, st.sampled_from([2, 3, -1, -2, half, sp.Rational(-1, 3)])).map(lambda p: sp.Pow(*p)),
    )


EXPRESSIONS = st.recursive(LEAVES, grown, max_leaves=6).filter(
    lambda e: not e.has(sp.zoo, sp.nan, sp.oo, -sp.oo, sp.I, sp.AccumBounds) and e.free_symbols
)
NUMBER = st.floats(-4, 4).map(lambda f: round(f, 3))


def absolute(number):
    """Of a real number: the root of a negative one has no value here, and so has its size."""
    if isinstance(number, mpmath.mpc):
        raise ValueError(number)
    return abs(number)


def value(expr, at):
    """The value in forty digits; None where it is not real."""
    names = {"absolute": absolute, "minimum": min, "maximum": max, "sign": mpmath.sign, "floor": mpmath.floor}
    try:
        with mpmath.workdps(40):
            numbers = sp.lambdify((x, y), expr, modules=[names, "mpmath"])
            found = numbers(*(mpmath.mpf(a) for a in at))
            return found if isinstance(found, mpmath.mpf) and mpmath.isfinite(found) else None
    except (ZeroDivisionError, ValueError, OverflowError, TypeError, AttributeError):
        return None


@settings(max_examples=250, deadline=None)
@example(y**2, 0.0, 0.0, 0.0, 2.225073858507e-311, 0.0, 1.0)
@example(FUNCTIONS["abs"][0](sp.sqrt(x)), -1.0, 0.0, 1.0, 0.0, 0.0, 0.0)
@given(EXPRESSIONS, NUMBER, NUMBER, st.floats(0, 2), st.floats(0, 2), st.floats(0, 1), st.floats(0, 1))
def test_bounds_contain_every_value(expr, a, b, wide, high, p, q):
    exact = value(expr, (a + p * wide, b + q * high))
    if exact is None:
        return
    found = StraightLine([expr], [x, y]).over(np.array([[a, b]]), np.array([[a + wide, b + high]]))
    assert found.low[0, 0] <= exact <= found.high[0, 0], (expr, found)


@settings(max_examples=150, deadline=None)
@given(EXPRESSIONS, NUMBER, NUMBER)
def test_a_polynomial_has_the_value_of_its_expression(expr, a, b):
    exact, again = (value(e, (a, b)) for e in (expr, expression(NormalForms().of(expr))))
    if exact is not None and again is not None:
        assert abs(exact - again) <= 1e-20 * (1 + abs(exact))


@pytest.mark.parametrize(
    "expr",
    [
        (x + y) ** 3 - x**3 - 3 * x**2 * y - 3 * x * y**2 - y**3,
        sp.sqrt(sp.sin(x + pi / 5) ** 2 + sp.cos(x + pi / 5) ** 2) - 1,
        sp.sqrt(x**2 + 1) ** 2 - x**2 - 1,
        sp.cos(x) ** 4 - (1 - sp.sin(x) ** 2) ** 2,
    ],
)
def test_what_vanishes_is_seen_to(expr):
    assert not NormalForms().of(expr).terms


CIRCLE = zero(x**2 + y**2 - 1)
QUESTIONS = [
    ("never", "symbolic", (zero(x - 14), positive(x - 15))),
    ("never", "symbolic", (zero(x - 14), positive(v), at_most_zero(v))),
    ("never", "symbolic", (zero(x - pi / 12), positive(pi / 12 - x))),
    ("never", "symbolic", (at_most_zero(x**2 + y**2 + 1),)),
    ("never", "symbolic", (CIRCLE, positive(x - 2))),
    ("never", "symbolic", (zero(x - t), positive(x - 11))),
    ("never", "interval", (zero(sp.exp(x) - t), positive(x - 3))),
    ("never", "interval", (zero(sp.sin(x)), zero(sp.cos(x)))),
    ("never", "interval", (CIRCLE, positive(x * y - sp.Rational(6, 10)))),
    ("never", "symbolic", (negative(sp.sqrt(x**2 + y**2) + sp.exp(x) / 2),)),
    ("somewhere", "symbolic", (zero(x - 14), zero(v))),
    ("somewhere", "symbolic", (zero(x - t), positive(v - x), positive(x - 3), at_most_zero(x + y))),
    ("somewhere", "symbolic", (zero(x**2), positive(v))),
    ("somewhere", "sampled", (CIRCLE, at_most_zero(half - x * y))),
    ("somewhere", "sampled", (CIRCLE, zero(y - sp.sin(3 * x)), positive(x))),
    ("somewhere", "sampled", (zero(20 * sp.cos(t) - v - x), zero(x - 14), at_most_zero(-v))),
]


@pytest.mark.parametrize(("verdict", "decided", "constraints"), QUESTIONS)
def test_questions(verdict, decided, constraints):
    answer = Decider().decide(constraints, RANGES, prove=True)
    assert (answer.verdict, answer.decided) == (verdict, decided)
    for constraint in constraints if answer.somewhere else ():
        found = float(constraint.expr.subs(answer.point))
        assert {"= 0": abs(found) < 1e-8, "<= 0": found < 1e-8, "< 0": found < 0}[constraint.relation]


def test_a_search_says_how_far_it_went():
    answer = Decider().decide((zero(sp.exp(x) - t), positive(x - 3)), RANGES, prove=True)
    ((symbol, low, high),) = answer.searched
    assert symbol == x and low == -np.inf and high >= 100


@settings(max_examples=80, deadline=None)
@given(st.lists(st.tuples(*[st.integers(-3, 3)] * 3), min_size=1, max_size=4), st.tuples(NUMBER, NUMBER))
def test_linear_questions_are_never_denied_a_point_they_have(rows, at):
    """Constraints that hold at a point by construction have one."""
    held = []
    for a, b, kind in rows:
        expr = a * x + b * y
        level = sp.Rational(str(at[0])) * a + sp.Rational(str(at[1])) * b
        held.append(zero(expr - level) if kind == 0 else at_most_zero(expr - level - abs(kind) + 1))
    assert not Decider().decide(held, RANGES, prove=True).never


def test_work_is_bounded():
    decider = Decider(left=0)
    assert decider.decide((CIRCLE, at_most_zero(half - x * y)), RANGES).verdict == "unknown"
    large = sp.Add(*(sp.sin(k * x) for k in range(2000)))
    assert Decider().decide((zero(large),), RANGES).verdict == "unknown"
