"""The equations of a step by Radau IIA, solved by Newton's method, and when its iterations stop: see radau."""

from __future__ import annotations

from dataclasses import dataclass

from hsdsl.base.numbers.arithmetic import Number
from hsdsl.engine.scheme.linear import Blocks, Factors, solve_all, solve_all_complex
from hsdsl.engine.scheme.primitives import Collocation, flow_at, sum_of
from hsdsl.engine.scheme.scales import Resolved, is_finite
from hsdsl.engine.scheme.words import Here, Room, Time, Vector, each, inline, may_fail

MOST_ITERATIONS = 7  # iterations of a step that has a tolerance
RENEWED = 1e-3  # an iteration that leaves more than this of the one before has old derivatives,
FEW = 2  # which matters where a step takes more than these
LEAST_LEFT = 1e-3  # of the tolerance: what the iterations of such a step may leave,
MOST_LEFT = 0.03  # and at most
DIVERGING = 0.99  # an iteration that leaves more than this of the one before is one of too long a step
SLOW_RATE = 0.5  # likewise for iterations that go on to round-off
NEWTON_NOISE = 1024  # units of round-off, relative to the scales: a correction this small may be all noise
NEWTON_SHARE = 1e-2  # of the tolerance, likewise: what an iteration may leave in a badly conditioned step


@dataclass
class Radau:
    """Steps along one stretch of flow, and what one leaves for the next.

    A step has a ``tolerance``, or 0, and is made to leave ``enough`` of it; a run tries the length ``soon`` first. To
    round-off it iterates ``most`` times. There are derivatives of the flow (``rows``), ``derived_at`` a time, and
    factors of their matrices for the length ``factored_for``; ``last`` has the increments of a step from ``start`` of
    this ``length``. The last iteration left the share ``rate`` of the one before it, 1 where that is not known; all
    that follow would have added ``left`` of the last one; derivatives that have ``aged`` are renewed for the next step.
    ``scales`` are those that the last step was solved with, where round-off of the flow ``lifted`` them not below
    ``least``.
    """

    unit: Number
    tolerance: Number
    enough: Number
    soon: Number
    most: int
    derived: bool
    stepped: bool
    factored: bool
    derived_at: Time
    factored_for: Number
    start: Time
    length: Number
    rate: Number
    left: Number
    aged: bool
    lifted: bool
    rows: Room
    fresh: Room
    lasting: Room
    scales: Vector
    least: Room
    z: list[Room]
    last: list[Room]
    apart: list[Room]
    change: list[Room]
    slopes: list[Room]
    right: list[Room]
    largest: Room
    error: Room
    at: Room
    factors: Factors
    resolved: Resolved


@inline
def weighted(w: Vector, a: Number, b: Number, c: Number) -> Number:
    """A weighted sum of three."""
    return w[0] * a + w[1] * b + w[2] * c


def enough_of(unit: Number, tolerance: Number, root: Number) -> Number:
    """The share of the tolerance that iterations may leave; ``root`` is that of the tolerance."""
    return max(10 * unit / tolerance, min(MOST_LEFT, max(LEAST_LEFT, root)))


@inline
def scaled(steps: Radau, of: Blocks, x: Vector) -> Number:
    """The largest change relative to the scales; of a state that has been zero so far, to where it is now.

    A scale by the round-off of what made that zero, no more than the tolerance times where it is now, is none.
    """
    size: Number = 0
    u, v, w = steps.z[0], steps.z[1], steps.z[2]
    for s in range(of.n):
        change, reach = steps.largest[s], steps.scales[s]
        if change > 0:
            if not reach > 0 or (steps.lifted and x[s] == 0):
                now = max(abs(x[s] + u[s]), abs(x[s] + v[s]), abs(x[s] + w[s]))
                reach = reach if reach > steps.tolerance * now else now
            size = max(size, change / reach if reach > 0 else reach + 1)
    return size


@inline
def followers(steps: Radau, of: Blocks, x: Vector) -> int:
    """How many states that have been zero so far no longer are: each may follow another one, an iteration later."""
    count = 0
    for s in range(of.n):
        if not steps.scales[s] > 0:
            moved = False
            for i in range(3):
                moved |= abs(x[s] + steps.z[i][s]) > 0
            count += moved
    return count


