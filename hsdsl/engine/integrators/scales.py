"""The scale of a state: the largest size it has had in a run, and what round-off in its flow makes of that.

No error of a state is held against 1: a state may be a current of 1e-12 or a pressure of 1e5. A state whose flow is a
small difference of large terms, as the speed of a mass at rest on a spring, may be no more than their round-off. So
where a step cannot be accepted, the scale of a state is not below a share of what these terms could move it by: that
share whose tolerance is so many units of round-off of this, and no more than a thirty-second.
"""

from __future__ import annotations

from collections.abc import Sequence

from hsdsl.base.numbers.arithmetic import Arithmetic, Number
from hsdsl.engine.integrators.linear import Matrix, Vector
from hsdsl.engine.integrators.stepper import Flow, State

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
