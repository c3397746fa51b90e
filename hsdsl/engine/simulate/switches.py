"""When the switches of a program change: times between which each has one number, its floor or its sign.

Of a switch that is linear in time they are computed. For any other the ranges of its argument and of the argument's
slope are enclosed, outward rounded (`hsdsl.base.numbers.enclosures`), on many intervals at once. An interval is halved
until it meets no level, or has one slope and bounds; what is then left is shorter than the tie of times, or seems to
have no values. Between the places found the switch is proved to change nowhere else, but for stretches where its
argument touches a level to round-off, which counts as no change, or has no value.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from math import ceil, floor
from typing import Any

import numpy as np

from hsdsl.base import limits
from hsdsl.base.errors import UsageError
from hsdsl.base.numbers.arithmetic import DOMAIN_ERRORS, Number
from hsdsl.base.numbers.enclosures import Range, as_range
from hsdsl.engine.kernel import Kernel, Routine
from hsdsl.engine.simulate.input_segments import Segment
from hsdsl.engine.simulate.surfaces import close_bracket
from hsdsl.mathematics.program import Switch

Stretch = tuple[Number, Number]
Cuts = tuple[list[Number], list[Stretch]]  # where the number changes, and stretches that nothing is proved of


@dataclass(frozen=True)
class SwitchPiece:
    """A part of a part, a time in it at which its number is certain, and its number; None where there is none."""

    part: Segment
    start: Number
    end: Number
    at: Number
    number: Number | None = None


@dataclass(frozen=True)
class Changes:
    """Finds the changes of one switch, of the floor or the sign of its argument; two within ``tie`` are one."""

    kernel: Kernel
    switch: Switch
    index: int
    tie: Number

    def argument(self, part: Segment) -> Routine:
        """The routine of time on a part, with its derivative."""
        return self.kernel.switching(part.data)[f"argument_{self.index}"]

    def pieces(self, parts: Sequence[Segment]) -> list[SwitchPiece]:
        """Cut parts of time where the switch changes, and give its numbers.

        Raises UsageError: there are more changes than the limit allows.
        """
        linear = f"line_{self.index}" in self.kernel.switching(parts[0].data)
        cuts = self._of_lines(parts) if linear else self._of_curves(parts)
        cut = [
            SwitchPiece(part, a, b, _clear(a, b, unsure))
            for part, (inside, unsure) in zip(parts, cuts, strict=True)
            for a, b in pairwise((part.start, *self._apart(part, inside), part.end))
        ]
        certain = [True] * len(cut) if linear else decided(self, [(piece.part, piece.at) for piece in cut])
        sure = (replace(p, number=self.number(p.part)(p.at)) if yes else p for p, yes in zip(cut, certain, strict=True))
        return list(self._numbered(_merged(sure)))

    def _numbered(self, pieces: Iterator[SwitchPiece]) -> Iterator[SwitchPiece]:
        """Give a part that is on a level to round-off all along the number before it."""
        before: Number | None = None
        for piece in pieces:
            number = piece.number
            if number is None:
                number = self.number(piece.part)(piece.at) if before is None else before
            yield replace(piece, number=number)
            before = number

    def _apart(self, part: Segment, cuts: Sequence[Number]) -> Iterator[Number]:
        """The cuts, in order, that are no ties of one before or of an end."""
        before = part.start
        for cut in sorted(cuts):
            if cut - before > self.tie and part.end - cut > self.tie:
                yield cut
                before = cut

    def number(self, part: Segment) -> Callable[[Number], Number]:
        """The switch's number at a time; not-a-number where its argument has no value."""
        argument, arithmetic = self.argument(part), self.kernel.arithmetic
        decide, nothing = arithmetic.functions[self.switch.kind], arithmetic.functions["nan"]

        def number(t: Number) -> Number:
            try:
                value = argument(t)[0]
            except DOMAIN_ERRORS:
                return nothing
            return decide(value) if arithmetic.isfinite(value) else nothing

        return number

    def _levels(self, a: Number, b: Number) -> range:
        """The whole numbers from one value to another at which the number changes."""
        low, high = min(a, b), max(a, b)
        if self.switch.kind == "sign":
            return range(1) if low <= 0 <= high else range(0)
        return range(ceil(low), floor(high) + 1)

    def _of_lines(self, parts: Sequence[Segment]) -> Iterator[Cuts]:
        left = limits.current().switches
        for part in parts:
            start, over, under = self.kernel.switching(part.data)[f"line_{self.index}"]()
            found: list[Number] = []
            if over != 0 and under != 0:
                levels = self._levels(*(start + over * t / under for t in (part.start, part.end)))
                left -= len(levels)
                check(left)
                found = [(n - start) * under / over for n in levels]
            yield found, []

    def _of_curves(self, parts: Sequence[Segment]) -> list[Cuts]:
        found: list[Cuts] = [([], []) for _ in parts]
        left = limits.current().switches
        monotone, unsure = isolated(self, parts)
        for owner, low, high in monotone:
            roots = self._roots(parts[owner], low, high)
            left -= len(roots)
            check(left)
            found[owner][0].extend(roots)
        for owner, low, high in unsure:
            found[owner][0].extend(self._unproved(parts[owner], low, high))
            found[owner][1].append((low, high))
        return found

    def _roots(self, part: Segment, a: Number, b: Number) -> list[Number]:
        """Where an argument that is monotone on [a, b] meets its levels, solved to round-off."""
        argument, zero = self.argument(part), a * 0
        first, last = argument(a)[0], argument(b)[0]
        sign = 1 if last > first else -1
        found: list[Number] = []
        for level in self._levels(first, last):

            def value(s: Number, level: int = level) -> Number:
                return sign * (argument(a + s * (b - a))[0] - level)

            start, end = sign * (first - level), sign * (last - level)
            s = zero + 1
            if end > 0:
                s = close_bracket(value, (zero, start), (s, end), zero, self.kernel.arithmetic.unit)
            found.append(a + s * (b - a))
        return found

    def _unproved(self, part: Segment, a: Number, b: Number) -> list[Number]:
        """Where a change is in a stretch that nothing is proved of.

        It is between different numbers at its ends, or where a stretch without values begins and ends; a level that is
        touched changes nothing.
        """
        number, middle = self.number(part), (a + b) / 2
        first, last, between = map(number, (a, b, middle))
        if not same(first, last):
            return [_change(number, a, b)]
        if between != between and first == first:
            return [_change(number, a, middle), _change(number, middle, b)]
        return []


