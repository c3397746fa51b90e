"""Compiled Taylor coefficients against those of the Python kernel: the same to the bit, and none at the same points."""

from __future__ import annotations

from functools import cache
from itertools import product
from typing import Any

import pytest
from engines import bits, needs_compiler
from hypothesis import given, settings
from hypothesis import strategies as st
from property.test_compiled_kernel import EXPRESSIONS, NUMBERS, ONE, SPECIAL, TWO, both_kernels

from hsdsl.base.numbers.arithmetic import DOMAIN_ERRORS
from hsdsl.engine.kernel import Taylor

pytestmark = needs_compiler
STATES = 1, 2  # lines


MODE = """
  m{0}:
    flow: {{x: "{1}", v: "1 - x*v/4"}}
    domain: ["{2} <= v", "abs(x) <= 10", "x*{2} >= t"]"""


def kernels(*each: tuple[str, str]) -> list[tuple[Taylor, Taylor]] | None:
    """The series of a mode for each flow and surface, by either kernel; None where one is refused or kinked."""
    if (made := both_kernels(MODE, *each)) is None:
        return None
    *both, data = made
    found = [(both[0].taylor(k, data), both[1].taylor(k, data)) for k in range(len(each))]
    assert all((one is None) == (other is None) for one, other in found)
    pairs = [(one, other) for one, other in found if one is not None and other is not None]
    return pairs if len(pairs) == len(each) else None


def outcome(taylor: Taylor, order: int, point: tuple[float, ...]) -> object:
    """All lines of the flow and all surfaces, to the bit; None in place of what has no value."""
    try:
        lines = taylor.flow(order, point[0], point[1:])
    except DOMAIN_ERRORS:
        return None
    try:
        surfaces = taylor.surfaces(order, lines)
    except DOMAIN_ERRORS:
        return [bits(line) for line in lines], None
    return [bits(line) for line in lines], [row and bits(row) for row in surfaces]


def stored(expected: Any, compiled: Any) -> Any:
    """The compiled outcome, with the other's lines behind those of states where nothing reads a line: C has zeros."""
    if expected is None or compiled is None:
        return compiled
    pairs = enumerate(zip(expected[0], compiled[0], strict=True))
    return [one if k not in STATES and not any(two) else two for k, (one, two) in pairs], compiled[1]


def assert_alike(both: tuple[Taylor, Taylor], points: list[tuple[float, ...]], order: int) -> int:
    """How many points had values everywhere."""
    found = [outcome(both[0], order, point) for point in points]
    for point, expected in zip(points, found, strict=True):
        assert stored(expected, outcome(both[1], order, point)) == expected, point
    return sum(one is not None for one in found)


@settings(max_examples=30, deadline=None)
@given(
    EXPRESSIONS,
    EXPRESSIONS,
    st.lists(st.tuples(NUMBERS, NUMBERS, NUMBERS), min_size=20, max_size=20),
    st.integers(4, 20),
)
def test_random_series_agree_at_any_point(flow, surface, points, order):
    for both in kernels((flow, surface)) or ():
        assert_alike(both, points, order)


SMOOTH = [*(f"{name}(x)" for name in ONE), *(f"{name}(x, v)" for name in TWO if name not in ("min", "max"))]
SMOOTH = [text for text in SMOOTH if not text.startswith(("abs", "sign", "floor", "heaviside"))]
SMOOTH += ["x**v", "x/v", "x**9", "x**-3", "x**0.5", "x**-1.5", "x**(a*20)", "(x - 0.5)**(a/0.07)", "-x*v", "x*x*v*v"]
SMOOTH += ["sin(3*t)*x", "t*x", "(t**2 - 1)*exp(x)", "x/(1 + t)", "1/(t**3 + x)", "1/(2 - t**2)", "cos(t**2)", "t**a"]
SMOOTH += ["sqrt(t)", "u*x", "sin(u)", "exp(a)*x", "3", "x**2 + sin(x**2)", "atan2(t, x)", "log(1 + t)"]


@cache
def smooth() -> list[tuple[Taylor, Taylor]]:
    """The series of all of them, compiled together."""
    found = kernels(*((text, text) for text in SMOOTH))
    assert found is not None
    return found


@pytest.mark.parametrize("text", SMOOTH)
def test_each_operation_agrees_at_special_points(text):
    both = smooth()[SMOOTH.index(text)]
    points = [(0.25, x, v) for x, v in product(SPECIAL, SPECIAL)]
    points += [(t, x, 0.75) for t, x in product((0.0, -0.5, 2.0), (0.5, 1.25, -0.25, 3.5))]
    assert assert_alike(both, points, 12) > 0
    assert assert_alike(both, points[-12:], 4) > 0


def test_constants_without_a_value_leave_no_coefficients():
    point, pole = (0.0, 1.0, 1.0), "(a - 7/20)"
    found = kernels((f"x/{pole}", "v"), ("x", f"v/{pole}"))
    assert found is not None
    in_flow, in_surface = found
    for taylor in in_flow:
        assert outcome(taylor, 8, point) is None
    for taylor in in_surface:
        found = outcome(taylor, 8, point)
        assert isinstance(found, tuple) and found[1] is None
