"""Settings of one run, in numbers, and how they have surfaces interpolated along its steps."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cache, reduce
from operator import add
from typing import Any

from hsdsl.base.limits import DEFAULT
from hsdsl.base.numbers.arithmetic import Arithmetic, Number
from hsdsl.engine.integrators import Method


@dataclass(frozen=True)
class OneStop:
    """A mass against one stop: x'' = f(t) - 2 damping x' - stiffness x, and x' -> -restitution x' at x = level.

    ``position`` is the index (0 or 1) of x among the mode's states, x' being the other; ``above`` says that the stop
    bounds x from above. f is the flow of x' at rest in the origin.
    """

    position: int
    above: bool
    level: Number
    restitution: Number
    damping: Number
    stiffness: Number


@dataclass(frozen=True)
class Settings:
    """Settings of one run, resolved and checked.

    Exactly one of ``step`` (fixed) and ``tolerance`` (adaptive: local error relative to the largest
    size that each state has had) is given.
    ``relaxation`` is the paper's epsilon: a depth in the model's own units, and a time. ``samples`` (how many equally
    spaced times, or the times) says what tables of the execution are written at; it does not change the run.
    ``scale`` has the given sizes of states: the scale of a state is this size until the state has been larger.
    ``method_chosen`` says which method `auto` is here, and why; None where the method was named.
    ``overrides`` are the values given beyond the model's file, as written, by the names of `--set`.
    ``memory`` is how many bytes of rows a run may keep.
    ``completion`` is `none` where no state moves along a guard that holds it.
    ``longest_step`` bounds the steps of an adaptive method further, ``first_steps`` the first ones of each arc of flow,
    0 where it does not: by this number, then twice, then four times as much.
    ``moves`` is whether round-off moves the run, as one that another is compared with (`hsdsl.engine.simulate.moving`).
    ``method`` is None and ``one_stop`` is given for the scheme that has its own formula, `paoli_schatzman`.
    """

    scheme: str
    method: Method | None
    step: Number | None
    tolerance: Number | None
    relaxation: Number
    until: Number
    max_transitions: int
    scale: Mapping[str, Number] = field(default_factory=dict[str, Number])
    samples: int | tuple[Number, ...] | None = None
    one_stop: OneStop | None = None
    method_chosen: str | None = None
    overrides: Mapping[str, Any] = field(default_factory=dict[str, Any], compare=False)
    memory: int = DEFAULT.memory
    completion: str = "contact"
    longest_step: Number | None = None
    first_steps: Sequence[Number] = ()
    moves: bool = False

    def __post_init__(self) -> None:
        if (self.step is None) == (self.tolerance is None):
            raise ValueError("exactly one of step and tolerance")
        if self.tolerance is not None and (self.method is None or not self.method.adaptive):
            raise ValueError(f"{self.method.name if self.method else self.scheme} has no error estimate")
        if not self.relaxation > 0 or not self.until >= 0:
            raise ValueError("relaxation must be positive and until not negative")


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

    Its values at ``nodes``, equidistant, times ``matrix`` are coefficients of powers; they are compared with it at
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
    rounding = arithmetic.unit * reduce(add, (abs(m) for line in matrix for m in line), arithmetic.zero)
    return Interpolation(nodes, tests, matrix, rounding)


def _to_powers(degree: int, arithmetic: Arithmetic) -> tuple[tuple[Number, ...], ...]:
    """The matrix from values at i/degree to coefficients of powers, solved in fractions.

    Column i has those of Lagrange's polynomial: the product of (degree x - j) / (i - j) over all other j.
    """
    columns: list[list[Fraction]] = []
    for i in range(degree + 1):
        c, below = [1], 1
        for j in range(degree + 1):
            if j != i:
                c = [degree * a - j * b for a, b in zip([0, *c], [*c, 0], strict=True)]
                below *= i - j
        columns.append([Fraction(a, below) for a in c])
    return tuple(tuple(arithmetic.constant(c[k]) for c in columns) for k in range(degree + 1))
