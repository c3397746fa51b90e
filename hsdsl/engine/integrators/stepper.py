"""What makes steps: functions for one dimension and one number type, written from a table.

The loops over stages and states run once, while the text is written; what remains is a function that a reader (and
another language) can follow line by line, its sums left to right. What is known of implicit methods by their names is
here too; how each steps is in a module that its run imports.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cache
from typing import Any, ClassVar, Literal

from hsdsl.base.graphs import Elimination, Variation
from hsdsl.base.numbers.arithmetic import Arithmetic, Number
from hsdsl.engine.integrators.tableau import ButcherTableau
from hsdsl.engine.kernel import Routine
from hsdsl.engine.scheme.scales import Resolved

State = tuple[Number, ...]
Stages = tuple[State, ...]
Flow = Callable[..., State]
Polynomial = tuple[State, ...]  # (c_1, c_2, ...): x + c_1 s + c_2 s**2 + ...


@dataclass(frozen=True)
class Stepper:
    """A method for states of one dimension.

    Attributes
    ----------
    step : callable
        ``step(flow, t, h, x, slope) -> (z, stages)``; ``slope = flow(t, *x)`` is the first stage. A last stage that is
        the flow at the step's end is not evaluated.
    piece : callable
        ``piece(flow, t, h, x, z, stages, slope, end) -> (c_1, ...)`` with ``end = flow(t + h, *z)``: the interpolant.
        The flow is evaluated only where the dense output has stages of its own.
    error : callable or None
        ``error(h, stages, end)``: the embedded method's estimate of the local error, for adaptive methods.
    gain : float
        By how much a step can enlarge the round-off of its stages: the sum of the absolute weights.
    landing : callable or None
        For implicit methods, whose stages are increments of the state: ``step`` for a part of the step just made,
        solved to round-off.
    scales : callable or None
        For implicit methods: the scales of the states that the step just made was solved with; given True, with a
        look at what the flow is computed from, for this step and those that follow.
    """

    name: str
    step: Callable[[Flow, Number, Number, State, State], tuple[State, Stages]]
    piece: Callable[[Flow, Number, Number, State, State, Stages, State, State], Polynomial]
    error: Callable[[Number, Stages, State], State] | None
    gain: float = 1.0
    landing: Callable[[Flow, Number, Number, State, State], tuple[State, Stages]] | None = None
    scales: Callable[[bool], Sequence[Number]] | None = None


@cache
def stepper(table: ButcherTableau, dimension: int, arithmetic: Arithmetic) -> Stepper:
    """Write and compile the step functions of ``table`` for ``dimension`` states."""
    writer = _Writer(table, dimension, arithmetic)
    return Stepper(
        table.name,
        writer.compile("step", writer.step()),
        writer.compile("piece", writer.piece()),
        writer.compile("error", writer.error()) if table.adaptive else None,
        float(sum(map(abs, table.b))),
    )


def hermite(h: Number, x: State, z: State, slope: State, end: State) -> Polynomial:
    """Cubic Hermite interpolant of a step from its ends and the flow there, order 3 (error O(h**4))."""
    first = tuple(h * f for f in slope)
    second = tuple(3 * (b - a) - h * (2 * f + g) for a, b, f, g in zip(x, z, slope, end, strict=True))
    third = tuple(h * (f + g) - 2 * (b - a) for a, b, f, g in zip(x, z, slope, end, strict=True))
    return first, second, third


def sharpened(fine: Number, coarse: Number, sqrt: Callable[[Number], Number]) -> Number:
    """One error estimate of two: e**2 / sqrt(e**2 + c**2 / 100) (Hairer, Norsett, Wanner, II.10)."""
    square = fine * fine
    total = square + coarse * coarse / 100
    return square / sqrt(total) if total > 0 else square


class _Writer:
    def __init__(self, table: ButcherTableau, dimension: int, arithmetic: Arithmetic) -> None:
        self.table, self.arithmetic = table, arithmetic
        self.states = range(dimension)
        self.namespace: dict[str, Any] = {
            "__builtins__": {},
            "hermite": hermite,
            "sharpened": sharpened,
            "sqrt": arithmetic.sqrt,
        }
        self.evaluated = table.stages - table.last_is_next
        self.smallest = 0 if table.digits is None else Fraction(1, 10**table.digits)

    def compile(self, name: str, lines: list[str]) -> Any:
        exec(compile("\n    ".join(lines) + "\n", f"<hsdsl {self.table.name} {name}>", "exec"), self.namespace)
        return self.namespace[name]

    def number(self, value: Fraction) -> str:
        if self.arithmetic.name == "float64":
            return repr(self.arithmetic.constant(value))
        name = f"q_{'m' if value < 0 else ''}{abs(value.numerator)}_{value.denominator}"
        self.namespace[name] = self.arithmetic.constant(value)
        return name

    def weighted(self, weights: tuple[Fraction, ...], state: int) -> str:
        """Write sum_i weights_i k_i for one state, left to right."""
        terms = [
            self.stage(i, state) if w == 1 else f"{self.number(w)}*{self.stage(i, state)}"
            for i, w in enumerate(weights)
            if w
        ]
        return " + ".join(terms) or self.number(Fraction(0))

    def stage(self, i: int, state: int) -> str:
        return f"g{state}" if i == self.evaluated else f"k{i}_{state}"

    def row(self, letter: str) -> str:
        return self.tuple(f"{letter}{s}" for s in self.states)

    def tuple(self, items: Any) -> str:
        return "(" + "".join(f"{item}, " for item in items).rstrip() + ")"

    def unpack(self, stages: range) -> list[str]:
        if not self.states:
            return []
        return [f"{self.row(f'k{i}_')} = k[{i}]" for i in stages]

    def step(self) -> list[str]:
        lines = ["def step(flow, t, h, x, k0):"]
        if self.states:
            lines += [f"{self.row('x')} = x", f"{self.row('k0_')} = k0"]
        for i in range(1, self.evaluated):
            lines += self.evaluation(i, self.table.a[i])
        z = self.tuple(f"x{s} + h*({self.weighted(self.table.b, s)})" for s in self.states)
        return [*lines, f"return {z}, {self.tuple(f'k{i}' for i in range(self.evaluated))}"]

    def evaluation(self, i: int, row: tuple[Fraction, ...]) -> list[str]:
        """Write the evaluation of one stage."""
        c = sum(row, Fraction(0))
        time = "t + h" if abs(c - 1) <= self.smallest else f"t + {self.number(c)}*h"
        at = [f"x{s} + h*({self.weighted(row, s)})" for s in self.states]
        unpack = [f"{self.row(f'k{i}_')} = k{i}"] if self.states else []
        return [f"k{i} = flow({', '.join([time, *at])})", *unpack]

    def piece(self) -> list[str]:
        lines = ["def piece(flow, t, h, x, z, k, f, g):"]
        if self.table.interpolant == "hermite":
            return [*lines, "return hermite(h, x, z, f, g)"]
        if self.table.dense is None:
            unpack = [f"{self.row('x')} = x", f"{self.row('z')} = z"] if self.states else []
            return [*lines, *unpack, f"return ({self.tuple(f'z{s} - x{s}' for s in self.states)},)"]
        if self.states:
            lines += [*self.unpack(range(self.evaluated)), f"{self.row('g')} = g"]
            lines += [f"{self.row('x')} = x"] if self.table.extra else []
        for i, row in enumerate(self.table.extra, self.evaluated + 1):
            lines += self.evaluation(i, row)
        powers = [
            self.tuple(f"h*({self.weighted(weights, s)})" for s in self.states)
            for weights in zip(*self.table.dense, strict=True)
        ]
        return [*lines, f"return {self.tuple(powers)}"]

    def error(self) -> list[str]:
        lines = ["def error(h, k, g):"]
        if self.states:
            lines += [*self.unpack(range(self.evaluated)), f"{self.row('g')} = g"]
        fine, coarse = self.differences(self.table.embedded), self.differences(self.table.coarse)
        if coarse:
            fine = [f"sharpened({e}, {c}, sqrt)" for e, c in zip(fine, coarse, strict=True)]
        return [*lines, f"return {self.tuple(fine)}"]

    def differences(self, embedded: tuple[Fraction, ...] | None) -> list[str]:
        """Write the method less an embedded one, for each state."""
        if embedded is None:
            return []
        weights = tuple(b - e for b, e in zip(self.table.b, embedded, strict=True))
        return [f"h*({self.weighted(weights, s)})" for s in self.states]


def make_resolved(n: int, tolerance: Number, arithmetic: Arithmetic) -> Resolved:
    """Room for the scales of n states over a step."""
    found, least, slope, near, other, diagonal = ([arithmetic.zero] * n for _ in range(6))
    return Resolved(arithmetic.unit, tolerance, found, least, slope, near, other, diagonal, [0] * n)


def root(x: Number, m: int, arithmetic: Arithmetic) -> Number:
    """Return x**(-1/m); of x 2**(k m) it is exactly 2**-k times as much."""
    fraction, exponent = arithmetic.functions["frexp"](x)
    shift = exponent // m
    rest = arithmetic.functions["ldexp"](fraction, exponent - shift * m)
    return arithmetic.functions["ldexp"](arithmetic.functions["pow"](rest, -1 / (rest * 0 + m)), -shift)


def rows_of(flat: Sequence[Number], n: int) -> list[list[Number]]:
    """Cut n * n derivatives into rows."""
    return [list(flat[i : i + n]) for i in range(0, n * n, n)]


@dataclass
class Derivatives:
    """What implicit steps know of a mode's flow besides its values.

    ``scales`` are those of the states, which grow along the run; ``terms`` is that of a mode; ``places`` are those of
    the derivatives that are not zero everywhere; ``pattern`` is that of a sparse elimination; ``measured`` is that of a
    mode; ``varied`` says which states are derivatives of others, whose errors may be larger where they do not last for
    the time ``soon``. The ``flow`` is that of the last step.
    """

    jacobian: Routine
    scales: Sequence[Number]
    terms: Routine | None = None
    places: Sequence[int] | None = None
    pattern: Elimination | None = None
    measured: Sequence[int] = ()
    varied: Variation | None = None
    soon: Number = 0
    flow: Flow | None = None


@dataclass(frozen=True)
class RadauMethod:
    """The method; its coefficients are made in the number type of a run."""

    name: str = "radau"
    title: str = "Radau IIA, three stages, for stiff flows"
    source: str = "Hairer and Wanner 1996, IV.5 and IV.8, doi:10.1007/978-3-642-05221-7"
    order: int = 5
    error_order: int = 4
    adaptive: bool = True
    digits: int | None = None
    degree: int = 3
    kind: ClassVar[Literal["radau"]] = "radau"
    implicit: ClassVar[bool] = True
    is_series: ClassVar[bool] = False

    def for_tolerance(self, tolerance: Number | None, arithmetic: Arithmetic) -> RadauMethod:
        """Return the method for a tolerance: itself."""
        return self

    def stepper(self, known: Derivatives, tolerance: Number | None, arithmetic: Arithmetic) -> Stepper:
        """Make its step functions, as `hsdsl.engine.integrators.radau.radau_stepper` does."""
        from hsdsl.engine.integrators.radau import radau_stepper

        return radau_stepper(known, tolerance, arithmetic)


RADAU = RadauMethod()