def _merged(pieces: Iterator[SwitchPiece]) -> Iterator[SwitchPiece]:
    """Join neighbours in one part that have the same number, and one that has none to a neighbour."""
    last: SwitchPiece | None = None
    for piece in pieces:
        if last is None or last.part is not piece.part:
            if last is not None:
                yield last
            last = piece
        elif last.number is None:
            last = replace(piece, start=last.start)
        elif piece.number is None or same(piece.number, last.number):
            last = replace(last, end=piece.end)
        else:
            yield last
            last = piece
    assert last is not None
    yield last


def _change(number: Callable[[Number], Number], a: Number, b: Number) -> Number:
    """Where the number is no longer what it is at ``a``, by halving."""
    before = number(a)
    while a < (middle := (a + b) / 2) < b:
        a, b = (middle, b) if same(number(middle), before) else (a, middle)
    return b


def _clear(a: Number, b: Number, unsure: Sequence[Stretch]) -> Number:
    """The middle of the longest part of [a, b] that is in no unsure stretch; of all of it where there is none."""
    clear, after = [(a, a)], a
    for low, high in unsure:
        if low < b and high > a:
            clear.append((after, max(after, low)))
            after = high
    clear.append((after, max(after, b)))
    low, high = max(clear, key=lambda stretch: stretch[1] - stretch[0])
    return (low + high) / 2 if high > low else (a + b) / 2


def same(a: Number, b: Number) -> bool:
    """Whether two numbers are equal, or both are none."""
    return a == b or (a != a and b != b)


Array = np.ndarray[Any, Any]
Found = list[tuple[int, Number, Number]]  # the number of the part, and two times in it
UNDER_WAY = 8  # intervals for each change that the limit allows
NO_VALUE = 2.0**-10  # of the run: an interval without values at its ends and middle is taken to have none
STILL = 2.0**-1000  # a slope below this is none


def check(left: float) -> None:
    """Refuse to look for more changes than the limit allows."""
    if left < 0:
        most = limits.current().switches
        raise UsageError(
            f"floor, sign, abs, min, max or atan2 of time switches more than {most} times in this run",
            f"make the run shorter, or allow more with --limit switches={10 * most}",
        )


def isolated(argument: Changes, parts: Sequence[Segment]) -> tuple[Found, Found]:
    """Intervals on which the argument is monotone and meets a level, and those that nothing is proved of."""
    enclosed, tie = _Enclosed(argument, [part.data for part in parts]), float(argument.tie)
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


def decided(argument: Changes, places: Sequence[tuple[Segment, Number]]) -> list[bool]:
    """Whether the argument is off its levels by more than round-off at times, or stays on one."""
    enclosed = _Enclosed(argument, [part.data for part, _ in places])
    times = np.array([float(t) for _, t in places])
    meets, still = enclosed.on_level(times, np.arange(len(places)))
    return (~meets | still).tolist()


class _Enclosed:
    """A switch's argument over ranges; row i of ``below`` and ``above`` encloses the data of part i."""

    def __init__(self, argument: Changes, data: Sequence[tuple[Number, ...]]) -> None:
        rows = np.array([[float(a) for a in row] for row in data])
        exact = argument.kernel.arithmetic.digits is None
        self.argument = argument
        self.below, self.above = (rows, rows) if exact else (np.nextafter(rows, -np.inf), np.nextafter(rows, np.inf))

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


def _within(part: Segment, low: float, high: float) -> tuple[Number, Number]:
    """Two times as numbers of the run, in a part."""
    zero = part.start * 0
    return max(part.start, zero + float(low)), min(part.end, zero + float(high))


def _has_value(argument: Changes, part: Segment, t: Number) -> bool:
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
