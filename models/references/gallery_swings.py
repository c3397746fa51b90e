"""Exact executions of the gallery's swings: waves between contacts, turns and levels."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from itertools import pairwise
from typing import Any

from hsdsl.engine.execution import Execution, Verdict
from references.closed_form import ClosedForm, as_execution
from references.interpolation import Number, Stretch, mp
from references.terms import Terms, polynomial, stretch, wave

SLIDING = "(sliding)"


def _exact(name: str, states: dict[str, tuple[str, ...]], found: list[Stretch], left: str = "") -> Execution:
    verdict = Verdict("left", (left,)) if left else Verdict("holds", ())
    return as_execution(ClosedForm(f"{name}.yaml", name, "closed form", states, found, verdict, 8))


def swing(w: Any, x: Any, v: Any, centre: Any = 0) -> tuple[Terms, Terms]:
    """Position and speed of x'' = -w^2 (x - centre)."""
    place = wave(w, x, v, centre)
    return place, place.derivative()


def against_a_stop(name: str, w: Any, c: Any, stop: Any, until: Any) -> Execution:
    """A mass from x = 0 at speed 1, whose speed a stop turns back by the factor -c."""
    w, c, stop, end = (mp.mpf(a) for a in (w, c, stop, until))
    start, x, v, found = mp.zero, mp.zero, mp.one, list[Stretch]()
    while True:
        functions, size = swing(w, x, v), mp.sqrt(x**2 + (v / w) ** 2)
        if size <= stop:
            break
        t = start + mp.fmod(mp.acos(stop / size) * -1 + mp.atan2(v / w, x) + 2 * mp.pi, 2 * mp.pi) / w
        if t > end:
            break
        speed = w * mp.sqrt(size**2 - stop**2)
        found.append(stretch("free", start, t, functions, "impact", last=(stop, speed)))
        start, x, v = t, stop, -c * speed
    found.append(stretch("free", start, end, functions))
    touched = "it touches the stop at speed zero" if stop * w == 1 else ""
    return _exact(name, {"free": ("x", "v")}, found, touched)


def two_crossings() -> Execution:
    """Above the level from asin(level) to pi - asin(level), in each turn."""
    level, end = mp.mpf("0.99"), mp.mpf(60)
    rises, width, found = mp.asin(level), 2 * mp.acos(level), list[Stretch]()
    times = [mp.zero]
    while times[-1] < end:
        turn = 2 * mp.pi * (len(times) // 2)
        times.append(min(end, turn + (rises if len(times) % 2 else rises + width - 2 * mp.pi)))
    for k, (start, t) in enumerate(pairwise(times)):
        above, y = k % 2, width * (k // 2)
        functions = (*swing(1, mp.sin(start), mp.cos(start)), polynomial(y, above))
        edge = None if t == end else ("rises", "falls")[above]
        found.append(stretch(("below", "above")[above], start, t, functions, edge))
    return _exact("two-crossings", dict.fromkeys(("below", "above"), ("x", "v", "y")), found)


def dry_friction() -> Execution:
    """Half turns about -1 and 1 in turn, up to the turn from which friction holds the mass."""
    start, x, v, sign, found = mp.zero, mp.mpf(12), mp.mpf(6), 1, list[Stretch]()
    end, names = mp.mpf(30), {1: ("right", "turns_left"), -1: ("left", "turns_right")}
    while not (v == 0 and abs(x) < 1):
        centre = -sign
        size = mp.sqrt((x - centre) ** 2 + v**2)
        t = start + (mp.atan2(v, x - centre) if start == 0 else mp.pi)
        mode, edge = names[sign]
        last = (centre + sign * size, mp.zero)
        found.append(stretch(mode, start, t, swing(1, x, v, centre), edge, last=last))
        start, (x, v), sign = t, last, -sign
    found.append(stretch(SLIDING, start, end, (polynomial(x), polynomial(0))))
    return _exact("dry-friction", dict.fromkeys(("right", "left", SLIDING), ("x", "v")), found, "it sticks")


def stiff_contact() -> Execution:
    """Flights at speed 1, contacts as a wave about -1/c that give the speed back."""
    w, end, found = mp.mpf(1000), mp.mpf(8), list[Stretch]()
    contact = 2 * (mp.pi - mp.atan(w)) / w
    start, h, v = mp.zero, mp.mpf(1) / 2, mp.zero
    while True:
        t: Number = start + v + 1
        down = polynomial(h, v, -mp.mpf(1) / 2), polynomial(v, -1)
        if t > end:
            found.append(stretch("flight", start, end, down))
            return _exact("stiff-contact", dict.fromkeys(("flight", "contact"), ("h", "v")), found)
        found.append(stretch("flight", start, t, down, "touch", last=(mp.zero, -mp.one)))
        start = t + contact
        pressed = swing(w, 0, -1, -(w**-2))
        found.append(stretch("contact", t, start, pressed, "release", last=(mp.zero, mp.one)))
        h, v = mp.zero, mp.one


SWINGS: dict[str, Callable[[], Execution]] = {
    "grazing": partial(against_a_stop, "grazing", 1, "0.5", 1, 8),
    "grazing-hit": partial(against_a_stop, "grazing-hit", 1, "0.5", "0.999999", 8),
    "grazing-miss": partial(against_a_stop, "grazing-miss", 1, "0.5", "1.000001", 8),
    "nanoseconds": partial(against_a_stop, "nanoseconds", "1e9", "0.9", "5e-10", "2e-8"),
    "two-crossings": two_crossings,
    "dry-friction": dry_friction,
    "stiff-contact": stiff_contact,
}
