"""A thermostat with hysteresis: exponentials between two temperatures."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from hsdsl.base.errors import UsageError
from hsdsl.engine.execution import Execution, Verdict
from references.closed_form import ClosedForm, as_execution
from references.interpolation import Number, Stretch, Vector, mp, number

SOURCE = "closed form: exponentials, and logarithms for the times between switches"
DEGREE = 8
STATES = {"heating": ("T",), "idle": ("T",)}


@dataclass(frozen=True)
class Room:
    """T' = rate (heater - T) while heating, up to ``high``; rate (outside - T) while idle, down to ``low``."""

    rate: Number
    outside: Number
    heater: Number
    low: Number
    high: Number


def thermostat(
    start: Any = 20,
    *,
    rate: Any = "0.1",
    outside: Any = 10,
    heater: Any = 30,
    low: Any = 18,
    high: Any = 22,
    until: Any = 24,
) -> Execution:
    """A thermostat that starts heating at a temperature, exactly.

    Parameters
    ----------
    start, rate, outside, heater, low, high : int, float or str
        Temperatures with outside < low < high < heater, start at most high, and a positive rate; text is taken as
        decimals, exactly.
    until : int, float or str
        End of the execution.

    Returns
    -------
    Execution
        In modes ``heating`` and ``idle`` with state ``T``; ``settings["error"]`` bounds its error at any time.

    Raises UsageError: a number is out of range.
    """
    named = {"rate": rate, "outside": outside, "heater": heater, "low": low, "high": high}
    room = Room(**{name: number(value, name) for name, value in named.items()})
    first, end = number(start, "start"), number(until, "until")
    ordered = room.outside < room.low < room.high < room.heater
    if not (ordered and first <= room.high and room.rate > 0 and end >= 0):
        raise UsageError(
            "a thermostat needs outside < low < high < heater, a start up to high, a positive rate, until not below 0"
        )
    slowest = room.rate * min(room.heater - room.high, room.low - room.outside)
    verdict = Verdict("holds", (f"every switch is crossed at a rate of at least {float(slowest):.4g}",))
    found = list(_stretches(room, first, end))
    scene = ClosedForm("thermostat.yaml", "Thermostat with hysteresis", SOURCE, STATES, found, verdict, DEGREE)
    return as_execution(scene)


def _stretches(room: Room, x: Number, until: Number) -> Iterator[Stretch]:
    start, heating = mp.mpf(0), True
    while True:
        limit, level = (room.heater, room.high) if heating else (room.outside, room.low)
        end = start + mp.log((limit - x) / (limit - level)) / room.rate
        at, bounds = _exponential(start, x, limit, room.rate)
        mode, edge = ("heating", "switch_off") if heating else ("idle", "switch_on")
        if end > until:
            yield Stretch(mode, start, until, (x,), at(until), at, bounds)
            return
        yield Stretch(mode, start, end, (x,), (level,), at, bounds, edge)
        start, x, heating = end, level, not heating


def _exponential(start: Number, x: Number, limit: Number, rate: Number) -> tuple[Any, Any]:
    def at(t: Number) -> Vector:
        return (limit + (x - limit) * mp.exp(-rate * (t - start)),)

    def bounds(n: int) -> Vector:
        return (abs(x - limit) * rate**n,)

    return at, bounds
