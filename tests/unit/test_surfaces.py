"""Where a step crossed a surface: roots to round-off, the last up-crossing, sizes of round-off."""

from __future__ import annotations

import math
from fractions import Fraction

import pytest

from hsdsl.base.numbers.arithmetic import FLOAT64, multiprecision
from hsdsl.engine.simulate.relaxed import last_up_crossing
from hsdsl.engine.simulate.surfaces import at, close_bracket, roundoff, shortened

ROOTS = {
    "line": (lambda s: s - 0.3, 0.3),
    "steep": (lambda s: math.expm1(20 * (s - 0.7)), 0.7),
    "flat": (lambda s: (s - 0.6) ** 3, 0.6),
    "down and up": (lambda s: (s - 0.2) * (s - 0.8), 0.8),
    "up, down and up": (lambda s: (s - 0.1) * (s - 0.4) * (s - 0.9), 0.9),
}


@pytest.mark.parametrize("name", ROOTS)
def test_the_last_up_crossing_is_found(name):
    value, root = ROOTS[name]
    found = last_up_crossing(value, 0.0, FLOAT64)
    assert abs(found - root) <= (1e-5 if name == "flat" else 4 * 2.0**-53 + 1e-15)


def test_positive_all_along_has_no_up_crossing():
    assert last_up_crossing(lambda s: 1 + s, 0.0, FLOAT64) is None


def test_roots_come_from_inside():
    """The bracket's inner end is returned, so that a point found on a surface is not beyond it."""
    f = lambda s: s * s - 0.5  # noqa: E731
    found = close_bracket(f, (0.0, -0.5), (1.0, 0.5), 0.0, 2.0**-53)
    assert f(found) <= 0 and f(found + 4 * 2.0**-53) > 0


def test_fifty_digits_are_fifty_digits():
    arithmetic = multiprecision(50)
    third = arithmetic.constant(Fraction(1, 3))
    found = last_up_crossing(lambda s: s * s * s - third, arithmetic.zero, arithmetic)
    assert abs(found**3 - third) < arithmetic.constant(Fraction(1, 10**48))


def test_roundoff_is_32_units_of_the_parts():
    u = 2.0**-53
    assert roundoff(u, 28.0, (0.0, 1.0, -3.0), 5.0, (14.0, 2.0), (0.0, 0.0)) == 32 * u * (28 + 14 + 6)
    assert roundoff(u, 0.0, (0.0, 1.0), 5.0, (1e-18,), (2.0,)) == 32 * u * 2


def test_shortened_pieces_are_the_same_curve():
    x, piece = (1.0, 2.0), ((3.0, -1.0), (0.5, 4.0), (-2.0, 0.25))
    short = shortened(piece, 0.375)
    for s in (0.0, 0.25, 0.5, 1.0):
        assert at(x, short, s) == pytest.approx(at(x, piece, 0.375 * s), rel=1e-15)
