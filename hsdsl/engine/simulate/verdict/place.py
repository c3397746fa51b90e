"""One state of a mode at a time: its surfaces, rates and conditions."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from math import inf, isfinite

from hsdsl.base.numbers.arithmetic import DOMAIN_ERRORS, FLOAT64, Number
from hsdsl.base.numbers.enclosures import Range, Undecided, as_range
from hsdsl.engine.integrators.stepper import State
from hsdsl.engine.kernel import ModeKernel
from hsdsl.engine.simulate.remarks import wall_of
from hsdsl.engine.simulate.surfaces import Surfaces
from hsdsl.mathematics.program import ModeProgram

ALONG = 1e-3  # of what a surface may change by: less is along it
GUARD_ROUNDS = 3  # of Newton's method, back onto a guard
TANGENT_UNITS = 64  # of round-off: a rate that counts as zero


@dataclass(frozen=True)
class Place:
    """A mode at a time: its routines bound (``enclosing`` binds them over intervals), and one state."""

    mode: ModeProgram
    kernel: ModeKernel
    surfaces: Surfaces
    t: Number
    x: State
    enclosing: Callable[[], ModeKernel]

    def value(self, k: int) -> Number:
        """Surface k."""
        return self.kernel.surfaces(self.t, *self.x)[k]

    def rate(self, k: int) -> Number:
        """How fast surface k rises along the flow."""
        return self.kernel.rates[k](self.t, *self.x)[0]

    def rate_roundoff(self, k: int) -> Number:
        """Below this the rate of surface k counts as zero."""
        gradient, slope = self.kernel.gradients[k](self.t, *self.x), self.kernel.flow(self.t, *self.x)
        terms = (abs(g * f) for g, f in zip(gradient[1:], slope, strict=True))
        return TANGENT_UNITS * self.surfaces.arithmetic.unit * sum(terms, abs(gradient[0]))

    def flow_roundoff(self) -> list[Number]:
        """A bound on the round-off of each component of the flow, also of one that is zero by cancellation; else 0."""
        units = self.surfaces.arithmetic.unit / FLOAT64.unit
        try:
            flow = self.enclosing().flow(*(Range(float(a), float(a)) for a in (self.t, *self.x)))
        except (Undecided, *DOMAIN_ERRORS):
            return [0.0 for _ in self.x]
        widths = [float(f.high - f.low) for f in map(as_range, flow)]
        return [units * width if isfinite(width) else 0.0 for width in widths]

    def roundoff_bound(self, k: int) -> Number:
        """Round-off of surface k."""
        return self.surfaces.roundoff_bound(k, self.t, self.x)

    def moved_by(self, error: State) -> Iterator[State]:
        """The state, and with each component moved by its error either way."""
        yield self.x
        for i, e in enumerate(error):
            for way in (-1, 1):
                yield (*self.x[:i], self.x[i] + way * e, *self.x[i + 1 :])

    def along_guard(self, k: int, error: State) -> Iterator[State]:
        """The state moved by the error in each component, and then back onto the guard of edge k."""
        for moved in self.moved_by(error):
            x = moved
            for _ in range(GUARD_ROUNDS):
                value = self.kernel.surfaces(self.t, *x)[k]
                slopes = self.kernel.gradients[k](self.t, *x)[1:]
                norm = sum(g * g for g in slopes)
                if not norm > 0:
                    break
                x = tuple(a - value * g / norm for a, g in zip(x, slopes, strict=True))
            yield x

    def conditions(self, k: int, error: State, late: float) -> set[bool]:
        """What the condition of edge k is there, and anywhere in the box of the error, so much later or earlier."""
        times = (self.t - late, self.t, self.t + late)
        found = {bool(self.kernel.conditions[k](t, *x)[0]) for x in self.moved_by(error) for t in times}
        if len(found) == 1 and (late or any(error)):
            try:
                found |= {bool(self.enclosing().conditions[k](*self.box(error, late))[0])}
            except (Undecided, *DOMAIN_ERRORS):
                found = {True, False}
        return found

    def box(self, error: State, late: float) -> list[Range]:
        """Time and states as far away as an error moves them."""
        span = Range(float(self.t - late), float(self.t + late))
        return [span, *(Range(float(x - e), float(x + e)) for x, e in zip(self.x, error, strict=True))]

    def rates_within(self, k: int, error: State, late: float) -> Range:
        """How fast surface k may rise anywhere in the box of the error; everything where that has no value."""
        try:
            return as_range(self.enclosing().rates[k](*self.box(error, late))[0])
        except (Undecided, *DOMAIN_ERRORS):
            return Range(-inf, inf)

    def outranks(self, j: int, k: int, error: State, late: float = 0.0) -> bool:
        """Whether edge j goes before edge k wherever either may be reached: they have one surface.

        It has the higher priority, or on the guard the condition of k does not hold: nowhere else is it reached.
        """
        edges = self.mode.edges
        try:
            if k >= len(edges) or not self._coincide(j, k, error):
                return False
            times = (self.t - late, self.t, self.t + late)
            return edges[j].priority > edges[k].priority or not any(
                self.kernel.conditions[k](t, *x)[0] for x in self.along_guard(k, error) for t in times
            )
        except DOMAIN_ERRORS:
            return False

    def _coincide(self, j: int, k: int, error: State) -> bool:
        """Whether surface k is a multiple of surface j around the state, as p >= 1 and 2*p >= 2 are."""
        slopes, others = (self.kernel.gradients[i](self.t, *self.x) for i in (j, k))
        size, product = sum(g * g for g in slopes), sum(g * h for g, h in zip(slopes, others, strict=True))
        if not (size > 0 and product > 0):
            return False
        times = product / size
        for x in self.moved_by(error):
            values = self.kernel.surfaces(self.t, *x)
            near = times * self.surfaces.roundoff_bound(j, self.t, x) + self.surfaces.roundoff_bound(k, self.t, x)
            if not abs(times * values[j] - values[k]) <= near:
                return False
        return True

    def name(self, k: int) -> str:
        """Surface k for a person."""
        edges = self.mode.edges
        return edges[k].name if k < len(edges) else f"the wall {wall_of(self.mode, k)}"
