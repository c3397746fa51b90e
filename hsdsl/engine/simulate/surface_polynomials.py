"""Surfaces along one step, as polynomials of the share s of the step: what crossings are isolated on.

With a Taylor method they are the surface's own series, if it is smooth. Otherwise the surface is interpolated on the
step's dense output, at equidistant nodes, and held against itself between them: where that residual is too large the
piece is halved.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

from hsdsl.base.numbers.arithmetic import Arithmetic, Number
from hsdsl.engine.integrators.stepper import Polynomial, State
from hsdsl.engine.simulate.interpolation import along_steps, interpolation
from hsdsl.engine.simulate.root_isolation import ROUNDING, Coefficients, bernstein, last_root, rises, total, value
from hsdsl.engine.simulate.run import ModeState, Run
from hsdsl.engine.simulate.surfaces import at

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


@dataclass(frozen=True)
class Rise:
    """Where a surface rises above its level: the root before it, its slope there, by the share of the step."""

    share: Number
    slope: Number
    certain: bool


def deflated(pieces: list[Piece]) -> list[Piece]:
    """Take the first piece to begin at zero: the state is on the surface, to round-off."""
    first = pieces[0]
    zero = first.coefficients[0] * 0
    return [replace(first, coefficients=[zero, *first.coefficients[1:]]), *pieces[1:]]


def rises_along(pieces: Sequence[Piece], level: Number, beyond: bool, risen: bool, unit: Number) -> Iterator[Rise]:
    """Give the points, in order, where the surface rises through zero and goes on above its level.

    A surface that begins ``beyond`` round-off is transparent, and counts from where it has come back to zero. Any other
    that rises without a root crosses where it begins. ``risen`` says that it is beyond round-off at the end of the
    step: then it has crossed by then, so that the next step may begin beyond it.
    """
    outside = beyond
    for piece in pieces:
        c, at = piece.coefficients, piece.start * 0
        zero, above = at, max(level, ROUNDING * unit * total(map(abs, c), at), piece.off)
        while True:
            if outside:
                below = rises([-a for a in c], zero, at, unit)
                if below is None:
                    break
                at, outside = below, False
            high = rises(c, above, at, unit)
            if high is None and piece is pieces[-1] and risen and at < 1:
                high = at * 0 + 1
            if high is None:
                break
            root = _root(c, at, high, unit)
            yield Rise(piece.start + root * piece.width, slope_of(c, root) / piece.width, piece.certain)
            at, outside = high, True


def _root(c: Coefficients, start: Number, end: Number, unit: Number) -> Number:
    """The last root before ``end``; a series that begins with zero has it taken out, so that tiny roots stay exact."""
    if start == 0 and c[0] == 0 and len(c) > 1:
        degree = len(c) - 1
        of_rest = [b * degree / k for k, b in enumerate(bernstein(c)) if k]
        return last_root(c[1:], start, end, unit, of_rest) or start
    root = last_root(c, start, end, unit, bernstein(c))
    return start if root is None else root


def slope_of(c: Coefficients, s: Number) -> Number:
    """Evaluate the derivative of a polynomial."""
    slope = s * 0
    for k in range(len(c) - 1, 0, -1):
        slope = k * c[k] + s * slope
    return slope


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
    return max(abs(value(c, s) - w) for s, w in zip(tests, values, strict=True))


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
