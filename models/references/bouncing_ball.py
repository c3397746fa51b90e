"""A ball that bounces: flights of 2 v/g, to its Zeno point and past it."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from hsdsl.base.errors import UsageError
from hsdsl.engine.execution import Execution, Verdict
from references.closed_form import ClosedForm, as_execution
from references.interpolation import Number, Stretch, Vector, mp, number
from references.rests import UNRESOLVED, rest, tail

SOURCE = "closed form: flights of 2 v/g from bounce to bounce, summed to the Zeno point sqrt(2 h/g) (1 + e)/(1 - e)"


def bouncing_ball(height: Any = 10, *, g: Any = "9.81", e: Any = "0.8", until: Any = 12) -> Execution:
    """A ball dropped from rest, exactly; behind its Zeno point it lies on the ground.

    Parameters
    ----------
    height, g, e : int, float or str
        Where it starts, gravity, and restitution in (0, 1); text is taken as decimals, exactly.
    until : int, float or str
        End of the execution.

    Returns
    -------
    Execution
        In mode ``fly`` with states ``h``, ``v``; ``settings["error"]`` bounds its error at any time.

    Raises UsageError: a number is out of range.
    """
    h, g, e, end = (number(x, name) for x, name in ((height, "height"), (g, "g"), (e, "e"), (until, "until")))
    if not (h > 0 and g > 0 and 0 < e < 1 and end >= 0):
        raise UsageError("a bouncing ball needs height and g above 0, e between 0 and 1, and until not below 0")
    limit = mp.sqrt(2 * h / g) * (1 + e) / (1 - e)
    past = end > limit
    verdict = Verdict(
        "left" if past else "holds",
        (f"infinitely many bounces before t = {float(limit):.10g}; behind it the ball is at rest on the guard",)
        if past
        else (f"finitely many bounces, all before the Zeno point t = {float(limit):.10g}",),
    )
    scene = ClosedForm(
        "bouncing-ball.yaml", "Bouncing ball", SOURCE, {"fly": ("h", "v")}, list(_stretches(h, g, e, end)), verdict, 2
    )
    return as_execution(scene)


def bounces(g: Number, height: Number, e: Number) -> Iterator[tuple[Number, Number]]:
    """Give time and velocity before each bounce, without end."""
    t, v = mp.sqrt(2 * height / g), mp.sqrt(2 * g * height)
    while True:
        yield t, -v
        v = e * v
        t = t + 2 * v / g


def _stretches(height: Number, g: Number, e: Number, until: Number) -> Iterator[Stretch]:
    limit, zero = mp.sqrt(2 * height / g) * (1 + e) / (1 - e), mp.mpf(0)
    start, x, v = zero, height, zero
    for t, velocity in bounces(g, height, e):
        at, bounds = _flight(start, x, v, g)
        if t > until:
            yield Stretch("fly", start, until, (x, v), at(until), at, bounds)
            return
        yield Stretch("fly", start, t, (x, v), (zero, velocity), at, bounds, "bounce")
        start, x, v = t, zero, -e * velocity
        if limit - start <= UNRESOLVED * limit:
            break
    end = min(limit, until)
    yield tail("fly", start, end, (x, v), (zero, zero))
    if until > limit:
        yield rest("fly", limit, until, (zero, zero))


def _flight(start: Number, x: Number, v: Number, g: Number) -> tuple[Any, Any]:
    def at(t: Number) -> Vector:
        s = t - start
        return x + s * (v - g * s / 2), v - g * s

    def bounds(n: int) -> Vector:
        return {1: (abs(v) + mp.sqrt(v * v + 2 * g * x), g), 2: (g, mp.mpf(0))}.get(n, (mp.mpf(0), mp.mpf(0)))

    return at, bounds
