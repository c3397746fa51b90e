"""A driven mass that bounces: x'' = u + w - 2 - sin(3 t) above x = 0, v -> -v/2, in closed form between bounces.

u is the line through (0, 0), (0.31, 1), (0.97, -1), then -1; w is 0, and 2 from t = 1.23 on. Twice integrated from 0
they are cubics piece by piece; bounces are roots of the sum, to forty digits.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import mpmath as mp
import numpy as np

# (from, value there, slope) of u + w - 2
LINES = [("0", "-2", "1/0.31"), ("0.31", "-1", "-2/0.66"), ("0.97", "-3", "0"), ("1.23", "-1", "0")]
UNTIL = 2.0


@lru_cache
def integrals() -> list[tuple[mp.mpf, list[mp.mpf]]]:
    """Pieces (from, [a, b, c, d]) of the double integral of u + w - 2: a + b s + c s^2 + d s^3."""
    pieces, x, v = [], mp.mpf(0), mp.mpf(0)
    starts = [mp.mpf(start) for start, _, _ in LINES]
    for (_, value, slope), start, end in zip(LINES, starts, [*starts[1:], mp.mpf(10)], strict=True):
        top, _, bottom = slope.partition("/")
        f, g = mp.mpf(value), mp.mpf(top) / mp.mpf(bottom or "1")
        pieces.append((start, [x, v, f / 2, g / 6]))
        s = end - start
        x, v = x + v * s + f / 2 * s**2 + g / 6 * s**3, v + f * s + g / 2 * s**2
    return pieces


def drift(t: Any, m: Any = mp) -> tuple[Any, Any]:
    """Double and single integral of the driving from 0 to t."""
    number = mp.mpf if m is mp else float
    if m is mp:
        start, (a, b, c, d) = [piece for piece in integrals() if piece[0] <= t][-1]
    else:
        which = np.searchsorted([float(start) for start, _ in integrals()], t, side="right") - 1
        table = np.array([[float(start), *map(float, cubic)] for start, cubic in integrals()])
        start, a, b, c, d = table[which].T
    s = t - start
    x, v = a + s * (b + s * (c + s * d)), b + s * (2 * c + s * 3 * d)
    return x + m.sin(3 * t) / number(9) - t / number(3), v + m.cos(3 * t) / number(3) - 1 / number(3)


@lru_cache
def flights() -> list[tuple[mp.mpf, mp.mpf, mp.mpf]]:
    """Flights (from, x0, v0), x = x0 + v0 t + drift, up to the end."""
    with mp.workdps(40):
        found = [(mp.mpf(0), mp.mpf(1) / 2, mp.mpf(0))]
        while True:
            start, x0, v0 = found[-1]
            times = np.arange(float(start) + 1e-6, UNTIL, 1e-4)
            below = np.flatnonzero(float(x0) + float(v0) * times + drift(times, np)[0] < 0)
            if not len(below):
                return found
            near = mp.mpf(float(times[below[0]]))
            hit = mp.findroot(lambda t, x0=x0, v0=v0: x0 + v0 * t + drift(t)[0], near, tol=1e-60)
            after = -(v0 + drift(hit)[1]) / 2 - drift(hit)[1]
            found.append((hit, -after * hit - drift(hit)[0], after))


def forced(t: Any) -> dict[str, Any]:
    """Position at float times (the velocity jumps, so errors of it mean little near a bounce)."""
    table = np.array([[float(y) for y in flight] for flight in flights()])
    _, x0, v0 = table[np.searchsorted(table[:, 0], t, side="right") - 1].T
    return {"x": x0 + v0 * t + drift(np.asarray(t, dtype=float), np)[0]}
