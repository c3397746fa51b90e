"""The tables check themselves; the step functions written from them do what the tables say."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

import pytest

from hsdsl.base.numbers.arithmetic import FLOAT64, multiprecision
from hsdsl.engine.integrators import INTEGRATORS
from hsdsl.engine.integrators.stepper import hermite, stepper
from hsdsl.engine.integrators.tableau import density, nodes, trees

ARITHMETICS = [FLOAT64, multiprecision(40)]


def field(t, x, v):
    return (v, t - x * v)


def roundoff(table, arithmetic):
    """A few rounding errors of the largest weight, or of the digits that a table has."""
    largest = max((abs(w) for row in table.dense or () for w in row), default=1)
    digits = 0 if table.digits is None else 10.0**-table.digits
    return 8 * max(1, float(largest)) * (arithmetic.unit + digits)


def by_the_book(table, arithmetic, t, h, x):
    """The textbook loop over stages."""
    number = arithmetic.constant
    stages = []
    for i in range(table.stages):
        at = [
            a + h * sum((number(w) * k[s] for w, k in zip(table.a[i], stages, strict=True)), arithmetic.zero)
            for s, a in enumerate(x)
        ]
        stages.append(field(t + number(table.c[i]) * h, *at))
    total = [sum((number(w) * k[s] for w, k in zip(table.b, stages, strict=True)), arithmetic.zero) for s in (0, 1)]
    return tuple(a + h * b for a, b in zip(x, total, strict=True)), stages


@pytest.mark.parametrize("size, count", [(1, 1), (2, 1), (3, 2), (4, 4), (5, 9), (6, 20)])
def test_rooted_trees_are_counted_as_cayley_did(size, count):
    assert len(trees(size)) == count
    assert all(nodes(tree) == size for tree in trees(size))


def test_density_of_the_tall_tree_is_the_factorial():
    assert density(((((),),),)) == 24


@pytest.mark.parametrize("table", INTEGRATORS.values(), ids=lambda t: t.name)
def test_a_wrong_weight_does_not_survive(table):
    wrong = (table.b[0] + Fraction(1, 10**12), *table.b[1:])
    with pytest.raises(ValueError, match="order condition"):
        replace(table, b=wrong)


@pytest.mark.parametrize("table", INTEGRATORS.values(), ids=lambda t: t.name)
def test_no_table_has_a_higher_order_than_it_says(table):
    with pytest.raises(ValueError, match="order condition"):
        replace(table, order=table.order + 1, embedded=None)


def test_wrong_shapes_are_refused():
    with pytest.raises(ValueError, match="triangle"):
        replace(INTEGRATORS["midpoint"], a=((), ()))
    dopri5 = INTEGRATORS["dopri5"]
    with pytest.raises(ValueError, match="embedded"):
        replace(dopri5, embedded=tuple(reversed(dopri5.embedded)))
    with pytest.raises(ValueError, match="dense"):
        replace(dopri5, dense=tuple(reversed(dopri5.dense)))


@pytest.mark.parametrize("arithmetic", ARITHMETICS, ids=lambda a: a.name)
@pytest.mark.parametrize("table", INTEGRATORS.values(), ids=lambda t: t.name)
def test_written_steps_follow_the_table(table, arithmetic):
    t, h = (arithmetic.constant(Fraction(n, 10)) for n in (3, 1))
    x = (arithmetic.constant(Fraction(1, 3)), arithmetic.constant(Fraction(-5, 7)))
    expected, stages = by_the_book(table, arithmetic, t, h, x)
    written = stepper(table, 2, arithmetic)
    z, k = written.step(field, t, h, x, field(t, *x))
    assert max(abs(a - b) for a, b in zip(z, expected, strict=True)) <= roundoff(table, arithmetic)
    assert len(k) == table.stages - table.last_is_next
    if written.error is not None:
        error = written.error(h, k, field(t + h, *z))
        for s in (0, 1):
            by_hand = difference(table, table.embedded, arithmetic, h, stages, s)
            if table.coarse is not None:
                other = difference(table, table.coarse, arithmetic, h, stages, s)
                by_hand = by_hand**2 / arithmetic.sqrt(by_hand**2 + other**2 / 100)
            assert abs(abs(error[s]) - abs(by_hand)) <= roundoff(table, arithmetic)


def difference(table, embedded, arithmetic, h, stages, s):
    """The method less an embedded one, for one state."""
    weights = [arithmetic.constant(b - e) for b, e in zip(table.b, embedded, strict=True)]
    return h * sum((w * stage[s] for w, stage in zip(weights, stages, strict=True)), arithmetic.zero)


@pytest.mark.parametrize("arithmetic", ARITHMETICS, ids=lambda a: a.name)
@pytest.mark.parametrize("table", INTEGRATORS.values(), ids=lambda t: t.name)
def test_pieces_join_the_ends_of_the_step(table, arithmetic):
    t, h = (arithmetic.constant(Fraction(n, 10)) for n in (3, 1))
    x = (arithmetic.constant(Fraction(1, 3)), arithmetic.constant(Fraction(-5, 7)))
    written = stepper(table, 2, arithmetic)
    z, k = written.step(field, t, h, x, field(t, *x))
    piece = written.piece(field, t, h, x, z, k, field(t, *x), field(t + h, *z))
    for s in (0, 1):
        assert abs(x[s] + sum((c[s] for c in piece), arithmetic.zero) - z[s]) <= roundoff(table, arithmetic)


def test_hermite_reproduces_cubics():
    def cubic(s):
        return 1 + 2 * s - 3 * s**2 + 5 * s**3

    def slope(s):
        return 2 - 6 * s + 15 * s**2

    a, h = Fraction(1, 3), Fraction(1, 2)
    piece = hermite(h, (cubic(a),), (cubic(a + h),), (slope(a),), (slope(a + h),))
    for s in (Fraction(1, 7), Fraction(1, 2), Fraction(9, 10)):
        value = cubic(a) + sum(c[0] * s ** (m + 1) for m, c in enumerate(piece))
        assert value == cubic(a + s * h)


@pytest.mark.parametrize("table", INTEGRATORS.values(), ids=lambda t: t.name)
def test_no_states_is_a_dimension_too(table):
    written = stepper(table, 0, FLOAT64)
    z, k = written.step(lambda t: (), 0.0, 0.5, (), ())
    assert z == () and written.piece(lambda t: (), 0.0, 0.5, (), z, k, (), ())[0] == ()
