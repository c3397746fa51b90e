"""Radau IIA of order 5: the method for stiff modes, implicit, with the derivatives of the flow from the model itself.

A step is collocation at the nodes (4 - sqrt 6)/10, (4 + sqrt 6)/10 and 1: the polynomial u of degree 3 from the step's
start that has the flow's slope at these three times. It is L-stable: what decays fast is gone after one step, however
long. The unknowns are the increments Z_i = u(t + c_i h) - x, with Z = h A f(x + Z). A similarity T (``mix``) makes the
inverse of A block diagonal, with one real eigenvalue and one complex pair. So a simplified Newton iteration for
W = T^-1 Z solves one real and one complex system instead of one of three times the size.

The Jacobian and the factors of two matrices are expensive, so steps share them. The Jacobian J is kept while the
iterations converge fast; the factors are kept while the step size also stays the same. Starting values extrapolate the
last step's polynomial. The iterations converge linearly. The last two changes show their rate, and the sum of all
further changes follows from it.

Sensitivities are states that are derivatives of others (`linear.Blocks`): the variational equation.

E. Hairer and G. Wanner, Solving Ordinary Differential Equations II, Springer 1996, IV.5 and IV.8
(doi:10.1007/978-3-642-05221-7).
"""

from __future__ import annotations

from hsdsl.base.graphs import Elimination
from hsdsl.base.numbers.arithmetic import DOMAIN_ERRORS, Number
from hsdsl.engine.scheme.linear import (
    Blocks,
    factored,
    factored_complex,
    solve_columns,
    solve_own,
    sparse_factored,
    sparse_factored_complex,
)
from hsdsl.engine.scheme.newton import Radau, to_roundoff, to_tolerance, weighted
from hsdsl.engine.scheme.primitives import (
    Collocation,
    Here,
    Indices,
    Room,
    Time,
    Vector,
    derivatives_at,
    each,
    flow_at,
    inline,
    may_fail,
)
from hsdsl.engine.scheme.scales import resolve


def begin_stretch(steps: Radau, of: Blocks) -> None:
    """Begin another stretch of flow: nothing that earlier steps left is valid there."""
    for s in range(of.n, of.width):  # these do not flow
        steps.largest[s] = 0
        steps.error[s] = 0
        steps.ended[s] = 0
        for i in range(3):
            steps.z[i][s] = 0
            steps.last[i][s] = 0
    steps.has_jacobian = False
    steps.factored = False
    steps.stepped = False
    steps.rate = 1
    steps.eta = 1
    steps.stale = False
    steps.lifted = False


@inline
def fill_diagonal(of: Blocks, rows: Vector, diagonal: Room) -> None:
    """Find the diagonal of the Jacobian, with its zeros."""
    at = 0
    for s in range(of.width):
        diagonal[s] = 0
        while at < of.entries and of.places[at] < s * (of.width + 1):
            at += 1
        if at < of.entries and of.places[at] == s * (of.width + 1):
            diagonal[s] = rows[at]


@may_fail
def evaluate_jacobian(here: Here, of: Blocks, steps: Radau, t: Time, x: Vector) -> None:
    """Evaluate the Jacobian, and of sensitivities the share of an error that remains after the time ``soon``."""
    # into `fresh` first, then exchanged: where this fails, `rows` still has the earlier Jacobian
    derivatives_at(here, t, x, steps.fresh)
    rows = steps.fresh
    steps.fresh = steps.rows
    steps.rows = rows
    if of.varied is not None:
        fill_diagonal(of, rows, steps.lasting)
        for s in range(of.own, of.n):
            steps.lasting[s] = 1 / (1 + steps.soon * abs(steps.lasting[s]))
    steps.has_jacobian = True
    steps.jacobian_at = t
    steps.factored = False


