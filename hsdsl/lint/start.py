# pyright: basic
"""Where a run starts relative to a surface, and what the flow does next."""

from __future__ import annotations

from typing import Any

import sympy as sp

from hsdsl.expression import numeric
from hsdsl.expression.scope import symbol
from hsdsl.lint.numbers import ROUND_OFF, Point, evaluate
from hsdsl.lower.straight import lie_derivative
from hsdsl.system import Mode, Surface

INSIDE, ON, BEYOND = -1, 0, 1
_DEEPEST = 4  # derivatives along the flow that are looked at


def side(surface: Surface, point: Point) -> int | None:
    """Whether a point is inside, on (within round-off) or beyond a surface; None where it has no value there."""
    residual = evaluate(surface.residual, point)
    if not numeric.finite(residual):
        return None
    size = abs(evaluate(surface.left, point)) + abs(evaluate(surface.right, point))
    if abs(residual) <= ROUND_OFF * size:
        return ON
    return BEYOND if residual > 0 else INSIDE


def leaves(mode: Mode, surface: Surface, point: Point) -> bool | None:
    """Whether the flow carries a point of a surface beyond it; None where low derivatives do not decide it.

    The sign is that of the first of L_f r, L_f^2 r, ... that is not 0 within round-off. Sampled inputs
    count as constant.
    """
    rate: Any = surface.residual
    flow = dict(zip(map(symbol, mode.states), mode.flow, strict=True))
    for _ in range(_DEEPEST):
        rate = lie_derivative(rate, flow)
        value = evaluate(rate, point)
        if not numeric.finite(value):
            return None
        if abs(value) > ROUND_OFF * _size(rate, point):
            return bool(value > 0)
    return None


def _size(expr: Any, point: Point) -> Any:
    """The sum of the magnitudes of the terms."""
    return sum(abs(evaluate(term, point)) for term in sp.Add.make_args(sp.expand(expr)))
