"""Real functions of a mode's coordinates, with their derivatives, at points and enclosed over boxes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from hsdsl.analysis.metrics.rounding import UNIT
from hsdsl.base.numbers.arithmetic import DOMAIN_ERRORS, FLOAT64
from hsdsl.base.numbers.enclosures import ENCLOSED, Array, as_range, hull
from hsdsl.engine.backends.python import compile_routines
from hsdsl.mathematics.program import Routines

Boxes = Callable[[Array, Array], tuple[Array, Array]]


@dataclass(frozen=True, eq=False)
class Formula:
    """m functions of n coordinates, and their derivatives.

    ``value`` maps (n,) to (m,), NaN outside the functions' real domain, and ``jacobian`` to (m, n). ``ranges`` and
    ``slopes`` bound both over boxes, given by corners of shape (B, n): (B, m) and (B, m, n). Slopes bound difference
    quotients where functions have kinks, and are unbounded where functions may jump.
    """

    value: Callable[[Array], Array]
    jacobian: Callable[[Array], Array]
    ranges: Boxes
    slopes: Boxes

    def __call__(self, x: Array) -> float:
        """The first function's value."""
        return float(self.value(x)[0])

    def gradient(self, x: Array) -> Array:
        """The first function's derivatives."""
        return self.jacobian(x)[0]


def affine(matrix: Array, constant: Array) -> Formula:
    """``matrix @ x + constant``."""
    positive, negative = np.maximum(matrix, 0.0), np.minimum(matrix, 0.0)

    def ranges(low: Array, high: Array) -> tuple[Array, Array]:
        below = low @ positive.T + high @ negative.T + constant
        above = high @ positive.T + low @ negative.T + constant
        largest = np.maximum(np.abs(low), np.abs(high))
        sizes = (matrix.shape[1] + 4) * UNIT * (largest @ np.abs(matrix).T + np.abs(constant))
        return below - sizes, above + sizes

    def slopes(low: Array, _: Array) -> tuple[Array, Array]:
        same = np.broadcast_to(matrix, (len(low), *matrix.shape))
        return same, same

    return Formula(lambda x: matrix @ x + constant, lambda _: matrix, ranges, slopes)


def compiled(text: Routines, shape: tuple[int, int], jumps: bool) -> Formula:
    """A formula of m functions of n coordinates from routines ``value`` and ``jacobian`` (row by row) over x0, x1, ...

    Where functions may jump, derivatives say nothing of differences.
    """
    value, jacobian = compile_routines(text, FLOAT64, "geometry")()
    over: list[Callable[..., Sequence[Any]]] = []

    def enclosed(k: int, low: Array, high: Array, size: tuple[int, ...]) -> tuple[Array, Array]:
        if not over:  # compiled at the first use
            over.extend(compile_routines(text, ENCLOSED, "geometry over boxes")())
        with np.errstate(all="ignore"):
            found = [as_range(r) for r in over[k](*hull(low, high))]
        ends = ([np.broadcast_to(getattr(r, end), len(low)) for r in found] for end in ("low", "high"))
        flat, whole = (len(found), len(low)), (len(low), *size)  # also where there are no boxes
        below, above = (np.array(end, dtype=float).reshape(flat).T.reshape(whole) for end in ends)
        return below, above

    def slopes(low: Array, high: Array) -> tuple[Array, Array]:
        if jumps:
            return np.full((len(low), *shape), -np.inf), np.full((len(low), *shape), np.inf)
        return enclosed(1, low, high, shape)

    return Formula(
        lambda x: _at(value, x, (shape[0],)),
        lambda x: _at(jacobian, x, shape),
        lambda low, high: enclosed(0, low, high, (shape[0],)),
        slopes,
    )


def _at(routine: Callable[..., Sequence[float]], x: Array, shape: tuple[int, ...]) -> Array:
    try:
        return np.array(routine(*x.tolist()), dtype=float).reshape(shape)
    except DOMAIN_ERRORS:
        return np.full(shape, np.nan)


def stacked(parts: Sequence[Formula]) -> Formula:
    """Several formulas of the same coordinates as one, one below the other."""

    def boxes(kind: str) -> Boxes:
        def over(low: Array, high: Array) -> tuple[Array, Array]:
            found = [getattr(part, kind)(low, high) for part in parts]
            return np.concatenate([f[0] for f in found], axis=1), np.concatenate([f[1] for f in found], axis=1)

        return over

    return Formula(
        lambda x: np.concatenate([part.value(x) for part in parts]),
        lambda x: np.vstack([part.jacobian(x) for part in parts]),
        boxes("ranges"),
        boxes("slopes"),
    )