def factor_sparse(of: Blocks, pattern: Elimination, known: Collocation, steps: Radau, h: Number) -> bool:
    """Factor the same matrices as `factor_dense`, in the pattern of a sparse elimination."""
    by = steps.factors
    for i in range(pattern.size):
        by.real[i] = 0
        by.re[i] = 0
        by.im[i] = 0
    for i in range(of.inside):
        by.real[pattern.place[i]] = -h * steps.rows[i]
        by.re[pattern.place[i]] = -h * steps.rows[i]
    for i in range(of.own):
        own = pattern.diagonal[i]
        by.real[own] = known.gamma + by.real[own]
        by.re[own] = known.alpha + by.re[own]
        by.im[own] = -known.beta
    return sparse_factored(of.own, pattern, by.real, by.scratch[0]) and sparse_factored_complex(
        of.own, pattern, by.re, by.im, by.scratch[0], by.scratch[1]
    )


@inline
def factor_dense(of: Blocks, known: Collocation, steps: Radau, h: Number, scales: Vector) -> bool:
    """Factor gamma I - h J and (alpha - i beta) I - h J as dense matrices; return whether they have inverses."""
    n, by = of.own, steps.factors
    for i in range(n * n):
        by.real[i] = 0
        by.im[i] = 0
    for i in range(of.inside):
        at = of.places[i]
        by.real[at if n == of.width else at // of.width * n + at % of.width] = -h * steps.rows[i]
    for i in range(n * n):
        by.re[i] = by.real[i]
    for i in range(n):
        by.real[i * n + i] = known.gamma + by.real[i * n + i]
        by.re[i * n + i] = known.alpha + by.re[i * n + i]
        by.im[i * n + i] = -known.beta
    return factored(n, by.real, by.order, scales, of.varied) and factored_complex(
        n, by.re, by.im, by.turned, scales, of.varied
    )


@inline
def factor_all(of: Blocks, known: Collocation, steps: Radau, h: Number, scales: Vector) -> bool:
    """Factor gamma I - h J and (alpha - i beta) I - h J, unless that is done; return whether they have inverses."""
    if not (steps.factored and steps.factored_for == h):
        v, pattern = of.varied, of.pattern
        if v is not None:
            for e in range(v.links):
                steps.factors.links[e] = h * steps.rows[v.link[e]]
        steps.factored_for = h
        if pattern is None:
            steps.factored = factor_dense(of, known, steps, h, scales)
        else:
            steps.factored = factor_sparse(of, pattern, known, steps, h)
    return steps.factored


@inline
def starting_values(of: Blocks, known: Collocation, steps: Radau, t: Time, h: Number) -> None:
    """Extrapolate the last step's polynomial, or interpolate it where it began here; else start from zero."""
    # x, y, z are increments, not states; u, v, w are the transformed ones
    x, y, z = steps.z[0], steps.z[1], steps.z[2]
    u, v, w = steps.transformed[0], steps.transformed[1], steps.transformed[2]
    behind = steps.stepped and t == steps.start + steps.length
    if behind or (steps.stepped and t == steps.start):
        e, f, g, ended = steps.last[0], steps.last[1], steps.last[2], steps.ended
        if not behind:
            ended = steps.change[0]
            for s in range(of.n):
                ended[s] = 0
        share, base = h / steps.length, 1 if behind else 0
        first, second, third = base + known.node[0] * share, base + known.node[1] * share, base + known.node[2] * share
        for s in each(of.n):
            a, b, c, end = e[s], f[s], g[s], ended[s]
            i = first * (a + first * (b + first * c)) - end
            j = second * (a + second * (b + second * c)) - end
            k = third * (a + third * (b + third * c)) - end
            x[s] = i
            y[s] = j
            z[s] = k
            u[s] = weighted(known.unmix[0], i, j, k)
            v[s] = weighted(known.unmix[1], i, j, k)
            w[s] = weighted(known.unmix[2], i, j, k)
    else:
        for s in range(of.n):
            x[s] = 0
            y[s] = 0
            z[s] = 0
            u[s] = 0
            v[s] = 0
            w[s] = 0


def look_closer(here: Here, of: Blocks, steps: Radau, t: Time, h: Number, x: Vector, scales: Vector) -> None:
    """Raise the scales of the states by the round-off of the terms of the flow, for this step and those that follow."""
    fill_diagonal(of, steps.rows, steps.resolved.diagonal)
    try:
        resolve(here, steps.resolved, of.width, t, h, x, scales, True)
    except DOMAIN_ERRORS:
        return
    steps.scales = steps.resolved.found
    steps.lifted = False
    for s in range(of.width):
        steps.lifted |= steps.scales[s] > scales[s]
        steps.least[s] = steps.scales[s]


@inline
@may_fail
def solve_step(
    here: Here, of: Blocks, known: Collocation, steps: Radau, t: Time, h: Number, x: Vector, scales: Vector,
    exactly: bool,
) -> bool:  # fmt: skip
    """Solve Z = h A f(x + Z), first with the Jacobian of an earlier step; return whether it is solved."""
    if not steps.has_jacobian or (steps.stale and steps.jacobian_at != t):
        evaluate_jacobian(here, of, steps, t, x)
    closer = False
    # at most three tries: with the Jacobian at hand; with that at t; with that and scales by a closer look
    while True:
        steps.scales = scales
        if steps.lifted:
            for s in range(of.width):
                steps.resolved.found[s] = max(scales[s], steps.least[s])
            steps.scales = steps.resolved.found
        if closer:
            look_closer(here, of, steps, t, h, x, scales)
        starting_values(of, known, steps, t, h)
        done = factor_all(of, known, steps, h, scales)
        if done and exactly:
            done = to_roundoff(here, of, known, steps, t, h, x)
        elif done:
            done = to_tolerance(here, of, known, steps, t, h, x)
        if done or (closer and steps.jacobian_at == t):
            return done
        if steps.jacobian_at != t:
            evaluate_jacobian(here, of, steps, t, x)
        else:
            closer = True


@inline
def larger(a: Number, b: Number) -> Number:
    """Return the one of larger size."""
    return a if abs(a) >= abs(b) else b


@inline
@may_fail
def estimate(
    here: Here, of: Blocks, known: Collocation, steps: Radau, t: Time, h: Number, x: Vector, slope: Vector
) -> None:
    """Estimate the errors of a step's end and of its dense output; for each state the larger one counts.

    Both are (gamma I - h J)^-1 times a defect. The first defect is that of the embedded method, from the flow at the
    start (Hairer and Wanner, IV.8.19). It stays as large as a decay that the step is too long to resolve. For stiff
    states that follow a slow motion it is far too small for the dense output. The second defect therefore compares the
    flow with the polynomial at one more point, where the polynomial's slope is farthest off.

    Where steps resolve a decay, the first estimate is 2.7 times the second, and that is 1.5 times the largest error of
    the dense output. The end is off by far less, and a sensitivity that decays soon forgets it. No crossing depends on
    sensitivities: their first defect counts only by the share ``lasting``.
    """
    n, at, error = of.n, steps.at, steps.error
    u, v, w = steps.z[0], steps.z[1], steps.z[2]
    inside, first, second = steps.slopes[0], steps.right[0], steps.right[1]
    for s in each(n):
        at[s] = x[s] + weighted(known.value, u[s], v[s], w[s])
    flow_at(here, t + known.share * h, at, inside)
    for s in each(n):
        first[s] = h * slope[s] + weighted(known.estimate, u[s], v[s], w[s])
        second[s] = h * inside[s] - weighted(known.slope, u[s], v[s], w[s])
    embedded, along = steps.change[0], steps.change[1]
    solve_own(of, steps.factors, first, embedded)
    solve_own(of, steps.factors, second, along)
    for s in range(of.own):
        error[s] = larger(embedded[s], along[s])
    for s in range(of.own, n):
        first[s] = larger(first[s] * steps.lasting[s], second[s])
    solve_columns(of, steps.factors, first, error)


@inline
@may_fail
def radau_step(
    here: Here, of: Blocks, known: Collocation, steps: Radau, t: Time, h: Number, x: Vector, slope: Vector,
    scales: Vector, z: Room,
) -> bool:  # fmt: skip
    """Try a step to z, solved as well as its tolerance asks for; return whether it is solved."""
    if of.n == 0:
        return True
    solved = solve_step(here, of, known, steps, t, h, x, scales, not steps.tolerance > 0)
    if solved:
        steps.stepped = True
        steps.start = t
        steps.length = h
        steps.whole = True
        u, v, w = steps.z[0], steps.z[1], steps.z[2]
        e, f, g, ended = steps.last[0], steps.last[1], steps.last[2], steps.ended
        for s in each(of.n):
            i, j, k = u[s], v[s], w[s]
            e[s] = weighted(known.power[0], i, j, k)
            f[s] = weighted(known.power[1], i, j, k)
            g[s] = weighted(known.power[2], i, j, k)
            ended[s] = k
        if steps.tolerance > 0:
            estimate(here, of, known, steps, t, h, x, slope)
        for s in range(of.width):
            z[s] = x[s] + steps.z[2][s]
    return solved


@may_fail
def take_slopes(
    here: Here, of: Blocks, known: Collocation, steps: Radau, t: Time, h: Number, x: Vector, measures: int,
    measured: Indices, z: Room,
) -> None:  # fmt: skip
    """Put the slopes of measured states at a step's end, and 1, into the states that do not flow.

    There the polynomial has the flow's slope, so either gives it. What decays fast has a flow of large terms that
    cancel: where their round-off is more than that of the increments over the step, the polynomial's is taken.
    """
    w = known.end_slope
    size = abs(w[0]) + abs(w[1]) + abs(w[2])
    flow_at(here, t + h, z, steps.at)
    for k in range(measures):
        i = measured[k]
        terms: Number = 0
        for e in range(of.entries):
            if of.places[e] // of.width == i:
                terms = terms + abs(steps.rows[e] * z[of.places[e] % of.width])
        cancels = h * terms > size * max(abs(x[i]), abs(z[i]))
        taken = weighted(w, steps.z[0][i], steps.z[1][i], steps.z[2][i]) / h if cancels else steps.at[i]
        z[of.width - 1 - measures + k] = taken
    z[of.width - 1] = 1


@may_fail
def radau_landing(
    here: Here, of: Blocks, known: Collocation, steps: Radau, t: Time, h: Number, x: Vector, scales: Vector,
    measures: int, measured: Indices, z: Room,
) -> bool:  # fmt: skip
    """Step to a point inside the last step, solved to round-off: its end z is a smooth function of the step size."""
    if of.n == 0:
        return True
    solved = solve_step(here, of, known, steps, t, h, x, scales, True)
    steps.whole = False
    if solved:
        for s in range(of.width):
            z[s] = x[s] + steps.z[2][s]
        if measures > 0:
            take_slopes(here, of, known, steps, t, h, x, measures, measured, z)
    return solved


def fill_piece(of: Blocks, known: Collocation, steps: Radau, room: int, piece: Room) -> None:
    """Write the step's polynomial in its fraction s: the coefficients of s**(m + 1) begin at m ``room``."""
    u, v, w = steps.z[0], steps.z[1], steps.z[2]
    e, f, g = steps.last[0], steps.last[1], steps.last[2]
    for s in range(of.width):
        whole, i, j, k = steps.whole, u[s], v[s], w[s]
        piece[s] = e[s] if whole else weighted(known.power[0], i, j, k)
        piece[room + s] = f[s] if whole else weighted(known.power[1], i, j, k)
        piece[2 * room + s] = g[s] if whole else weighted(known.power[2], i, j, k)
