"""Isolation of roots against polynomials whose roots are known."""

from __future__ import annotations

from fractions import Fraction
from itertools import pairwise

import pytest
from hypothesis import assume, example, given
from hypothesis import strategies as st

from hsdsl.base.numbers.arithmetic import FLOAT64, multiprecision
from hsdsl.engine.scheme import roots as text
from hsdsl.engine.simulate.surfaces import make_roots

ROUNDING = text.ROUNDING
ROOM = make_roots(12, FLOAT64)
TINY = ROOM.unit


def bernstein(c):
    text.fill_bernstein(ROOM.binomials, c, len(c) - 1, b := [c[0]] * len(c))
    return b


def changes(b):
    return text.changes(b, len(b) - 1)


def split(b, s):
    right, left = [*b], [*b]
    text.split(right, len(b) - 1, s, left)
    return left, right


def value(c, s):
    return text.value_of(c, len(c) - 1, s)


def value_and_slope(c, s):
    return text.value_and_slope(c, len(c) - 1, s)


def rises(c, level, start, room=ROOM):
    return text.rises(room, c, len(c) - 1, 1, level, start)


def last_root(c, start, end, room=ROOM):
    return text.last_root(room, c, len(c) - 1, 0, start, end)


def from_roots(roots: list[Fraction], sign: int = 1) -> list[Fraction]:
    """Coefficients of sign * prod (s - root)."""
    c = [Fraction(sign)]
    for root in roots:
        c = [a - root * b for a, b in zip([Fraction(0), *c], [*c, Fraction(0)], strict=True)]
    return c


def test_bernstein_coefficients_of_a_line_are_its_values() -> None:
    assert bernstein([Fraction(1), Fraction(2)]) == [1, 3]
    assert bernstein([Fraction(1), Fraction(2), Fraction(0)]) == [1, 2, 3]


@given(
    st.lists(st.fractions(-2, 2, max_denominator=50), min_size=2, max_size=9), st.fractions(0, 1, max_denominator=20)
)
def test_both_parts_of_a_cut_are_the_polynomial(c: list[Fraction], s: Fraction) -> None:
    left, right = split(bernstein(c), s)
    middle = sum(a * s**k for k, a in enumerate(c))
    assert left[0] == c[0] and left[-1] == middle == right[0] and right[-1] == sum(c)


def test_changes_leave_out_zeros() -> None:
    assert changes([-1, 0, 0, 1, 2, 0, -3]) == 2
    assert changes([0, 0]) == 0


@given(st.lists(st.integers(1, 999), min_size=1, max_size=6, unique=True))
@example([500, 501])
@example([1, 2, 998, 999])
@example([1, 125, 277])  # a fall at 1/8, where intervals are cut
def test_every_rise_is_found(thousandths: list[int]) -> None:
    """Walking along the polynomial with `rises` and `last_root` meets the up-crossings and only these."""
    roots = sorted(Fraction(n, 1000) for n in thousandths)
    exact = from_roots(roots, -1 if len(roots) % 2 == 0 else 1)  # negative at 0 for an odd number of roots before it
    exact = [a if value(exact, Fraction(0)) < 0 else -a for a in exact]
    c = [float(a) for a in exact]
    down = [-a for a in c]
    found, start, noise = [], 0.0, ROUNDING * TINY * sum(map(abs, c))
    ends = [*roots, Fraction(1)]
    assume(all(abs(value(exact, (a + b) / 2)) > 2 * noise for a, b in pairwise(ends)))  # else it is lost in round-off
    while (above := rises(c, noise, start)) is not None:
        root = last_root(c, start, above)
        found.append(start if root is None else root)
        below = rises(down, 0.0, above)
        if below is None:
            break
        start = below
    assert len(found) == len(roots[::2])
    for root, expected in zip(found, map(float, roots[::2]), strict=True):
        assert abs(root - expected) <= 2 * noise / value_and_slope(c, expected)[1]


@pytest.mark.parametrize("arithmetic", [FLOAT64, multiprecision(50)], ids=lambda a: a.name)
def test_two_roots_close_together(arithmetic: object) -> None:
    """A visit of 1e-6 of the step, which no sign test at its ends could see."""
    number = arithmetic.constant  # type: ignore[attr-defined]
    c = [number(a) for a in from_roots([Fraction(3, 10), Fraction(3, 10) + Fraction(1, 10**6)], -1)]
    room, zero = make_roots(2, arithmetic), number(Fraction(0))  # type: ignore[arg-type]
    above = rises(c, zero, zero, room)
    assert above is not None
    root = last_root(c, zero, above, room)
    assert abs(root - number(Fraction(3, 10))) <= 1e-9


def test_a_touch_from_below_is_no_rise() -> None:
    c = [float(a) for a in from_roots([Fraction(1, 3), Fraction(1, 3)], -1)]
    assert rises(c, 1e-15, 0.0) is None


def test_above_all_along_has_no_root() -> None:
    assert last_root([0.5, 1.0], 0.0, 1.0) is None
    assert rises([0.5, 1.0], 0.0, 0.0) == 0.0


def test_a_root_at_the_start_belongs_to_the_start() -> None:
    assert last_root([0.0, 1.0], 0.0, 1.0) == 0.0


def test_small_roots_are_found_to_the_last_bits_of_themselves() -> None:
    c = [-1e-9 * 0.5, 0.5, 1.0]
    root = last_root(c, 0.0, 1.0)
    assert root == pytest.approx(1e-9 / (1 + 2e-9) * 1.0, rel=1e-8)
    assert abs(value(c, root)) <= 1e-24
