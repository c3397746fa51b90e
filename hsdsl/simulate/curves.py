"""All surfaces of a mode along one step, by the interpolant of its states: exactly where they are affine."""

from __future__ import annotations

from hsdsl.arithmetic import Number
from hsdsl.integrators.stepper import Polynomial, State
from hsdsl.simulate.interpolation import along_steps, interpolation
from hsdsl.simulate.run import ModeState, Run
from hsdsl.simulate.surface_polynomials import Piece, affine_curve, interpolated
from hsdsl.simulate.surfaces import at

IN_A_STEP = 64  # pieces of a surface, at most
SHORTEST = 2**16  # in a run: steps that are still made shorter where surfaces vary too fast along them
LOST_IN_A_STEP, LOST_SHORTEST = 16, 2**9  # the same in a mode whose surfaces even such steps cannot follow
Curves = list[list[Piece]]


def curves_along(run: Run, here: ModeState, t: Number, h: Number, x: State, z: State, piece: Polynomial) -> Curves:
    """Give the pieces of each surface along ``piece``, a step's interpolant from (t, x) to (t + h, z).

    Raises
    ------
    TooFast
        A surface varies too fast for one step.
    ValueError
        One has no value.
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
