# pyright: basic
"""Points and searches as people read them."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

from hsdsl.language.system import TIME, Mode
from hsdsl.mathematics.decisions.dynamics import Dynamics
from hsdsl.mathematics.decisions.question import Answer

MOST_NAMES = 8


def at(dynamics: Dynamics, mode: Mode, answer: Answer, about: Iterable[Any]) -> str:
    """``at x = 14, v = 0``: the states of a point that expressions depend on; time and inputs where they do."""
    needed = {s for expr in about if expr is not None for s in expr.free_symbols}
    order = [s for s in dynamics.ranges(mode) if s in needed]
    parts = [f"{s.name} = {number(answer.point[s])}" for s in order if s in answer.point and s is not TIME]
    parts = [*parts[:MOST_NAMES], *(["..."] if len(parts) > MOST_NAMES else [])]
    if TIME in order:
        parts.append(f"t = {number(answer.point[TIME])}")
    return f"at {', '.join(parts)}" if parts else "everywhere"


def number(value: float) -> str:
    """Six digits; what is within round-off of a shorter number as that."""
    if abs(value) < 1e-12:
        return "0"
    return f"{value:.6g}"


def within(searched: Iterable[tuple[Any, float, float]]) -> str:
    """Say within which bounds something is known, as `` within |x| <= 10``; empty where it holds without bounds."""
    limits = ", ".join(_limits(s.name, low, high) for s, low, high in searched)
    return f" within {limits}" if limits else ""


def _limits(name: str, low: float, high: float) -> str:
    if low == -high:
        return f"|{name}| <= {number(high)}"
    if math.isinf(low):
        return f"{name} <= {number(high)}"
    return f"{name} >= {number(low)}" if math.isinf(high) else f"{number(low)} <= {name} <= {number(high)}"
