"""Expressions with names for what comes more than once: the same values, and nothing computed twice."""

from __future__ import annotations

import random
from collections import Counter

import pytest
import sympy as sp

from hsdsl.base.functions import below, maximum
from hsdsl.mathematics.lower.straight import shared

A, B, C, D, X, Y = sp.symbols("a b c d x y", real=True)

CASES = [  # expressions, and the parts that get a name
    ((A * B * C, A * B * D), {"a*b"}),
    ((A + B + C, A + B + D), {"a + b"}),
    (((A - B) * C, (B - A) * D), {"a - b"}),
    ((-2 * X * Y, 2 * X * Y), {"2*x*y"}),
    ((1 / X, Y / X), {"1/x"}),
    ((X**-2, A + X**-2), {"x**(-2)"}),
    ((A * B, A * B * C), {"a*b"}),
    ((sp.sin(X) + 1, sp.cos(sp.sin(X) + 1)), {"sin(x) + 1"}),
    ((X + Y, X - Y, X * Y), set()),
    ((below(A, 1, X * Y, X), maximum(X * Y, C)), {"x*y"}),
    ((sp.Or(A > B, C > D), sp.And(A > B, C < D)), {"a > b"}),
]


def restored(statements, expressions):
    """The expressions with the parts in the place of their names."""
    known = dict(statements)
    for name, value in known.items():
        known[name] = value.xreplace(known)
    return [expr.xreplace(known) for expr in expressions]


@pytest.mark.parametrize(("expressions", "named"), CASES)
def test_parts_that_come_twice_have_names(expressions, named):
    statements, written = shared(expressions, "w")
    back = restored(statements, [value for _, value in statements])
    assert {str(value.doit()) for value in back} == named
    for one, other in zip(restored(statements, written), expressions, strict=True):
        assert one.doit() == other or sp.simplify(one.doit() - other) == 0


def quotient(x, y, *_):
    return x / (2 + y**2)


def negative(*terms):
    return -sp.Add(*terms)


def tree(draw, depth):
    if depth == 0:
        return draw.choice((A, B, C, X, Y, sp.Rational(draw.randint(-3, 3), 2)))
    operands = [tree(draw, depth - 1) for _ in range(draw.randint(2, 4))]
    return draw.choice((sp.Add, sp.Mul, negative, quotient, lambda x, *_: sp.sin(x)))(*operands)


@pytest.mark.parametrize("seed", range(30))
def test_random_expressions_keep_their_values(seed):
    draw = random.Random(seed)
    expressions = [tree(draw, 3) for _ in range(4)]
    statements, written = shared(expressions, "w")
    point = {x: sp.Float(draw.uniform(-2, 2), 30) for x in (A, B, C, X, Y)}
    expected = [expr.xreplace(point).evalf(30) for expr in expressions]
    for name, value in statements:
        point[name] = value.xreplace(point).evalf(30)
    for expr, value in zip(written, expected, strict=True):
        assert abs(expr.xreplace(point).evalf(30) - value) < 1e-20 * (1 + abs(value))
    values = [value for _, value in statements]
    used = Counter(part for expr in (*values, *written) for part in sp.preorder_traversal(expr))
    assert all(used[name] > 1 for name, _ in statements)
    assert len(set(values)) == len(values)
