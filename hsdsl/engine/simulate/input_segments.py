"""Inputs over time: the segments between samples and between switches of time, each a boundary no step may cross.

On a segment a sampled input is a line ``a + b (t - c)`` and a switch a number, so every stage of a step sees the values
of the step's own open interval, and the stage at its right end takes the left limit. Two samples at one time are a jump
between two lines. Where an input jumps at the end of
the run, a last segment of no length has the values after the jump.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import accumulate, pairwise

from hsdsl.base.errors import UsageError
from hsdsl.base.numbers.arithmetic import DOMAIN_ERRORS, TIE, Number
from hsdsl.base.samples import in_order
from hsdsl.engine.kernel import Kernel
from hsdsl.mathematics.program import Program, SampledInput

PAST_END = 4  # ties of time after the end of a run, where inputs have the values after a jump at the end


class UnorderedTimes(UsageError):
    """Sample ``k`` of an input, counted from 0, is not after the sample before it."""

    def __init__(self, message: str, name: str = "", k: int = 0, ramps: bool = False) -> None:
        times = "no time more than twice" if ramps else "each time once"
        super().__init__(message, f"give {times}, the earliest first")
        self.name, self.k = name, k


@dataclass(frozen=True)
class Segment:
    """Time from ``start`` to ``end``, what routines are bound to on it, and whether an input jumps at its start."""

    start: Number
    end: Number
    data: tuple[Number, ...]
    jump: bool


@dataclass(frozen=True)
class Timeline:
    """The segments of a run, from 0 to ``until``."""

    segments: tuple[Segment, ...]

    def at(self, t: Number) -> Segment:
        """Return the segment that time is in; at a boundary the later one."""
        return self.segments[max(0, bisect_right(self.segments, t, key=lambda s: s.start) - 1)]

    def goes_on(self, segment: Segment) -> bool:
        """Whether another segment follows this one."""
        return self.at(segment.end) is not segment


Samples = tuple[tuple[Number, ...], tuple[Number, ...]]  # times and values of one input


def make_timeline(
    program: Program,
    kernel: Kernel,
    parameters: Sequence[Number],
    until: Number,
    samples: Sequence[Samples] | None = None,
) -> Timeline:
    """Cut time at every sample of every sampled input, and where a switch changes.

    Raises UsageError: an input's sample times do not increase, a sample is not finite, or a switch changes too often.
    """
    if samples is None:
        samples = samples_of(program, kernel, parameters)
    zero = kernel.arithmetic.zero
    jumps = [_jumps(*both) for both in samples]
    cuts = sorted({zero} | {t for times, _ in samples for t in times if zero < t < until})
    ends = [*cuts[1:], until]
    if until > 0:
        cuts, ends = [*cuts, until], [*ends, until + PAST_END * TIE * until]
    segments: list[Segment] = []
    held_before: tuple[Number, ...] = ()
    for start, end in zip(cuts, ends, strict=True):
        place = start if start < until else until + TIE * until
        last = [bisect_right(times, place) - 1 for times, _ in samples]
        lines = [_line(given, *both, k) for given, both, k in zip(program.inputs, samples, last, strict=True)]
        both = list(zip(program.inputs, lines, strict=True))
        held = tuple(a for given, (a, _, _) in both if given.hold == "zero")
        held += tuple(slope for given, (_, slope, _) in both if given.sloped)
        held += tuple(made[max(0, k)] for made, k in zip(jumps, last, strict=True))
        data = (*parameters, *(number for line in lines for number in line), *(zero for _ in program.switches))
        segments.append(Segment(start, end, data, jump=bool(segments) and held != held_before))
        held_before = held
    if program.switches:
        segments = _switched(program, kernel, segments, until)
    inside = [segment for segment in segments if segment.start < until or until == 0]
    jumps_at_end = (segment for segment in segments[len(inside) :] if segment.start == until and segment.jump)
    return Timeline((*inside, *(Segment(until, until, segment.data, jump=True) for segment in jumps_at_end)))


def _switched(program: Program, kernel: Kernel, segments: list[Segment], until: Number) -> list[Segment]:
    """Cut segments where a switch changes, each with the switches before it known."""
    from hsdsl.engine.simulate.switches import Changes, same  # only models with switches pay for it

    tie, first = TIE * until, len(segments[0].data) - len(program.switches)
    for place, switch in enumerate(program.switches, first):
        found, before = list[Segment](), None
        jumps = {segment.start: segment.jump for segment in segments}
        for piece in Changes(kernel, switch, place - first, tie).pieces(segments):
            no_value = piece.number != piece.number and before is not None and not piece.start < until
            number = before if no_value else piece.number  # a model need not have a meaning after its end
            changed = before is not None and not same(number, before)
            data = (*piece.part.data[:place], number, *piece.part.data[place + 1 :])
            jump = jumps.get(piece.start, False) or (switch.jumps and changed)
            found.append(Segment(piece.start, piece.end, data, jump))
            before = number
        segments = found
    return segments


def samples_of(program: Program, kernel: Kernel, parameters: Sequence[Number]) -> list[Samples]:
    """The samples of each input.

    Raises UsageError: the times of one do not increase, or a sample is not finite.
    """
    return [_samples(i, given, kernel, parameters) for i, given in enumerate(program.inputs)]


def _samples(index: int, given: SampledInput, kernel: Kernel, parameters: Sequence[Number]) -> Samples:
    if given.times is not None and given.values is not None:
        times, values = (tuple(map(kernel.arithmetic.constant, column)) for column in (given.times, given.values))
    else:
        try:
            both = kernel.constant(f"input_{index}", parameters)
        except DOMAIN_ERRORS:
            raise UsageError(f"input {given.name} has a sample that is not finite") from None
        times, values = both[: len(both) // 2], both[len(both) // 2 :]
    if not all(map(kernel.arithmetic.isfinite, (*times, *values))):
        raise UsageError(f"input {given.name} has a sample that is not finite")
    for k, (a, b) in enumerate(pairwise(times), start=1):
        if not in_order(given.hold, times, k):
            message = f"the sample times of input {given.name} do not increase: {b} after {a}"
            raise UnorderedTimes(message, given.name, k, given.hold == "linear")
    return times, values


def _jumps(times: tuple[Number, ...], values: tuple[Number, ...]) -> tuple[int, ...]:
    """For each sample how many jumps between two samples at one time there are up to it."""
    both = zip(pairwise(times), pairwise(values), strict=True)
    return tuple(accumulate((int(s == t and a != b) for (s, t), (a, b) in both), initial=0))


def _line(
    given: SampledInput, times: tuple[Number, ...], values: tuple[Number, ...], k: int
) -> tuple[Number, Number, Number]:
    """Return (a, b, c) of the segment after sample k; constant before the first and after the last sample."""
    still = values[0] * 0
    if k < 0:
        return values[0], still, times[0]
    if given.hold == "zero" or k + 1 == len(times):
        return values[k], still, times[k]
    return values[k], (values[k + 1] - values[k]) / (times[k + 1] - times[k]), times[k]
