"""Intervals of time on which a switch's argument is monotone or meets no level, as proved by enclosures.

The ranges of the argument and of its slope are enclosed on many intervals at once, and an interval is halved until it
meets no level, or has one slope and bounds; what is then left is shorter than the tie of times, or seems to have no
values. Enclosures are outward rounded (`hsdsl.base.numbers.enclosures`).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from hsdsl.base import limits
from hsdsl.base.errors import UsageError
from hsdsl.base.numbers.arithmetic import DOMAIN_ERRORS, Number
from hsdsl.base.numbers.enclosures import Range, as_range
from hsdsl.engine.kernel import Kernel, Routine
from hsdsl.mathematics.program import Switch

Array = np.ndarray[Any, Any]
Found = list[tuple[int, Number, Number]]  # the number of the part, and two times in it
UNDER_WAY = 8  # intervals for each change that the limit allows
NO_VALUE = 2.0**-10  # of the run: an interval without values at its ends and middle is taken to have none
STILL = 2.0**-1000  # a slope below this is none


class Part(Protocol):
    """A part of the time, and what routines are bound to on it."""

    @property
    def start(self) -> Number: ...
    @property
    def end(self) -> Number: ...
    @property
    def data(self) -> tuple[Number, ...]: ...


@dataclass(frozen=True)
class Argument:
    """What a switch of a program is the floor or the sign of; two changes within ``tie`` are one."""

    kernel: Kernel
    switch: Switch
    index: int
    tie: Number

    def argument(self, part: Part) -> Routine:
        """The routine of time on a part, with its derivative."""
        return self.kernel.switching(part.data)[f"argument_{self.index}"]


def check(left: float) -> None:
    """Refuse to look for more changes than the limit allows."""
    if left < 0:
        most = limits.current().switches
        raise UsageError(
            f"floor, sign, abs, min, max or atan2 of time switches more than {most} times in this run",
            f"make the run shorter, or allow more with --limit switches={10 * most}",
        )


def isolated(argument: Argument, parts: Sequence[Part]) -> tuple[Found, Found]:
    """Intervals on which the argument is monotone and meets a level, and those that nothing is proved of."""
    enclosed, tie = _Enclosed.of(argument, [part.data for part in parts]), float(argument.tie)
    low, high = (np.array([float(getattr(part, name)) for part in parts]) for name in ("start", "end"))
    owner, whole, most = np.arange(len(parts)), float(high[-1]), UNDER_WAY * limits.current().switches
    monotone: Found = []
    unsure: Found = []

    def given(chosen: Array) -> Iterator[tuple[int, Number, Number]]:
        for k in np.flatnonzero(chosen):
            number = int(owner[k])
            yield number, *_within(parts[number], low[k], high[k])

    while len(low):
        check(most - len(low))
        meets, one_way, nothing = enclosed.looked_at(low, high, owner)
        narrow = (high - low <= tie) | ~((low + high) / 2 > low)
        one_way[one_way] = [all(_has_value(argument, parts[k], t) for t in ends) for k, *ends in given(one_way)]
        lost = meets & ~one_way & (narrow | (nothing & (high - low <= NO_VALUE * whole)))
        monotone += given(one_way)
        unsure += given(lost)
        rest = meets & ~one_way & ~lost
        low, high, owner = low[rest], high[rest], np.tile(owner[rest], 2)
        middle = (low + high) / 2
        low, high = np.concatenate([low, middle]), np.concatenate([middle, high])
    return monotone, list(_joined(unsure))


def decided(argument: Argument, places: Sequence[tuple[Part, Number]]) -> list[bool]:
    """Whether the argument is off its levels by more than round-off at times, or stays on one."""
    enclosed = _Enclosed.of(argument, [part.data for part, _ in places])
    times = np.array([float(t) for _, t in places])
    meets, still = enclosed.on_level(times, np.arange(len(places)))
    return (~meets | still).tolist()


@dataclass(frozen=True)
class _Enclosed:
    """A switch's argument over ranges; row i of ``below`` and ``above`` encloses the data of part i."""

    argument: Argument
    below: Array
    above: Array

    @classmethod
    def of(cls, argument: Argument, data: Sequence[tuple[Number, ...]]) -> _Enclosed:
        rows = np.array([[float(a) for a in row] for row in data])
        exact = argument.kernel.arithmetic.digits is None
        return cls(argument, *((rows, rows) if exact else (np.nextafter(rows, -np.inf), np.nextafter(rows, np.inf))))

    def _at(self, t: Range, owner: Array) -> tuple[Range, Range]:
        columns = [Range(self.below[owner, i], self.above[owner, i]) for i in range(self.below.shape[1])]
        routine = self.argument.kernel.enclosed_switching(columns)[f"argument_{self.argument.index}"]
        value, slope = map(as_range, routine(t))
        return _spread(value, len(owner)), _spread(slope, len(owner))

    def _meets(self, value: Range) -> Array:
        if self.argument.switch.kind == "sign":
            return (value.low <= 0) & (value.high >= 0)
        return np.ceil(value.low) <= np.floor(value.high)

    def looked_at(self, low: Array, high: Array, owner: Array) -> tuple[Array, Array, Array]:
        """Whether the argument may meet a level, whether it does, one way, and whether it seems to have no value."""
        with np.errstate(all="ignore"):
            along, middle = Range(low, high), Range((low + high) / 2, (low + high) / 2)
            value, slope = self._at(along, owner)
            centre = self._at(middle, owner)[0]
            mean = centre + slope * (along - middle)
            meets = self._meets(Range(np.fmax(value.low, mean.low), np.fmin(value.high, mean.high)))
            meets &= ~_still(slope)
            bounded = _bounded(value)  # no pole is inside
            one_way = meets & bounded & ((slope.low > 0) | (slope.high < 0))
            nothing = ~bounded & ~_bounded(centre)
            for end in (low, high):
                nothing[nothing] = ~_bounded(self._at(Range(end[nothing], end[nothing]), owner[nothing])[0])
            return meets, one_way, nothing

    def on_level(self, t: Array, owner: Array) -> tuple[Array, Array]:
        """Whether the argument may be on a level at times, and whether it has no slope there."""
        with np.errstate(all="ignore"):
            value, slope = self._at(Range(t, t), owner)
            return self._meets(value) & _bounded(value), _still(slope)


def _still(slope: Range) -> Array:
    return (np.abs(slope.low) <= STILL) & (np.abs(slope.high) <= STILL)


def _bounded(value: Range) -> Array:
    return np.isfinite(value.low) & np.isfinite(value.high)


def _spread(value: Range, count: int) -> Range:
    return Range(np.broadcast_to(value.low, count), np.broadcast_to(value.high, count))


def _within(part: Part, low: float, high: float) -> tuple[Number, Number]:
    """Two times as numbers of the run, in a part."""
    zero = part.start * 0
    return max(part.start, zero + float(low)), min(part.end, zero + float(high))


def _has_value(argument: Argument, part: Part, t: Number) -> bool:
    try:
        return argument.kernel.arithmetic.isfinite(argument.argument(part)(t)[0])
    except DOMAIN_ERRORS:
        return False


def _joined(intervals: Found) -> Iterator[tuple[int, Number, Number]]:
    """Join neighbours."""
    before: tuple[int, Number, Number] | None = None
    for owner, low, high in sorted(intervals):
        if before is not None and before[0] == owner and low <= before[2]:
            low = before[1]
        elif before is not None:
            yield before
        before = owner, low, high
    if before is not None:
        yield before
