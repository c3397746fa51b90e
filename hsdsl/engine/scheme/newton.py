"""Simplified Newton iterations for the equations of a Radau IIA step, and when they stop: see radau."""

from __future__ import annotations

from dataclasses import dataclass

from hsdsl.base.numbers.arithmetic import Number
from hsdsl.engine.scheme.linear import Blocks, Factors, solve_all, solve_all_complex
from hsdsl.engine.scheme.primitives import (
    Collocation,
    Here,
    Room,
    Time,
    Vector,
    each,
    flow_at,
    inline,
    may_fail,
    sum_of,
)
from hsdsl.engine.scheme.scales import Resolved, is_finite

MOST_ITERATIONS = 7  # Largest number of iterations of a step that has a tolerance.
RENEWED = 1e-3  # The Jacobian is stale if the convergence rate exceeds this.
FEW = 2  # A stale Jacobian is renewed only if a step took more iterations than this.
LEAST_LEFT = 1e-3  # Iterations of a step that has a tolerance may always leave this share of it.
MOST_LEFT = 0.03  # They may never leave more than this share.
DIVERGING = 0.99  # A step is too long if the convergence rate reaches this.
SLOW_RATE = 0.5  # The same limit for iterations to round-off.
NEWTON_NOISE = 1024  # A correction of at most this many units of round-off, relative to the scales, may be noise.
NEWTON_SHARE = 1e-2  # Iterations to round-off of a badly conditioned step may end with this share of the tolerance.


@dataclass
class Radau:
    """Steps along one stretch of flow, and what one leaves for the next; lists have an item for each of 3 stages.

    A stretch is flow in one mode and one input segment.
    """

    unit: Number  # of round-off
    tolerance: Number  # of a step; 0 where steps are solved to round-off
    enough: Number  # share of the tolerance that iterations may leave: kappa of Hairer and Wanner
    soon: Number  # initial step size of the run
    most: int  # largest number of iterations to round-off
    has_jacobian: bool  # whether ``rows`` have a Jacobian of this stretch
    stepped: bool  # whether ``last`` is of this stretch
    factored: bool  # whether ``factors`` are those of ``rows`` for the length ``factored_for``
    jacobian_at: Time  # when ``rows`` were evaluated
    factored_for: Number
    start: Time  # of the step whose polynomial is in ``last``
    length: Number  # of that step
    rate: Number  # convergence rate theta: the ratio of the last two changes; 1 where it is not known
    eta: Number  # theta / (1 - theta): the sum of all further changes, relative to the last one
    stale: bool  # whether the next step evaluates the Jacobian again
    lifted: bool  # whether round-off of the flow has raised scales: none is below ``least`` then
    rows: Room  # the Jacobian: its entries that are not zero everywhere, row by row
    fresh: Room  # room for the next Jacobian
    lasting: Room  # of each sensitivity: the share of an error that remains after the time ``soon``
    scales: Vector  # with which the last step was solved
    least: Room
    z: list[Room]  # increments Z
    last: list[Room]  # coefficients of the polynomial of the last solved step, by its share
    ended: Room  # increment at the end of that step
    whole: bool  # whether ``z`` are of that step, not of a part of it
    transformed: list[Room]  # increments transformed by the inverse of T: W = T^-1 Z
    change: list[Room]  # what an iteration adds to ``transformed``
    slopes: list[Room]  # the flow at the stages
    right: list[Room]  # right-hand sides of an iteration
    largest: Room  # largest size in ``change`` of each state
    error: Room  # estimate for each state
    at: Room  # room for a point at which the flow is evaluated
    factors: Factors
    resolved: Resolved


@inline
def weighted(w: Vector, a: Number, b: Number, c: Number) -> Number:
    """Return a weighted sum of three."""
    return w[0] * a + w[1] * b + w[2] * c


def enough_of(unit: Number, tolerance: Number, root: Number) -> Number:
    """Return the share of the tolerance that iterations may leave; ``root`` is that of the tolerance."""
    return max(10 * unit / tolerance, min(MOST_LEFT, max(LEAST_LEFT, root)))


@inline
def scaled(steps: Radau, of: Blocks, x: Vector) -> Number:
    """Return the largest change relative to the scales.

    A state that has been zero so far has no scale: its largest size at the stages counts instead. It also counts
    instead of a scale from round-off alone that is at most the tolerance times this size.
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
    """Count the states that have been zero so far and no longer are: each may make another so, an iteration later."""
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
    """Make one simplified Newton iteration for Z = h A f(x + Z), transformed by T to one real and one complex system.

    Return whether the increments after it, and the largest change of each state, are finite.
    """
    n = of.n
    for i in range(3):
        at, moved = steps.at, steps.z[i]
        for s in each(n):
            at[s] = x[s] + moved[s]
        flow_at(here, t + known.node[i] * h, at, steps.slopes[i])
    u, v, w = steps.transformed[0], steps.transformed[1], steps.transformed[2]
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
        x0, x1, x2 = u[s] + a[s], v[s] + b[s], w[s] + c[s]
        size0, size1, size2 = abs(a[s]), abs(b[s]), abs(c[s])
        largest[s] = max(size0, size1, size2)
        p[s] = size0 + size1 + size2
        u[s] = x0
        v[s] = x1
        w[s] = x2
        z0[s] = weighted(known.mix[0], x0, x1, x2)
        z1[s] = weighted(known.mix[1], x0, x1, x2)
        z2[s] = weighted(known.mix[2], x0, x1, x2)
    return is_finite(sum_of(p, n))


@inline
@may_fail
def to_tolerance(here: Here, of: Blocks, known: Collocation, steps: Radau, t: Time, h: Number, x: Vector) -> bool:
    """Iterate until all further changes are a small share of the tolerance.

    Return False where MOST_ITERATIONS are too few for that.
    """
    noise = NEWTON_NOISE * steps.unit / steps.tolerance
    # the first iteration has no rate: eta_0 = max(eta of the step before, unit)**0.8 (Hairer and Wanner 1996, IV.8)
    eta = max(steps.eta, steps.unit) ** ((steps.unit * 0 + 4) / 5)
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
            eta = rate / (1 - rate)
        steps.stale = count > FEW and steps.rate > RENEWED
        ahead = eta * size
        if size == 0 or ahead <= steps.enough:
            steps.eta = eta
            return True
        if rated:
            for _next in range(count, MOST_ITERATIONS):
                ahead = ahead * steps.rate
            if ahead > steps.enough and size > noise:
                break
        before = size
    steps.rate = 1
    steps.eta = 1
    steps.stale = True
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
    """Iterate until the next correction would be below the last digit, or corrections are noise.

    Return False where they stop shrinking before that.
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
            steps.stale = rate > RENEWED
            return True
        if before != 0 and rate >= SLOW_RATE and count > 1 + followers(steps, of, x):
            if size <= allowed:
                return True
            steps.rate = 1
            steps.stale = True
            return False
        before = size
    return True
