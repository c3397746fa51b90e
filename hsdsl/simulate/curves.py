"""All surfaces of a mode along one step, by the interpolant of its states: exactly where they are affine."""

from __future__ import annotations

from hsdsl.arithmetic import Number
from hsdsl.integrators.stepper import Polynomial, State
from hsdsl.simulate.along import Piece, affine_curve, interpolated
from hsdsl.simulate.interpolation import along_steps, interpolation
from hsdsl.simulate.run import Here, Run
from hsdsl.simulate.surfaces import at

IN_A_STEP = 250  # pieces of a surface, at most
LONG = 2**9  # in a run: steps that are made shorter where surfaces vary too fast along them
Curves = list[list[Piece]]


def curves_along(run: Run, here: Here, t: Number, h: Number, x: State, z: State, piece: Polynomial) -> Curves:
    """Give the pieces of each surface along ``piece``, a step's interpolant from (t, x) to (t + h, z).

    Raises
    ------
    ValueError
        A surface varies too fast for one step, or has no value.
    """
    degree, share = along_steps(run.settings)
    if here.mode.affine:
        return _affine_curves(here, t, h, x, piece, share + interpolation(degree, run.arithmetic).rounding)
    surfaces, count = here.kernel.surfaces, len(here.mode.edges) + len(here.mode.walls)

    def values(s: Number) -> State:
        return surfaces(t + s * h, *at(x, piece, s))

    def allowed(k: int) -> Number:
        return max(here.surfaces.noise(k, t, x), here.surfaces.noise(k, t + h, z))

    refuse = h * LONG > run.settings.until
    return interpolated(values, count, degree, allowed, share, run.arithmetic, most=IN_A_STEP, may_refuse=refuse)


def _affine_curves(here: Here, t: Number, h: Number, x: State, piece: Polynomial, share: Number) -> Curves:
    slopes = [gradient(t, *x) for gradient in here.kernel.gradients]
    starts = here.kernel.surfaces(t, *x)
    return [affine_curve(start, row, h, piece, share) for start, row in zip(starts, slopes, strict=True)]
