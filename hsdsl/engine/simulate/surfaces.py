"""A mode's surfaces: at a point, as polynomials of the share s of a step, and where these rise through zero.

A surface value counts as zero below its round-off. A state is *on* a surface, which is then ``active``, where it
entered the mode so; it *stands* on a guard (`Surfaces.standing`) where that is so at a point with the flow leading out.
A surface is *emerging* where it moved past the state while that waited in a strip, and the flow leads back through it.

With a Taylor method the polynomial is the surface's own series, if it is smooth. Otherwise the surface is interpolated
on the step's dense output, at equidistant nodes, and compared with itself between them: where that residual is too
large the piece is halved. Roots are isolated in the Bernstein form: its coefficients on an interval enclose the values
there, and a polynomial has at most as many roots inside as they have changes of sign, and as many up to an even number
(Descartes' rule). An interval is cut until these decide; no root between two samples can be missed. See R. T. Farouki,
The Bernstein polynomial basis: a centennial retrospective, Computer Aided Geometric Design 29, 2012
(doi:10.1016/j.cagd.2012.03.001).
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import comb
from typing import TYPE_CHECKING

from hsdsl.base.numbers.arithmetic import DOMAIN_ERRORS, Arithmetic, Number
from hsdsl.base.numbers.roundoff import ROUNDOFF_UNITS
from hsdsl.engine.integrators.stepper import Polynomial, State
from hsdsl.engine.kernel import ModeKernel, Vector
from hsdsl.engine.scheme.polynomials import slope_of, value_of
from hsdsl.engine.scheme.roots import Cut, Roots, Walk, next_root
from hsdsl.engine.simulate.settings import along_steps, interpolation
from hsdsl.mathematics.program import EdgeProgram

if TYPE_CHECKING:
    from hsdsl.engine.simulate.run import ModeState, Run

ROOT_ITERATIONS = 200
NONE: Mapping[int, Number] = {}


@dataclass(frozen=True)
class Crossing:
    """Where a trial step crossed a guard: share ``theta`` of the step, time and state there, and the depth reached.

    ``piece`` is the interpolant from the step's start to the crossing, empty where the crossing is the start.
    """

    edge: int
    theta: Number
    time: Number
    state: State
    depth: Number
    piece: Polynomial = ()


@dataclass(frozen=True)
class Arrival:
    """How a state has come to a mode, which decides what surfaces it is on.

    A surface that the flow passes within the time ``since`` is active: tied transitions share one point. A surface that
    moved past the state while it waited in a strip, since its reset at ``reset_at``, is active too. Edges in ``inside``
    were not reached before an input jumped: a state on such a surface counts as beyond it. Those that the state
    ``stood`` on, off them by numbers, it is still on if it is no further off.
    """

    since: Number = 0
    inside: frozenset[int] = frozenset()
    reset_at: Number = None
    stood: Mapping[int, Number] = field(default_factory=dict[int, Number])


ANY = Arrival()


def at(x: State, piece: Polynomial, theta: Number) -> State:
    """Evaluate x + c_1 s + c_2 s**2 + ... at s = theta."""
    value = tuple(c * theta for c in piece[-1])
    for coefficients in reversed(piece[:-1]):
        value = tuple((c + v) * theta for c, v in zip(coefficients, value, strict=True))
    return tuple(a + v for a, v in zip(x, value, strict=True))


def shortened(piece: Polynomial, theta: Number) -> Polynomial:
    """Return the part of an interpolant before theta, over [0, 1] again."""
    power = theta
    parts: list[State] = []
    for c in piece:
        parts.append(tuple(a * power for a in c))
        power = power * theta
    return tuple(parts)


def roundoff(unit: Number, magnitude: Number, gradient: Vector, t: Number, x: State, scale: State) -> Number:
    """Below this a surface value counts as zero: 32 u (|L| + |R| + |dr/dt| |t| + sum |dr/dx_i| |x_i|).

    ``scale`` holds the sizes of the numbers a state was computed from (see `Surfaces`): a state that a reset
    or a cancellation made small carries the round-off of what made it.
    """
    total = magnitude + abs(gradient[0]) * abs(t)
    for g, a, s in zip(gradient[1:], x, scale, strict=True):
        if g:
            total = total + abs(g) * max(abs(a), abs(s))
    return ROUNDOFF_UNITS * unit * total


def joined(scale: Number, size: Number) -> Number:
    """The size of numbers of two sizes, of which the first may have a sign (see `Surfaces`)."""
    return -max(-scale, size) if scale < 0 else max(scale, size)


def larger(sizes: Sequence[Number], scale: State) -> State:
    """The larger of each two sizes; of ``scale`` the signs do not count (see `Surfaces`)."""
    return tuple(max(a, abs(s)) for a, s in zip(sizes, scale, strict=True))


@dataclass(frozen=True)
class Surfaces:
    """A mode's surfaces with what is needed to judge a point.

    ``scale`` holds the sizes of the numbers that the state was computed from on entry: of the flow, or of the terms of
    the last reset; then they are negative, and the next reset reads no more than the value: no size multiplies. They
    count for the surfaces in ``active``, on which the state stood then, until it has left them. ``emerging`` are those
    that moved past the state while it waited in a strip, and that the flow leads back through. ``touched`` are the
    contacts that hold it. The surfaces of ``pushes``, these and other contacts, are the pushes on their guards: motion
    along guards is off them by the sizes that states have ``had``. ``end`` is that of the run.
    """

    kernel: ModeKernel
    edges: tuple[EdgeProgram, ...]
    scale: State
    arithmetic: Arithmetic
    active: set[int] = field(default_factory=set[int])
    emerging: set[int] = field(default_factory=set[int])
    touched: frozenset[int] = frozenset()
    pushes: frozenset[int] = frozenset()
    had: Sequence[Number] = ()
    end: Number | None = None

    def too_late(self, k: int, t: Number, since: Number) -> bool:
        """Whether an edge that is crossed at a time is one that is made after it, and the run ends there."""
        return self.edges[k].strict and self.end is not None and t + since >= self.end

    def releases(self, k: int) -> bool:
        """Whether surface k ends a contact that holds the state."""
        return k < len(self.edges) and self.edges[k].releases in self.touched

    def roundoff_bound(self, k: int, t: Number, x: State, entry: bool = False) -> Number:
        """Round-off of surface k at a point; where its gradient has no value only the sides count."""
        magnitude, unit = self.kernel.magnitudes(t, *x)[k], self.arithmetic.unit
        try:
            gradient = self.kernel.gradients[k](t, *x)
            if not self.arithmetic.isfinite(sum(gradient)):
                raise ValueError("a surface as steep as a wall")
        except DOMAIN_ERRORS:
            return ROUNDOFF_UNITS * unit * magnitude
        scale = self.scale if entry or k in self.active else tuple(self.arithmetic.zero for _ in x)
        if k < len(self.edges) and self.edges[k].releases in self.pushes:
            scale = larger(self.had, self.scale)
        return roundoff(unit, magnitude, gradient, t, x, scale)

    def enter(self, t: Number, x: State, values: Vector, arrival: Arrival = ANY) -> list[int]:
        """Look at the surfaces on entry: return those the state is beyond, and note those it is on."""
        beyond: list[int] = []
        then = values if arrival.reset_at is None else self.kernel.surfaces(arrival.reset_at, *x)
        for k, r in enumerate(values):
            noise = max(self.roundoff_bound(k, t, x, entry=True), abs(arrival.stood.get(k, self.arithmetic.zero)))
            if arrival.since and abs(r) > noise:
                noise = max(noise, abs(self.kernel.rates[k](t, *x)[0]) * arrival.since)
            if r > noise and not then[k] > noise:
                self.active.add(k)
                if self.kernel.rates[k](t, *x)[0] < 0:
                    self.emerging.add(k)
            elif r > noise or (k in arrival.inside and r >= -noise):
                beyond.append(k)
            elif r >= -noise:
                self.active.add(k)
        return beyond

    def inside(self, t: Number, x: State) -> frozenset[int]:
        """Edges without an `if` whose surfaces the state has not reached, to the round-off that counts on entry."""
        values, plain = self.kernel.surfaces(t, *x), [k for k, edge in enumerate(self.edges) if not edge.conditional]
        return frozenset(k for k in plain if values[k] < -self.roundoff_bound(k, t, x, entry=True))

    def off(self, t: Number, x: State, surfaces: Collection[int]) -> dict[int, Number]:
        """How far off some surfaces a state is."""
        values = self.kernel.surfaces(t, *x) if surfaces else ()
        return {k: values[k] for k in surfaces}

    def leave(self, t: Number, x: State) -> None:
        """Forget the surfaces that the state stood on and has left: inwards, or outwards where `if` was false."""
        values = self.kernel.surfaces(t, *x)
        self.active.difference_update([k for k in self.active if abs(values[k]) > self.roundoff_bound(k, t, x)])
        if self.emerging:
            inside = [k for k in self.emerging if values[k] <= 0 or not self._falls(k, t, x)]
            self.emerging.difference_update(inside)

    def _falls(self, k: int, t: Number, x: State) -> bool:
        """Whether the flow leads back through surface k, as far as is known."""
        try:
            return self.kernel.rates[k](t, *x)[0] < 0
        except DOMAIN_ERRORS:
            return True

    def standing(self, t: Number, x: State, since: Number, known: Collection[int] = ()) -> list[int]:
        """Edges on whose guards the state is, with the flow pointing out and `if` true, which are not only touched.

        Those that are ``known`` are left out.

        On the guard means to round-off, or within the time ``since``: sums of steps are no more exact than that.
        """
        found: list[int] = []
        try:
            values = self.kernel.surfaces(t, *x)
        except DOMAIN_ERRORS:
            return found
        for k in range(len(self.edges)):
            if k in known or self.releases(k) or self.too_late(k, t, since):
                continue
            try:
                r, rate = values[k], self.kernel.rates[k](t, *x)[0]
                if not rate > 0:
                    continue
                noise = self.roundoff_bound(k, t, x)
                near = abs(r) <= max(noise, rate * since)
                if not (near and self._points_out(k, t, x, rate)) or self._turns_back(k, t, x, since, noise - r):
                    continue
                if self.kernel.conditions[k](t, *x)[0]:
                    found.append(k)
            except DOMAIN_ERRORS:
                continue
        return found

    def _turns_back(self, k: int, t: Number, x: State, since: Number, room: Number) -> bool:
        """Whether surface k, bending as it does in the time ``since``, falls again before it has risen by ``room``."""
        if not since > 0:
            return False
        rate, flow = self.kernel.rates[k](t, *x)[0], self.kernel.flow(t, *x)
        try:
            later = self.kernel.rates[k](t + since, *(a + since * f for a, f in zip(x, flow, strict=True)))[0]
        except DOMAIN_ERRORS:
            return False
        bend = (rate - later) / since
        return bend > 0 and rate * rate <= 2 * bend * room

    def _points_out(self, k: int, t: Number, x: State, rate: Number) -> bool:
        """Whether the flow points out of surface k, beyond the round-off of its rate."""
        if not rate > 0:
            return False
        first, *gradient = self.kernel.gradients[k](t, *x)
        size = abs(first)
        for g, f in zip(gradient, self.kernel.flow(t, *x), strict=True):
            size = size + abs(g) * abs(f)
        return rate > ROUNDOFF_UNITS * self.arithmetic.unit * size


def close_bracket(
    value: Callable[[Number], Number],
    low: tuple[Number, Number],
    high: tuple[Number, Number],
    small: Number,
    unit: Number,
) -> Number:
    """Close a bracket value(low) <= 0 < value(high) (Illinois; Dowell and Jarratt 1971, doi:10.1007/BF01934364)."""
    (a, fa), (b, fb) = low, high
    weight_a, weight_b, side = fa, fb, 0
    for _ in range(ROOT_ITERATIONS):
        if -fa <= small or b - a <= 4 * unit:
            return a
        if fb <= small:
            return b
        s = a - weight_a * (b - a) / (weight_b - weight_a)
        s = s if a < s < b else (a + b) / 2
        f = value(s)
        if f <= 0:
            weight_b = weight_b / 2 if side < 0 else weight_b
            a, fa, weight_a, side = s, f, f, -1
        else:
            weight_a = weight_a / 2 if side > 0 else weight_a
            b, fb, weight_b, side = s, f, f, 1
    return a


Coefficients = Sequence[Number]  # of 1, s, s**2, ...


def total(terms: Iterable[Number], zero: Number) -> Number:
    """Sum from left to right (Python's own ``sum`` compensates round-off from 3.12 on, and C does not)."""
    for term in terms:
        zero = zero + term
    return zero


MORE_CUTS = 13  # of an interval than numbers have bits: so many are open at once, at most


def make_roots(degree: int, arithmetic: Arithmetic) -> Roots:
    """Room to look for roots of polynomials up to a degree."""
    zero, size = arithmetic.zero, degree + 1
    binomials = [comb(n, k) for n in range(size) for k in range(n + 1)]
    cuts = [Cut(zero, zero, [zero] * size) for _ in range(arithmetic.bits + MORE_CUTS)]
    return Roots(arithmetic.unit, binomials, (), [zero] * size, [zero] * size, cuts)


MOST_SPLITS = 30  # of a step, before a piece that does not settle is taken as a straight line
MOST_FIRST = 3  # of a step's first piece, before the step is made shorter
MOST_PIECES = 1000  # before what is left is taken as it is, or it is refused
IN_A_STEP = 64  # pieces of a surface, at most
SHORTEST = 2**16  # in a run: steps that are still made shorter where surfaces vary too fast along them
LOST_IN_A_STEP, LOST_SHORTEST = 16, 2**9  # the same in a mode whose surfaces even such steps cannot follow
Function = Callable[[Number], Number]


class TooFast(ValueError):
    """Functions vary too fast for one step."""


@dataclass(frozen=True)
class Piece:
    """A surface on the part [start, start + width] of a step, by powers of the share of that part.

    ``certain`` is False where the surface would not settle on a polynomial (a kink or jump inside a tiny part). ``off``
    is how far an interpolation may be off: rises that are lower tell nothing.
    """

    start: Number
    width: Number
    coefficients: Coefficients
    certain: bool = True
    off: Number = 0


def deflated(pieces: list[Piece]) -> list[Piece]:
    """Take the first piece to begin at zero: the state is on the surface, to round-off."""
    first = pieces[0]
    zero = first.coefficients[0] * 0
    return [replace(first, coefficients=[zero, *first.coefficients[1:]]), *pieces[1:]]


Rise = tuple[Number, Number, bool]  # where, by the share of the step; the slope there; whether it is certain


def rises_along(roots: Roots, pieces: Sequence[Piece], level: Number, beyond: bool, risen: bool) -> Iterator[Rise]:
    """Give the points, in order, where the surface rises through zero and goes on above its level.

    A surface that begins ``beyond`` round-off is transparent, and counts from where it has come back to zero. Any other
    that rises without a root crosses where it begins. ``risen`` says that it is beyond round-off at the end of the
    step: then it has crossed by then, so that the next step may begin beyond it.
    """
    walk = Walk(level, beyond, risen, level * 0)
    for piece in pieces:
        c, n, walk.at = piece.coefficients, len(piece.coefficients) - 1, level * 0
        while (root := next_root(roots, walk, c, n, piece.off, piece is pieces[-1])) is not None:
            yield piece.start + root * piece.width, slope_of(c, n, root) / piece.width, piece.certain


Curves = list[list[Piece]]  # of each surface


def affine_curve(start: Number, slopes: State, h: Number, piece: Polynomial, share: Number) -> list[Piece]:
    """A surface that is affine, with these slopes by time and the states, along a piece over ``h``.

    It is a polynomial of the piece's degree. Rises below a share of its size tell nothing.
    """
    zero = start * 0
    c = [start]
    for m, powers in enumerate(piece):
        first = zero if m else slopes[0] * h
        c.append(total((slope * power for slope, power in zip(slopes[1:], powers, strict=True)), first))
    off = share * total(map(abs, c[1:]), abs(start))
    return [Piece(zero, zero + 1, without_zeros(c), True, off)]


def without_zeros(c: Coefficients) -> Coefficients:
    """Leave out last coefficients that are zero, but for two: along a polynomial solution the degree is low."""
    length = len(c)
    while length > 2 and c[length - 1] == 0:
        length -= 1
    return c[:length]


def interpolated(
    functions: Callable[[Number], Sequence[Number]],
    count: int,
    degree: int,
    allowed: Callable[[int], Number],
    share: Number,
    arithmetic: Arithmetic,
    far: bool = True,
    most: int = MOST_PIECES,
    may_refuse: bool = False,
) -> list[list[Piece]]:
    """Interpolate ``count`` functions of s in [0, 1] by pieces of ``degree``, with residuals below ``share`` of
    their largest value, or ``allowed(k)`` more. Without ``far`` pieces end where the first function is positive.

    Raises TooFast: it ``may_refuse``, and the first piece would be too short, or there are too many.
    """
    by, zero = interpolation(degree, arithmetic), arithmetic.zero
    nodes, tests, matrix, share = by.nodes, by.tests, by.matrix, share + by.rounding
    parts: list[tuple[Number, Number, int]] = [(zero, zero + 1, 0)]
    found: list[list[Piece]] = [[] for _ in range(count)]
    while parts and count:
        start, width, halvings = parts.pop()
        rows = list(zip(*(functions(start + width * s) for s in nodes), strict=True))
        checks = list(zip(*(functions(start + width * s) for s in tests), strict=True))
        pieces = [[total((m * r for m, r in zip(line, row, strict=True)), zero) for line in matrix] for row in rows]
        off = [share * max(abs(r) for r in row) for row in rows]
        settled = [
            settles(residual(c, tests, check), enough, allowed, k)
            for k, (c, check, enough) in enumerate(zip(pieces, checks, off, strict=True))
        ]
        if may_refuse and not all(settled) and (len(found[0]) >= most or (start == 0 and halvings == MOST_FIRST)):
            raise TooFast("too fast for one step")
        if not all(settled) and halvings < MOST_SPLITS and len(found[0]) < most:
            half = width / 2
            parts += [(start + half, half, halvings + 1), (start, half, halvings + 1)]
            continue
        for k, row in enumerate(rows):
            c = pieces[k] if settled[k] else [row[0], row[-1] - row[0]]
            found[k].append(Piece(start, width, c, settled[k], off[k] if settled[k] else 0))
        if not far and rows[0][-1] > 0:
            break
    return found


def settles(off: Number, enough: Number, allowed: Callable[[int], Number], k: int) -> bool:
    """Whether a residual of function k is small enough; ``allowed`` is evaluated only beyond ``enough``."""
    return off <= enough or off <= allowed(k) + enough


def residual(c: Coefficients, tests: Sequence[Number], values: Sequence[Number]) -> Number:
    """How far a polynomial is off the values it should have at some points."""
    return max(abs(value_of(c, len(c) - 1, s) - w) for s, w in zip(tests, values, strict=True))


def curves_along(run: Run, here: ModeState, t: Number, h: Number, x: State, z: State, piece: Polynomial) -> Curves:
    """Give the pieces of each surface along ``piece``, a step's interpolant from (t, x) to (t + h, z).

    Raises TooFast: a surface varies too fast for one step.
    Raises ValueError: one has no value.
    """
    degree, share = along_steps(run.settings)
    if here.mode.affine:
        return _affine_curves(here, t, h, x, piece, share + interpolation(degree, run.arithmetic).rounding)
    surfaces, count = here.kernel.surfaces, len(here.mode.edges) + len(here.mode.walls)

    def values(s: Number) -> State:
        return surfaces(t + s * h, *at(x, piece, s))

    def allowed(k: int) -> Number:
        return max(here.surfaces.roundoff_bound(k, t, x), here.surfaces.roundoff_bound(k, t + h, z))

    lost = here.mode.name in run.control.lost
    most, shortest = (LOST_IN_A_STEP, LOST_SHORTEST) if lost else (IN_A_STEP, SHORTEST)
    refuse = h * shortest > run.settings.until
    curves = interpolated(values, count, degree, allowed, share, run.arithmetic, most=most, may_refuse=refuse)
    if not refuse and curves and len(curves[0]) >= most:
        _lose(run, here, t, curves)
    return curves


def _lose(run: Run, here: ModeState, t: Number, curves: Curves) -> None:
    """Give up following a mode's surfaces: visits beyond them may be missed from here on."""
    run.control.lost.add(here.mode.name)
    for k, pieces in enumerate(curves):
        if not all(piece.certain for piece in pieces):
            run.diagnostics.unsettled(here.mode.name, k, t)


def _affine_curves(here: ModeState, t: Number, h: Number, x: State, piece: Polynomial, share: Number) -> Curves:
    slopes = [gradient(t, *x) for gradient in here.kernel.gradients]
    starts = here.kernel.surfaces(t, *x)
    return [affine_curve(start, row, h, piece, share) for start, row in zip(starts, slopes, strict=True)]
