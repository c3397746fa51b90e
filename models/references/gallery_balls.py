"""Exact executions of the gallery's balls and spheres: parabolas and lines between contacts."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

from hsdsl.engine.execution import Execution, Verdict
from references.bouncing_ball import bounces, bouncing_ball
from references.closed_form import ClosedForm, as_execution
from references.interpolation import Number, Stretch, Vector, mp
from references.rests import UNRESOLVED, tail
from references.terms import Terms, polynomial, root, stretch

HALF = mp.mpf(1) / 2
FLY = ("h", "v")


def _exact(name: str, states: dict[str, tuple[str, ...]], found: Sequence[Stretch]) -> Execution:
    return as_execution(ClosedForm(f"{name}.yaml", name, "closed form", states, found, Verdict("holds", ()), 2))


def fall(h: Number, v: Number, g: Any = 1) -> tuple[Terms, Terms]:
    """Height and speed in free fall."""
    return polynomial(h, v, -mp.convert(g) / 2), polynomial(v, -mp.convert(g))


def instant(mode: str, t: Number, x: Vector, edge: str) -> Stretch:
    """No time between two transitions."""
    return Stretch(mode, t, t, x, x, None, lambda n: tuple(a * 0 for a in x), edge)


def _ball(name: str, e: str, until: Any) -> Execution:
    run = bouncing_ball(1, g=1, e=e, until=until)
    return replace(run, model=f"{name}.yaml", title=name)


def zeno_ball() -> Execution:
    """To 0.999 of the Zeno time 9 sqrt(2)."""
    return _ball("zeno-ball", "0.8", mp.mpf("0.999") * 9 * mp.sqrt(2))


def zeno_ball_through() -> Execution:
    """At rest from 3 sqrt(2) on."""
    return _ball("zeno-ball-through", "0.5", 8)


def rolling_ball() -> Execution:
    """Bounces with x = t, then motion along the floor."""
    limit, until, start, v = 3 * mp.sqrt(2), mp.mpf(8), mp.zero, mp.zero
    found, h = list[Stretch](), mp.one
    for t, velocity in bounces(mp.one, h, HALF):
        if limit - start <= UNRESOLVED * limit:
            break
        found.append(
            stretch("fly", start, t, (polynomial(start, 1), *fall(h, v)), "bounce", last=(t, mp.zero, velocity))
        )
        start, h, v = t, mp.zero, -HALF * velocity
    found.append(tail("fly", start, limit, (start, mp.zero, v), (limit, mp.zero, mp.zero)))
    found.append(stretch("fly", limit, until, (polynomial(limit, 1), polynomial(0), polynomial(0))))
    run = _exact("rolling-ball", {"fly": ("x", "h", "v")}, found)
    return replace(run, verdict=Verdict("left", (f"infinitely many bounces before t = {float(limit):.10g}",)))


def narrow_hole() -> Execution:
    """Elastic bounces at 1 and 3, through the hole at 5."""
    ends = [("0", "1", "bounce"), ("1", "3", "bounce"), ("3", "5", "through")]
    found: list[Stretch] = []
    for begin, end, edge in ends:
        start, x = mp.mpf(begin), mp.mpf(begin) / 10
        h, v = (HALF, mp.zero) if begin == "0" else (mp.zero, mp.one)
        functions = (polynomial(x, mp.mpf(1) / 10), *fall(h, v))
        last = (mp.mpf(end) / 10, mp.zero, -mp.one)
        found.append(stretch("above", start, mp.mpf(end), functions, edge, last=last))
    functions = (polynomial(HALF, mp.mpf(1) / 10), *fall(mp.zero, -mp.one))
    found.append(stretch("below", mp.mpf(5), mp.mpf(6), functions))
    return _exact("narrow-hole", dict.fromkeys(("above", "below"), ("x", "h", "v")), found)


def equal_balls() -> Execution:
    """Four transitions at each bounce of one ball."""
    until, start, h, v = mp.mpf(4), mp.zero, mp.one, mp.zero
    found: list[Stretch] = []
    for t, velocity in bounces(mp.one, h, HALF):
        functions = (*fall(h, v),) * 4
        if t > until:
            found.append(stretch("fly", start, until, functions))
            break
        down = (mp.zero, velocity) * 4
        found.append(stretch("fly", start, t, functions, "bounce_1", last=down))
        start, h, v = t, mp.zero, -HALF * velocity
        for k in (1, 2, 3):
            found.append(instant("fly", t, ((mp.zero, v) * k + (mp.zero, velocity) * (4 - k)), f"bounce_{k + 1}"))
    return _exact("equal-balls", {"fly": tuple(f"{s}{k}" for k in (1, 2, 3, 4) for s in "hv")}, found)


def _row(name: str, at: Sequence[Any], speeds: Sequence[Sequence[int]], edges: Sequence[str], ends: Any) -> Execution:
    """Spheres in a row that exchange speeds in one instant."""
    t, until = map(mp.mpf, ends)
    places = [mp.mpf(x) for x in at]
    met = [x + v * t for x, v in zip(places, speeds[0], strict=True)]

    def state(v: Sequence[int]) -> Vector:
        return tuple(mp.mpf(a) for pair in zip(met, v, strict=True) for a in pair)

    def lines(x: Sequence[Number], v: Sequence[int]) -> list[Terms]:
        return [term for a, b in zip(x, v, strict=True) for term in (polynomial(a, b), polynomial(b))]

    found = [stretch("row", mp.zero, t, lines(places, speeds[0]), edges[0])]
    found += [instant("row", t, state(v), edge) for v, edge in zip(speeds[1:-1], edges[1:], strict=True)]
    found.append(stretch("row", t, until, lines(met, speeds[-1])))
    return _exact(name, {"row": tuple(f"{s}{k + 1}" for k in range(len(at)) for s in "xv")}, found)


def three_spheres() -> Execution:
    """The left pair first, as in the file; either order leads to the same speeds."""
    speeds = [(1, 0, -1), (0, 1, -1), (0, -1, 1), (-1, 0, 1)]
    return _row("three-spheres", (0, 1, 2), speeds, ("left", "right", "left"), (HALF, 1))


def cascade() -> Execution:
    """The speed goes through the row in one instant."""
    speeds = [tuple(int(i == k) for i in range(4)) for k in range(4)]
    return _row("cascade", (-1, 1, 2, 3), speeds, ("first", "second", "third"), (1, 3))


def _flights(name: str, h: Number, v: Number, after: Callable[[Number], Number], until: Any) -> Execution:
    """Flights of a ball under g = 1 from bounce to bounce; ``after`` gives the speed upwards of the one it comes with.

    A bounce at the end is made.
    """

    def parts() -> Iterator[Stretch]:
        start, end, height, speed = mp.zero, mp.convert(until), h, v
        while True:
            functions, t = fall(height, speed), start + speed + mp.sqrt(speed**2 + 2 * height)
            if t > end:
                yield stretch("fly", start, end, functions)
                return
            velocity = -mp.sqrt(speed**2 + 2 * height)
            yield stretch("fly", start, t, functions, "bounce", last=(mp.zero, velocity))
            start, height, speed = t, mp.zero, after(-velocity)
            if t == end:
                yield stretch("fly", t, t, fall(height, speed))
                return

    return _exact(name, {"fly": FLY}, list(parts()))


def half(v: Number) -> Number:
    """Restitution 1/2."""
    return HALF * v


def _clearance(height: Terms, start: Number, plate: Callable[[Number], Number], t: Number) -> Number:
    """How far a ball is above a plate."""
    return height(t - start) - plate(t)


def moving_guard() -> Execution:
    """Parabolas from the plate to the plate; impacts as roots in eighty digits between samples of a thousandth."""
    A, w, e = mp.mpf("0.05"), mp.mpf(5), mp.mpf("0.8")
    until, start, h, v = mp.mpf(6), mp.zero, mp.one, mp.zero
    found: list[Stretch] = []
    while True:
        height, speed = fall(h, v)
        above = partial(_clearance, height, start, lambda t: A * mp.sin(w * t))
        t = start + mp.mpf("1e-3")
        while above(t) > 0 and t < until:
            t += mp.mpf("1e-3")
        if t >= until:
            found.append(stretch("fly", start, until, (height, speed)))
            return _exact("moving-guard", {"fly": FLY}, found)
        t = root(above, t - mp.mpf("1e-3"), t)
        found.append(stretch("fly", start, t, (height, speed), "bounce"))
        _, came = found[-1].last
        start, h, v = t, A * mp.sin(w * t), (1 + e) * A * w * mp.cos(w * t) - e * came


BALLS: dict[str, Callable[[], Execution]] = {
    "zeno-ball": zeno_ball,
    "zeno-ball-through": zeno_ball_through,
    "rolling-ball": rolling_ball,
    "narrow-hole": narrow_hole,
    "equal-balls": equal_balls,
    "three-spheres": three_spheres,
    "cascade": cascade,
    "event-at-start": partial(_flights, "event-at-start", mp.zero, -mp.one, half, "1.6"),
    "event-at-end": partial(_flights, "event-at-end", mp.mpf(2), mp.zero, half, 2),
    "event-before-end": partial(_flights, "event-before-end", HALF, mp.zero, half, "1.00000035"),
    "restart-on-guard": partial(_flights, "restart-on-guard", HALF, mp.zero, lambda _: mp.mpf("1e-3"), "1.099"),
    "moving-guard": moving_guard,
}
