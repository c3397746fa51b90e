"""Expressions with names for what comes more than once: the same values, and nothing computed twice."""

from __future__ import annotations

import random
from collections import Counter

import pytest
import sympy as sp

import hsdsl
from hsdsl.base.functions import below, maximum
from hsdsl.mathematics.completion import contact
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


PARTS = """hsdsl: 1
parameters: {{gap: 1/2}}
automata:
  mass:
    parameters: {{e: 4/5, a: 1/3}}
    inputs: [left, right]
    modes:
      move:
        flow: {{x: v, v: 9*(left - 2*x + right) - v/9 + y, y: -y*e, w: y - w*x, hits: 0}}
        transitions: [{{name: hit, when: "{when}", if: "{condition}", reset: {{v: "{reset}", hits: hits + 1}}}}]
system:
  mass:
    automaton: mass
    count: 12
    initial: {{x: 0, v: index, y: 1, w: 2, hits: 0}}
    parameters: {{e: 4/5 - index/100}}
    inputs: {{left: "mass[index - 1].x", right: "mass[index + 1].x"}}
    at_ends: {{x: 0}}
experiment: {{until: 1}}
"""
GUARDS = (  # a guard, its `if`, and its reset
    ("x >= gap", "w > -9", "-e*v"),
    ("x + a*y >= gap", "v > w or y > 0", "-e*abs(v)"),
    ("x*(1 + a*x) >= gap", "w > y and y < 3", "-e*v + max(v - w, 0)"),
    ("x - sin(t) >= gap", "v > 0", "-e*v*sqrt(1 + v**2)"),
)


def written(value):
    """What an expression is written as, operands in their places."""
    if isinstance(value, sp.Basic):
        return (value.func, *map(written, value.args)) if value.args else value
    if isinstance(value, dict):
        return [(written(key), written(entry)) for key, entry in value.items()]
    return list(map(written, value)) if isinstance(value, (list, tuple)) else value


@pytest.mark.parametrize(("when", "condition", "reset"), GUARDS)
def test_motions_along_alike_guards_are_those_derived_one_by_one(when, condition, reset):
    pipeline = hsdsl.loads(PARTS.format(when=when, condition=condition, reset=reset)).pipeline
    (mode,), alike, shared_by = pipeline.system.modes, {}, 0
    for k in range(len(mode.edges)):
        before = len(alike)
        found, alone = contact(mode, k, alike=alike), contact(mode, k)
        shared_by += len(alike) == before
        assert (found is None) == (alone is None)
        if found:
            assert found.edge == k and found.base is mode
            for name in ("order", "rows", "projection", "rate", "push", "counts", "kept", "along"):
                assert written(getattr(found, name)) == written(getattr(alone, name)), name
            assert written(found.landing.changes) == written(alone.landing.changes)
            assert written(found.near.moved.tolist()) == written(alone.near.moved.tolist())
            assert found.near.impact == alone.near.impact
            assert [(e.surface, when) for e, when in found.further] == [(e.surface, when) for e, when in alone.further]
    assert shared_by > len(mode.edges) // 3  # names change their order from 9 to 10
