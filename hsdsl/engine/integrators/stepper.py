"""What makes steps: functions for one dimension and one number type, written from a table; and the scales of states.

The loops over stages and states run once, while the text is written; what remains is a function that a reader (and
another language) can follow line by line, its sums left to right. What is known of implicit methods by their names is
here too; how each steps is in a module that its run imports.

The *scale* of a state is the largest size it has had in a run. No error of a state is held against 1: a state may be a
current of 1e-12 or a pressure of 1e5. A state whose flow is a small difference of large terms, as the speed of a mass
at rest on a spring, may be no more than their round-off. So where a step cannot be accepted, the scale of a state is
not below a share of what these terms could move it by (`resolved`): that share whose tolerance is so many units of
round-off of this, and no more than a thirty-second.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cache
from typing import Any, ClassVar, Literal

from hsdsl.base.graphs import Elimination, Variation
from hsdsl.base.numbers.arithmetic import Arithmetic, Number
from hsdsl.engine.integrators.linear import Matrix, Vector
from hsdsl.engine.integrators.tableau import ButcherTableau
from hsdsl.engine.kernel import Routine

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


SHARE = 32  # the terms of a flow may move a state by at least so many times its scale in a step
NOISE_UNITS, ITERATED = 64, 1024  # of round-off of what they move it by: no tolerance asks for less, nor an iteration
MOVES = 2, -2, 6, -6  # units of round-off; in each probe another digit of a place, to this base, says which
BLUR_UNITS = 4  # units of round-off of its terms that a flow changes by with them


def resolved(
    flow: Flow,
    t: Number,
    h: Number,
    x: State,
    scales: Sequence[Number],
    rows: Matrix | None,
    arithmetic: Arithmetic,
    tolerance: Number | None,
    terms: Flow | None = None,
) -> Vector:
    """The scales over a step of length h, none below a share of what the terms of its flow could move the state by.

    What that is follows from what the last digits of time and states change in the flow or, where these do not tell,
    from ``terms``, which bounds them. A state that they lift moves others in turn. ``rows`` are those of an implicit
    method: there a fast decay forgets round-off.
    """
    slope, moved, lifted = flow(t, *x), list(scales), [False for _ in x]
    share = max(SHARE, (tolerance or 0) / ((ITERATED if rows else NOISE_UNITS) * arithmetic.unit))
    for _ in x:
        sizes = terms(t, *x, *moved) if terms else flow_terms(flow, t, x, slope, moved, arithmetic)
        least = [h * size for size in sizes]
        if rows:
            least = [a / (1 + h * abs(row[i])) for i, (a, row) in enumerate(zip(least, rows, strict=True))]
        more = [arithmetic.isfinite(a) and a > share * s for a, s in zip(least, scales, strict=True)]
        moved = [max(m, a) if new else m for m, a, new in zip(moved, least, more, strict=True)]
        if not any(new and not old for new, old in zip(more, lifted, strict=True)):
            break
        lifted = [new or old for new, old in zip(more, lifted, strict=True)]
    return [max(s, m / share) for s, m in zip(scales, moved, strict=True)]


def flow_terms(
    flow: Flow, t: Number, x: State, slope: State, moved: Sequence[Number], arithmetic: Arithmetic
) -> Vector:
    """The sizes of the terms of a flow, by what the last digits of states that were ``moved`` so far change in it.

    No two of 255 states, and no state and time, move alike in all probes: the terms of a difference do not stay equal.
    """
    unit = arithmetic.unit
    found: Vector = [arithmetic.zero for _ in x]
    for probe, every in enumerate((1, 4, 16, 64)):
        moves = [MOVES[(i // every + probe) % 4] * unit for i in range(len(x) + 1)]
        near = tuple(a + move * s for a, move, s in zip(x, moves, moved, strict=False))
        other = flow(t + moves[-1] * t, *near)
        found = [max(d, abs(a - b)) for d, a, b in zip(found, other, slope, strict=True)]
    return [d / (BLUR_UNITS * unit) for d in found]


def root(x: Number, m: int, arithmetic: Arithmetic) -> Number:
    """Return x**(-1/m); of x 2**(k m) it is exactly 2**-k times as much."""
    fraction, exponent = arithmetic.functions["frexp"](x)
    shift = exponent // m
    rest = arithmetic.functions["ldexp"](fraction, exponent - shift * m)
    return arithmetic.functions["ldexp"](arithmetic.functions["pow"](rest, -1 / (rest * 0 + m)), -shift)


def rows_of(flat: Sequence[Number], n: int) -> Matrix:
    """Cut n * n derivatives into rows."""
    return [list(flat[i : i + n]) for i in range(0, n * n, n)]


@dataclass(frozen=True)
class Derivatives:
    """What implicit steps know of a mode's flow besides its values.

    ``scales`` are those of the states, which grow along the run; ``terms`` is that of a mode;
    ``pattern`` is that of a sparse elimination; ``measured`` is that of a mode; ``varied`` says which states are
    derivatives of others, whose errors may be larger where they do not last for the time ``soon``.
    """

    jacobian: Routine
    scales: Sequence[Number]
    terms: Routine | None = None
    pattern: Elimination | None = None
    measured: Sequence[int] = ()
    varied: Variation | None = None
    soon: Number = 0


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
