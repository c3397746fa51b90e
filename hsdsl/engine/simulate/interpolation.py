"""How surfaces along a step are interpolated by polynomials, and how finely."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from functools import cache

from hsdsl.base.numbers.arithmetic import Arithmetic, Number
from hsdsl.engine.simulate.root_isolation import total
from hsdsl.engine.simulate.settings import Settings

RESIDUAL_SHARE, LEAST_SHARE = 1e-2, 1e-13  # of the tolerance, and at least: what a surface may be off its polynomial
UNKNOWN_TOLERANCE = 1e-10  # in its place where steps are fixed
LEAST_DEGREE = 4  # along a step: also not below that of its dense output
SERIES_DEGREE = 6  # along a step of Taylor's method, where a surface has no series
# Where between nodes an interpolation is tested: parts of no simple ratio to them, since what oscillates in step with
# the nodes, as the guard of a clock may, would else pass for a constant.
BETWEEN = Fraction(3_819_661, 10**7), Fraction(6_180_339, 10**7), Fraction(4_142_137, 10**7)


def along_steps(settings: Settings) -> tuple[int, Number]:
    """Of which degree surfaces are interpolated along a step, and how far they may be off, relative to their size."""
    tolerance, method = settings.tolerance, settings.method
    share = max(LEAST_SHARE, RESIDUAL_SHARE * (UNKNOWN_TOLERANCE if tolerance is None else tolerance))
    if method is None or method.is_series:
        return SERIES_DEGREE, share
    return max(LEAST_DEGREE, method.degree), share


@dataclass(frozen=True)
class Interpolation:
    """How a function is interpolated on [0, 1].

    Its values at ``nodes``, equidistant, times ``matrix`` are coefficients of powers; they are held against it at
    ``tests``. ``rounding`` is what round-off in them can amount to, relative to its largest value.
    """

    nodes: tuple[Number, ...]
    tests: tuple[Number, ...]
    matrix: tuple[tuple[Number, ...], ...]
    rounding: Number


@cache
def interpolation(degree: int, arithmetic: Arithmetic) -> Interpolation:
    """Make the interpolation of a degree."""
    nodes = tuple(arithmetic.constant(Fraction(i, degree)) for i in range(degree + 1))
    parts = 0, degree // 2, degree - 1
    tests = tuple(arithmetic.constant((i + part) / degree) for i, part in zip(parts, BETWEEN, strict=True))
    matrix = _to_powers(degree, arithmetic)
    rounding = arithmetic.unit * total((abs(m) for line in matrix for m in line), arithmetic.zero)
    return Interpolation(nodes, tests, matrix, rounding)


def _to_powers(degree: int, arithmetic: Arithmetic) -> tuple[tuple[Number, ...], ...]:
    """The matrix from values at i/degree to coefficients of powers, solved in fractions."""
    columns: list[list[Fraction]] = []
    for i in range(degree + 1):
        c = [Fraction(1)]
        for j in range(degree + 1):
            if j != i:
                scale = Fraction(i - j, degree)
                shifted, kept = [Fraction(0), *c], [*c, Fraction(0)]
                c = [(a - Fraction(j, degree) * b) / scale for a, b in zip(shifted, kept, strict=True)]
        columns.append(c)
    return tuple(tuple(arithmetic.constant(c[k]) for c in columns) for k in range(degree + 1))
