"""Taylor series of any order: each step is the solution's own polynomial, from recurrences along the flow.

The coefficients come from a model's tape (`program.Tape`), so a flow must be smooth. The order follows from the
tolerance. Scheme `relaxed` chooses steps by the error estimate as for every method, `located` from the last term and
the first that is left out: A. Jorba and M. Zou, A software package for the numerical integration of ODEs by means of
high-order Taylor methods, Experimental Mathematics 14, 2005 (doi:10.1080/10586458.2005.10128904).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from math import ceil
from typing import ClassVar, Literal

from hsdsl.base.numbers.arithmetic import DOMAIN_ERRORS, NOTHING, Arithmetic, Number
from hsdsl.engine.integrators.stepper import Flow, Polynomial, Stages, State, Stepper, root
from hsdsl.engine.kernel import Taylor

LEAST_ORDER = 4
FURTHER = 2  # beyond the order whose coefficients are the least work


class NoSeries(ValueError):
    """The flow has no Taylor series at a point, though it may have a value there (the square root of 0)."""


@dataclass(frozen=True)
class TaylorMethod:
    """The method before (``order`` 0) or after it knows its order."""

    order: int = 0
    name: str = "taylor"
    title: str = "Taylor series, order from the tolerance"
    source: str = "Jorba and Zou 2005, doi:10.1080/10586458.2005.10128904"
    adaptive: bool = True
    digits: int | None = None
    kind: ClassVar[Literal["taylor"]] = "taylor"
    implicit: ClassVar[bool] = False
    is_series: ClassVar[bool] = True

    @property
    def degree(self) -> int:
        """Degree of a step's polynomial."""
        return self.order

    @property
    def error_order(self) -> int:
        """The power of h that the error estimate falls with."""
        return self.order

    def for_tolerance(self, tolerance: Number | None, arithmetic: Arithmetic) -> TaylorMethod:
        """Choose the order; without a tolerance that of round-off.

        The order with the least work in coefficients alone is 1 - log(tolerance)/2 (Jorba and Zou, 3.2). The other
        costs of a step make longer steps of a slightly higher order cheaper.
        """
        smallest = max(arithmetic.unit, tolerance or 0)
        order = ceil(1 + FURTHER - arithmetic.functions["log"](smallest) / 2)
        return replace(self, order=max(LEAST_ORDER, int(order)))


TAYLOR = TaylorMethod()


def taylor_stepper(method: TaylorMethod, series: Taylor, arithmetic: Arithmetic) -> Stepper:
    """Make step functions from a mode's series; trials from one point share its coefficients."""
    order, zero = method.order, arithmetic.zero
    known: dict[tuple[Number, State], Stages] = {}

    def coefficients(t: Number, x: State) -> Stages:
        if (t, x) not in known:
            known.clear()
            known[t, x] = terms(series, order, t, x)
        return known[t, x]

    def step(flow: Flow, t: Number, h: Number, x: State, slope: State) -> tuple[State, Stages]:
        stages = coefficients(t, x)
        z = stages[-2] if x else ()
        for c in reversed((x, *stages[:-2])):
            z = tuple(a + h * b for a, b in zip(c, z, strict=True))
        return z, stages

    def piece(
        flow: Flow, t: Number, h: Number, x: State, z: State, stages: Stages, slope: State, end: State
    ) -> Polynomial:
        return along(stages, h)

    def along(stages: Stages, h: Number) -> Polynomial:
        power, parts = zero + 1, list[State]()
        for c in stages[:-1]:
            power = power * h
            parts.append(tuple(a * power for a in c))
        return tuple(parts)

    def error(h: Number, stages: Stages, end: State) -> State:
        """How badly the polynomial solves the equation at its end: (h X' - h f) / (order + 1)."""
        parts = along(stages, h)
        moved = tuple(order * part for part in parts[-1])
        for m in range(order - 1, 0, -1):
            moved = tuple(m * part + b for part, b in zip(parts[m - 1], moved, strict=True))
        return tuple((a - h * b) / (order + 1) for a, b in zip(moved, end, strict=True))

    return Stepper(method.name, step, piece, error)


def terms(series: Taylor, order: int, t: Number, x: State) -> Stages:
    """Return the coefficients 1 to order + 1 of all states, by coefficient.

    Raises NoSeries: there is none at this point.
    """
    try:
        lines = series.flow(order, t, x)
    except DOMAIN_ERRORS as problem:
        raise NoSeries(str(problem)) from None
    return tuple(tuple(line[m] for line in lines[1 : len(x) + 1]) for m in range(1, order + 2))


def proposed_step(stages: Stages, scales: Sequence[Number], tolerance: Number, arithmetic: Arithmetic) -> Number | None:
    """The step at which the first terms that are left out stay below the tolerance; None where all of them vanish.

    Both the last term of the polynomial and the one after it count, so that an even or odd solution is no trap. With l
    the largest coefficient of order m relative to the tolerance, h = l**(-1/m); one more of order m + 1 asks for less
    only where it exceeds l/h. A state that has been zero so far, or too small for digits, is compared with the first of
    its own terms.
    """
    least, before = None, arithmetic.zero
    for m in (len(stages) - 1, len(stages)):
        largest = arithmetic.zero
        for c, s in zip(stages[m - 1], scales, strict=True):
            if tolerance * s > NOTHING:
                largest = max(largest, abs(c) / (tolerance * s))
        if largest > 0 and (least is None or largest * least > before):
            h = root(largest, m, arithmetic)
            least = h if least is None else min(h, least)
        before = largest
    for i, s in enumerate(scales):
        if not tolerance * s > NOTHING:
            for h in _from_zero(tuple(c[i] for c in stages), tolerance, arithmetic):
                least = h if least is None else min(h, least)
    return least


def _from_zero(c: State, tolerance: Number, arithmetic: Arithmetic) -> Iterator[Number]:
    """The steps that keep the terms left out below the tolerance, relative to the first that is not 0.

    A state whose first term is in the later half of them, as that of a mass at the other end of a chain, has too few
    digits to keep any.
    """
    last = len(c) - 1
    first = next((k for k in range(last - 1) if c[k] != 0), last)
    allowed = tolerance * abs(c[first])
    for k in (last - 1, last):
        if first <= last // 2 and c[k] != 0 and allowed > NOTHING:
            yield root(abs(c[k]) / allowed, k - first, arithmetic)