@inline
@may_fail
def iterate(here: Here, of: Blocks, known: Collocation, steps: Radau, t: Time, h: Number, x: Vector) -> bool:
    """Iterate once by Newton's method on Z = h A f(x + Z), in the coordinates that take A apart.

    Whether the increments after it, and the largest change of each state, are finite.
    """
    n = of.n
    for i in range(3):
        at, moved = steps.at, steps.z[i]
        for s in each(n):
            at[s] = x[s] + moved[s]
        flow_at(here, t + known.node[i] * h, at, steps.slopes[i])
    u, v, w = steps.apart[0], steps.apart[1], steps.apart[2]
    e, f, g = steps.slopes[0], steps.slopes[1], steps.slopes[2]
    p, q, r = steps.right[0], steps.right[1], steps.right[2]
    gamma, alpha, beta = known.gamma, known.alpha, known.beta
    for s in each(n):
        p[s] = h * weighted(known.unmix[0], e[s], f[s], g[s]) - gamma * u[s]
        q[s] = h * weighted(known.unmix[1], e[s], f[s], g[s]) - (alpha * v[s] + beta * w[s])
        r[s] = h * weighted(known.unmix[2], e[s], f[s], g[s]) - (alpha * w[s] - beta * v[s])
    a, b, c = steps.change[0], steps.change[1], steps.change[2]
    solve_all(of, steps.factors, p, a)
    solve_all_complex(of, steps.factors, q, r, b, c)
    z0, z1, z2, largest = steps.z[0], steps.z[1], steps.z[2], steps.largest
    for s in each(n):
        u[s] = u[s] + a[s]
        v[s] = v[s] + b[s]
        w[s] = w[s] + c[s]
        z0[s] = weighted(known.mix[0], u[s], v[s], w[s])
        z1[s] = weighted(known.mix[1], u[s], v[s], w[s])
        z2[s] = weighted(known.mix[2], u[s], v[s], w[s])
        largest[s] = max(abs(a[s]), abs(b[s]), abs(c[s]))
        p[s] = abs(a[s]) + abs(b[s]) + abs(c[s])
    return is_finite(sum_of(p, n))


@inline
@may_fail
def to_tolerance(here: Here, of: Blocks, known: Collocation, steps: Radau, t: Time, h: Number, x: Vector) -> bool:
    """Iterate until what is left is a small share of the tolerance.

    False where it will not be, within the iterations that a step may take.
    """
    noise = NEWTON_NOISE * steps.unit / steps.tolerance
    left = max(steps.left, steps.unit) ** ((steps.unit * 0 + 4) / 5)
    before: Number = 0
    for count in range(1, MOST_ITERATIONS + 1):
        goes_on = iterate(here, of, known, steps, t, h, x)
        if not goes_on:
            return False
        rated = count > 1 and count > 1 + followers(steps, of, x)
        size = scaled(steps, of, x) / steps.tolerance
        if rated:
            rate = size / before
            if rate >= DIVERGING:
                if size <= noise:
                    return True
                break
            steps.rate = rate
            left = rate / (1 - rate)
        steps.aged = count > FEW and steps.rate > RENEWED
        ahead = left * size
        if size == 0 or ahead <= steps.enough:
            steps.left = left
            return True
        if rated:
            for _next in range(count, MOST_ITERATIONS):
                ahead = ahead * steps.rate
            if ahead > steps.enough and size > noise:
                break
        before = size
    steps.rate = 1
    steps.left = 1
    steps.aged = True
    return False


@inline
def is_below_digits(steps: Radau, of: Blocks, x: Vector, rate: Number) -> bool:
    """Whether the next corrections would be below the last digits of x and of all stages."""
    u, v, w = steps.z[0], steps.z[1], steps.z[2]
    for s in range(of.n):
        reach = max(abs(x[s]), abs(x[s] + u[s]), abs(x[s] + v[s]), abs(x[s] + w[s]))
        if not rate * steps.largest[s] <= steps.unit * reach:
            return False
    return True


@inline
@may_fail
def to_roundoff(here: Here, of: Blocks, known: Collocation, steps: Radau, t: Time, h: Number, x: Vector) -> bool:
    """Iterate until the next correction would be below the last digit, or they are all noise.

    False where they become no smaller before that.
    """
    allowed = max(NEWTON_NOISE * steps.unit, NEWTON_SHARE * steps.tolerance)
    before: Number = 0
    for count in range(1, steps.most + 1):
        goes_on = iterate(here, of, known, steps, t, h, x)
        if not goes_on:
            return False
        size = scaled(steps, of, x)
        rate = SLOW_RATE if before == 0 else size / before
        if size == 0 or (rate < SLOW_RATE and is_below_digits(steps, of, x, rate)):
            steps.rate = rate
            steps.aged = rate > RENEWED
            return True
        if before != 0 and rate >= SLOW_RATE and count > 1 + followers(steps, of, x):
            if size <= allowed:
                return True
            steps.rate = 1
            steps.aged = True
            return False
        before = size
    return True
