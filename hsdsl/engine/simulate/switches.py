"""When the switches of a program change: times between which each has one number, its floor or its sign.

Of a switch that is linear in time they are computed. For any other its argument is isolated (`switch_isolation`):
between the places found it is proved to change nowhere else, but for stretches where it touches a level to round-off,
which counts as no change, or has no value.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from math import ceil, floor

from hsdsl.base import limits
from hsdsl.base.numbers.arithmetic import DOMAIN_ERRORS, Number
from hsdsl.engine.simulate.surfaces import close_bracket
from hsdsl.engine.simulate.switch_isolation import Argument, Part, check, decided, isolated

Stretch = tuple[Number, Number]
Cuts = tuple[list[Number], list[Stretch]]  # where the number changes, and stretches that nothing is proved of


@dataclass(frozen=True)
class SwitchPiece:
    """A part of a part, a time in it at which its number is certain, and its number; None where there is none."""

    part: Part
    start: Number
    end: Number
    at: Number
    number: Number | None = None


@dataclass(frozen=True)
class Changes(Argument):
    """Finds the changes of one switch; two within ``tie`` are one."""

    def pieces(self, parts: Sequence[Part]) -> list[SwitchPiece]:
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

    def _apart(self, part: Part, cuts: Sequence[Number]) -> Iterator[Number]:
        """The cuts, in order, that are no ties of one before or of an end."""
        before = part.start
        for cut in sorted(cuts):
            if cut - before > self.tie and part.end - cut > self.tie:
                yield cut
                before = cut

    def number(self, part: Part) -> Callable[[Number], Number]:
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

    def _of_lines(self, parts: Sequence[Part]) -> Iterator[Cuts]:
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

    def _of_curves(self, parts: Sequence[Part]) -> list[Cuts]:
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

    def _roots(self, part: Part, a: Number, b: Number) -> list[Number]:
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

    def _unproved(self, part: Part, a: Number, b: Number) -> list[Number]:
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
