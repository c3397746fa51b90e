"""Radau IIA of order 5: the method for stiff modes, implicit, with the derivatives of the flow from the model itself.

A step is collocation at the nodes (4 - sqrt 6)/10, (4 + sqrt 6)/10 and 1: the polynomial u of degree 3 from the step's
start that has the flow's slope at these three times. It is L-stable: what decays fast is gone after one step, however
long. The unknowns are the increments Z_i = u(t + c_i h) - x, with Z = h A f(x + Z). A similarity T takes the inverse of
A to one real number and a block of two, so that a Newton iteration solves one real and one complex system instead of
one of three times the size.

What a step must know is expensive: derivatives of the flow, factors of two matrices, a first guess. So what one step
leaves is kept for the next: the derivatives as long as the iterations converge fast, the factors as long as the step
keeps its length too, and the guess is the last polynomial, gone on with. The iterations converge linearly, by a factor
that the last two changes tell; what the next ones would still add follows from it.

E. Hairer and G. Wanner, Solving Ordinary Differential Equations II, Springer 1996, IV.5 and IV.8
(doi:10.1007/978-3-642-05221-7).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cache, partial
from itertools import islice

from hsdsl.base.graphs import Elimination
from hsdsl.base.numbers.arithmetic import DOMAIN_ERRORS, Arithmetic, Number
from hsdsl.engine.integrators.linear import (
    Matrix,
    Singular,
    Solve,
    SolveComplex,
    Vector,
    factored,
    factored_complex,
    linked,
    solve_all,
    solve_all_complex,
    solve_columns,
    sparse_factored,
    sparse_factored_complex,
)  # fmt: skip
from hsdsl.engine.integrators.stepper import RADAU as RADAU
from hsdsl.engine.integrators.stepper import Derivatives, Flow, Polynomial, Stages, State, Stepper, resolved, rows_of


def radau_stepper(known: Derivatives, tolerance: Number | None, arithmetic: Arithmetic) -> Stepper:
    """Make step functions for a mode; ``tolerance`` is that of an adaptive run.

    The stages of a step are its three increments and, fourth, the error estimate. Its functions remember what they were
    called with: they are for one stretch of flow.
    """
    steps = Steps(known, tolerance, arithmetic)
    return Stepper(
        RADAU.name,
        steps.step,
        steps.piece,
        lambda h, stages, end: stages[3],
        landing=steps.landing,
        scales=steps.scales,
    )


class Steps:
    """Steps along one stretch of flow, and what one leaves for the next.

    Attributes
    ----------
    derived, factorings, iterations : int
        Numbers of evaluations of the derivatives, of factorings, and of iterations.
    """

    def __init__(self, of: Derivatives, tolerance: Number | None, arithmetic: Arithmetic) -> None:
        self._of, self._tolerance, self._arithmetic = of, tolerance, arithmetic
        self._pattern, self._varied = of.varied.elimination if of.varied else of.pattern, of.varied
        self._largest = self._scales = of.scales
        self._lasting, self._floors = list[Number](), list[Number]()
        self._tried: tuple[Flow, Number, Number, State] | None = None
        self._convergence = Convergence(tolerance, arithmetic)
        self._known = coefficients(arithmetic)
        self._one = arithmetic.zero + 1
        self._rows: Matrix | None = None
        self._derived_at: Number = arithmetic.zero
        self._factored_for: Number = arithmetic.zero
        self._factors: tuple[Solve, SolveComplex] | None = None
        self._own: Solve | None = None  # of a system with derivatives: for the states alone
        self._links = Vector()
        self._last: tuple[Number, Number, Increments] | None = None
        self.derived = self.factorings = self.iterations = 0

    def step(self, flow: Flow, t: Number, h: Number, x: State, slope: State) -> tuple[State, Stages]:
        """Try a step, solved as well as its tolerance asks for."""
        if not x:
            return (), ((), (), (), ())
        found = self._solved(flow, t, h, x, exactly=self._tolerance is None)
        self._last = t, h, found
        error = self._estimate(flow, t, h, x, slope, found) if self._tolerance is not None else ()
        return tuple(_sum(x, found[2])), (*map(tuple, found), error)

    def landing(self, flow: Flow, t: Number, h: Number, x: State, slope: State) -> tuple[State, Stages]:
        """Make a part of the last step, solved to round-off: its end is a smooth function of its length."""
        if not x:
            return (), ((), (), (), ())
        found = self._solved(flow, t, h, x, exactly=True)
        end = tuple(_sum(x, found[2]))
        if self._of.measured:
            end = (*end[: -len(self._of.measured) - 1], *self._slopes(flow, t, h, x, end, found), self._one)
        return end, (*map(tuple, found), ())

    def _slopes(self, flow: Flow, t: Number, h: Number, x: State, end: State, z: Increments) -> Iterator[Number]:
        """The slopes of measured states at a step's end.

        There the polynomial has the flow's slope, so either gives it. What decays fast has a flow of large terms that
        cancel: where their round-off is more than that of the increments over the step, the polynomial's is taken.
        """
        weights, rows = self._known.end_slope, self._rows
        assert rows is not None
        size, at_end = abs(weights[0]) + abs(weights[1]) + abs(weights[2]), flow(t + h, *end)
        for i in self._of.measured:
            terms = self._arithmetic.zero
            for d, a in zip(rows[i], end, strict=True):
                terms = terms + abs(d * a)
            cancels = h * terms > size * max(abs(x[i]), abs(end[i]))
            yield (weights[0] * z[0][i] + weights[1] * z[1][i] + weights[2] * z[2][i]) / h if cancels else at_end[i]

    def piece(
        self, flow: Flow, t: Number, h: Number, x: State, z: State, stages: Stages, slope: State, end: State
    ) -> Polynomial:
        """The polynomial through the increments."""
        return tuple(tuple(_weighted(row, stages[:3])) for row in self._known.powers)

    def _solved(self, flow: Flow, t: Number, h: Number, x: State, exactly: bool) -> Increments:
        """Solve Z = h A f(x + Z), with derivatives from an earlier step if they still do."""
        if self._rows is None or (self._convergence.aged and self._derived_at != t):
            self._derive(t, x)
        settle = self._convergence.to_roundoff if exactly else self._convergence.to_tolerance
        guess, self._tried = self._guess(t, h, x), (flow, t, h, x)

        def attempt(closer: bool = False) -> Increments:
            floors = self._floors
            self._scales = list(map(max, self._largest, floors)) if floors else self._largest
            return settle(x, self.scales(closer), self._iterations(flow, t, h, x, guess))

        if self._derived_at != t:
            with suppress(NoConvergence):
                return attempt()
            self._derive(t, x)
        try:
            return attempt()
        except NoConvergence:
            return attempt(closer=True)

    def scales(self, closer: bool) -> Sequence[Number]:
        """The scales of the states over the step last tried; ``closer``, with a look at the terms of the flow."""
        if closer and self._tried is not None:
            with suppress(*DOMAIN_ERRORS):
                tried, rows, terms = self._tried, self._rows, self._of.terms
                self._scales = resolved(*tried, self._largest, rows, self._arithmetic, self._tolerance, terms)
                lifted = any(a > s for a, s in zip(self._scales, self._largest, strict=True))
                self._floors = list(self._scales) if lifted else []
        return self._scales

    def _derive(self, t: Number, x: State) -> None:
        self._rows, self._derived_at, self._factors = rows_of(self._of.jacobian(t, *x), len(x)), t, None
        columns = range(self._varied.own, self._varied.columns[-1]) if self._varied else ()
        self._lasting = [1 / (1 + self._of.soon * abs(self._rows[i][i])) for i in columns]
        self.derived += 1

    def _factor(self, h: Number) -> tuple[Solve, SolveComplex]:
        """Factor gamma - h J and alpha - i beta - h J, unless that is done."""
        if self._factors is None or self._factored_for != h:
            assert self._rows is not None
            self._factored_for = h
            self.factorings += 1
            try:
                self._factors = self._blocks(h, self._rows)
            except Singular as problem:
                self._factors = None
                raise NoConvergence(str(problem)) from None
        return self._factors

    def _blocks(self, h: Number, rows: Matrix) -> tuple[Solve, SolveComplex]:
        """Factor what the states have, and their derivatives share."""
        of = self._varied
        own = rows if of is None else [row[: of.own] for row in rows[: of.own]]
        real, turning = self._dense(h, own) if self._pattern is None else self._sparse(h, self._pattern)
        if of is None:
            return real, turning
        self._own, self._links = real, linked(of, h, rows)
        return partial(solve_all, of, self._links, real), partial(solve_all_complex, of, self._links, turning)

    def _dense(self, h: Number, rows: Matrix) -> tuple[Solve, SolveComplex]:
        known, zero, n = self._known, self._arithmetic.zero, len(rows)
        real = [[-h * d for d in row] for row in rows]
        shifted = [list(row) for row in real]
        turned = [[zero] * n for _ in real]
        for i in range(n):
            real[i][i] = known.gamma + real[i][i]
            shifted[i][i] = known.alpha + shifted[i][i]
            turned[i][i] = -known.beta
        groups = self._varied.groups if self._varied else None
        return factored(real, self._largest, groups), factored_complex(shifted, turned, self._largest, groups)

    def _sparse(self, h: Number, pattern: Elimination) -> tuple[Solve, SolveComplex]:
        """Factor the same matrices in the pattern of a sparse elimination."""
        assert self._rows is not None
        known, zero = self._known, self._arithmetic.zero
        real, turned = [zero] * pattern.size, [zero] * pattern.size
        unknowns = [(pattern.order[i], range(*pattern.start[i : i + 2])) for i in range(len(pattern.order))]
        for unknown, row in unknowns:
            for at in row:
                real[at] = -h * self._rows[unknown][pattern.order[pattern.column[at]]]
        shifted = list(real)
        for own in pattern.diagonal:
            real[own] = known.gamma + real[own]
            shifted[own] = known.alpha + shifted[own]
            turned[own] = -known.beta
        return sparse_factored(pattern, real), sparse_factored_complex(pattern, shifted, turned)

    def _guess(self, t: Number, h: Number, x: State) -> Increments:
        """Go on with the last step's polynomial: behind its end, or inside it where it was tried from here."""
        if self._last is not None:
            start, length, z = self._last
            before = t == start + length
            if before or t == start:
                c = [_weighted(row, z) for row in self._known.powers]
                zero = self._arithmetic.zero
                share, one = h / length, self._one if before else zero
                base = z[2] if before else [zero for _ in x]
                at = [one + node * share for node in self._known.nodes]
                return _three([s * (a + s * (b + s * d)) - e for a, b, d, e in zip(*c, base, strict=True)] for s in at)
        return _three([self._arithmetic.zero for _ in x] for _ in range(3))

    def _iterations(self, flow: Flow, t: Number, h: Number, x: State, z: Increments) -> Iterator[Iteration]:
        """Iterate by Newton's method."""
        known = self._known
        real, turning = self._factor(h)
        u, v, w = (_weighted(row, z) for row in known.unmix)
        while True:
            self.iterations += 1
            slopes = [flow(t + c * h, *_sum(x, k)) for c, k in zip(known.nodes, z, strict=True)]
            f, g, k = (_weighted(row, slopes) for row in known.unmix)
            du = real([h * a - known.gamma * b for a, b in zip(f, u, strict=True)])
            dv, dw = turning(
                [h * a - (known.alpha * b + known.beta * c) for a, b, c in zip(g, v, w, strict=True)],
                [h * a - (known.alpha * c - known.beta * b) for a, b, c in zip(k, v, w, strict=True)],
            )
            u, v, w = _sum(u, du), _sum(v, dv), _sum(w, dw)
            z = _three(_weighted(row, (u, v, w)) for row in known.mix)
            largest = [max(abs(a), abs(b), abs(c)) for a, b, c in zip(du, dv, dw, strict=True)]
            total = largest[0] * 0
            for a, b, c in zip(du, dv, dw, strict=True):
                total = total + (abs(a) + abs(b) + abs(c))
            if not self._arithmetic.isfinite(total):
                raise NoConvergence("an iteration that grows beyond all numbers")
            yield largest, z

    def _estimate(self, flow: Flow, t: Number, h: Number, x: State, slope: State, z: Increments) -> State:
        """Estimate the error of a step's end and of the curve inside it, for each state the larger of the two.

        Both are (gamma - h J)^-1 times a defect. That of Hairer and Wanner (IV.8.19), from the flow at the start, is
        the embedded method's; over a decay that the step is too long to show it stays as large as what decays. For
        stiff states that follow a slow motion it is far too small for the curve, so the flow is held against the
        polynomial at one more point, where the polynomial's slope is farthest off.

        Where steps show a decay the first is 2.7 times the second, and that 1.5 times the largest error of the curve.
        The end is off by far less, and a derivative that decays soon forgets it. No crossing depends on derivatives: of
        these the first defect counts by the share of an error that lasts.
        """
        known, own = self._known, self._varied.own if self._varied else len(x)
        inside = flow(t + known.share * h, *_sum(x, _weighted(known.values, z)))
        real, _ = self._factor(h)
        first = [h * f + e for f, e in zip(slope, _weighted(known.estimate, z), strict=True)]
        second = [h * f - e for f, e in zip(inside, _weighted(known.slope, z), strict=True)]
        if self._varied is None or self._own is None:
            return tuple(map(_larger, real(first), real(second)))
        found = list(map(_larger, self._own(first[:own]), self._own(second[:own])))
        counted = (a * share for a, share in zip(first[own:], self._lasting, strict=False))
        last = len(self._lasting) + own
        rest = list(map(_larger, counted, second[own:last]))
        right = [*first[:own], *rest, *first[last:]]
        return tuple(solve_columns(self._varied, self._links, self._own, found, right))


def _larger(a: Number, b: Number) -> Number:
    return a if abs(a) >= abs(b) else b


def _sum(x: State | Vector, y: State | Vector) -> Vector:
    return [a + b for a, b in zip(x, y, strict=True)]


def _weighted(weights: State, vectors: Stages | Increments | list[State]) -> Vector:
    p, q, r = weights
    return [p * a + q * b + r * c for a, b, c in zip(*vectors, strict=True)]


def _three(vectors: Iterator[Vector]) -> Increments:
    a, b, c = vectors
    return a, b, c


@dataclass(frozen=True)
class Coefficients:
    """Coefficients in one number type.

    Attributes
    ----------
    nodes : tuple of Number
        The three c_i.
    a : tuple of tuple of Number
        Weights of the slopes at the nodes in the increments; the last row is that of the step itself.
    powers : tuple of tuple of Number
        Row m has the weights of the three increments in the polynomial's coefficient of s**(m + 1), s the share of
        the step.
    gamma, alpha, beta : Number
        The eigenvalues of the inverse of a: gamma and alpha +- i beta.
    mix, unmix : tuple of tuple of Number
        T, whose columns are an eigenvector to gamma and the parts of one to alpha + i beta, and its inverse.
    estimate : tuple of Number
        Weights of the increments in the embedded method's defect, added to h times the flow at the step's start.
    share : Number
        Where inside a step its polynomial is held against the flow: (6 - sqrt 6)/10.
    values, slope : tuple of Number
        Weights of the increments in the polynomial and in its derivative by s there.
    end_slope : tuple of Number
        Weights of the increments in the derivative by s at the step's end.
    """

    nodes: State
    a: tuple[State, ...]
    powers: tuple[State, ...]
    gamma: Number
    alpha: Number
    beta: Number
    mix: tuple[State, ...]
    unmix: tuple[State, ...]
    estimate: State
    share: Number
    values: State
    slope: State
    end_slope: State


@cache
def coefficients(arithmetic: Arithmetic) -> Coefficients:
    """Make the coefficients in a number type."""
    one = arithmetic.zero + 1
    root = arithmetic.sqrt(6 * one)
    nodes = ((4 - root) / 10, (4 + root) / 10, one)
    share = (6 - root) / 10
    cubic = arithmetic.functions["pow"](3 * one, one / 3)  # the eigenvalues are the roots of s^3 - 9 s^2 + 36 s - 60
    gamma, alpha = 3 - cubic + cubic * cubic, 3 + (cubic - cubic * cubic) / 2
    beta = arithmetic.sqrt(3 * one) * (cubic + cubic * cubic) / 2
    powers = _powers(nodes)
    mix = _eigenvectors(nodes, gamma, alpha, beta)
    return Coefficients(
        nodes,
        _weights(nodes),
        powers,
        gamma,
        alpha,
        beta,
        mix,
        _inverse(mix),
        ((-13 - 7 * root) / 3, (-13 + 7 * root) / 3, -one / 3),
        share,
        _combined((share, share * share, share * share * share), powers),
        _combined((one, 2 * share, 3 * share * share), powers),
        _combined((one, 2 * one, 3 * one), powers),
    )


def _weights(nodes: State) -> tuple[State, ...]:
    """The integrals from 0 to each node of the polynomials of degree 2 that are 1 at one node and 0 at the others."""
    columns: list[State] = []
    for i, c in enumerate(nodes):
        p, q = (other for j, other in enumerate(nodes) if j != i)
        scale = (c - p) * (c - q)
        columns.append(tuple(s * (p * q + s * (-(p + q) / 2 + s / 3)) / scale for s in nodes))
    return tuple(zip(*columns, strict=True))


def _powers(nodes: State) -> tuple[State, ...]:
    """The coefficients of s, s**2, s**3 of the polynomials that are 1 at one node and 0 at the others and at 0."""
    columns: list[State] = []
    for i, c in enumerate(nodes):
        p, q = (other for j, other in enumerate(nodes) if j != i)
        scale = c * (c - p) * (c - q)
        columns.append((p * q / scale, -(p + q) / scale, (c * 0 + 1) / scale))
    return tuple(zip(*columns, strict=True))


def _eigenvectors(nodes: State, gamma: Number, alpha: Number, beta: Number) -> tuple[State, ...]:
    """To the eigenvalue s of the inverse of a belongs s^2 M' + s M'' + M''' at the nodes, M the product over s - c_i.

    For a maps a polynomial of degree 2, by its values at the nodes, to the values of its integral from 0.
    """
    p, q, r = nodes
    columns: list[tuple[Number, Number, Number]] = []
    for c in nodes:
        first = 3 * c * c - 2 * (p + q + r) * c + (p * q + p * r + q * r)
        second = 6 * c - 2 * (p + q + r)
        real = gamma * gamma * first + gamma * second + 6
        columns.append(
            (real, (alpha * alpha - beta * beta) * first + alpha * second + 6, beta * (2 * alpha * first + second))
        )
    u, v, w = columns[-1]  # scaled to 1 at the last node
    size = v * v + w * w
    return tuple((a / u, (b * v + c * w) / size, (c * v - b * w) / size) for a, b, c in columns)


def _inverse(matrix: tuple[State, ...]) -> tuple[State, ...]:
    solve, n = factored([list(row) for row in matrix]), len(matrix)
    zero = matrix[0][0] * 0
    columns: Matrix = [solve([zero + (i == j) for i in range(n)]) for j in range(n)]
    return tuple(zip(*columns, strict=True))


def _combined(terms: State, rows: tuple[State, ...]) -> State:
    """Sum rows with weights."""
    return tuple(terms[0] * a + terms[1] * b + terms[2] * c for a, b, c in zip(*rows, strict=True))


Increments = tuple[Vector, Vector, Vector]
Iteration = tuple[Vector, Increments]  # the largest change of each state, and the increments after it

MOST_ITERATIONS = 7  # iterations of a step that has a tolerance
RENEWED = 1e-3  # an iteration that leaves more than this of the one before has old derivatives,
FEW = 2  # which matters where a step takes more than these
LEAST_LEFT, MOST_LEFT = 1e-3, 0.03  # of the tolerance: what the iterations of such a step may leave
DIVERGING = 0.99  # an iteration that leaves more than this of the one before is one of too long a step
SLOW_RATE = 0.5  # likewise for iterations that go on to round-off
NEWTON_NOISE = 2**10  # units of round-off, relative to the scales: a correction this small may be all noise
NEWTON_SHARE = 1e-2  # of the tolerance, likewise: what an iteration may leave in a badly conditioned step


class NoConvergence(ValueError):
    """The equations of a step are not solved by the iteration: the step is too long."""


class Convergence:
    """How iterations converge, over the steps of one stretch of flow.

    Attributes
    ----------
    rate : Number
        What the last iteration left of the one before it; 1 where that is not known, or they do not converge.
    left : Number
        What all that follow would have added to the last of a step, relative to it.
    aged : bool
        Whether the derivatives they use should be renewed for the next step.
    """

    def __init__(self, tolerance: Number | None, arithmetic: Arithmetic) -> None:
        self._tolerance, self._arithmetic = tolerance, arithmetic
        self.rate = self.left = arithmetic.zero + 1
        self.aged = False

    def to_tolerance(self, x: State, scales: Sequence[Number], iterations: Iterator[Iteration]) -> Increments:
        """Iterate until what is left is a small share of the tolerance.

        Raises NoConvergence: it will not be, within the iterations that a step may take.
        """
        unit, tolerance, one = self._arithmetic.unit, self._tolerance, self._arithmetic.zero + 1
        assert tolerance is not None
        noise = NEWTON_NOISE * unit / tolerance
        enough = max(10 * unit / tolerance, min(MOST_LEFT, max(LEAST_LEFT, self._arithmetic.sqrt(tolerance))))
        left, before = self._arithmetic.functions["pow"](max(self.left, unit), one * 4 / 5), None
        for count, (largest, z) in enumerate(iterations, 1):
            size = _scaled(largest, x, scales, z) / tolerance
            rated = before is not None and count > 1 + _followers(x, scales, z)
            if rated:
                rate = size / before
                if rate >= DIVERGING:
                    if size <= noise:
                        return z
                    break
                self.rate, left = rate, rate / (1 - rate)
            self.aged = count > FEW and self.rate > RENEWED
            ahead = left * size
            if size == 0 or ahead <= enough:
                self.left = left
                return z
            for _ in range(count, MOST_ITERATIONS if rated else count):
                ahead = ahead * self.rate
            if count == MOST_ITERATIONS or (rated and ahead > enough and size > noise):
                break
            before = size
        self.rate, self.left, self.aged = one, one, True
        raise NoConvergence("an iteration that does not settle")

    def to_roundoff(self, x: State, scales: Sequence[Number], iterations: Iterator[Iteration]) -> Increments:
        """Iterate until the next correction would be below the last digit, or they are all noise.

        Raises NoConvergence: they become no smaller before that.
        """
        unit, before, z = self._arithmetic.unit, None, None
        allowed = max(NEWTON_NOISE * unit, NEWTON_SHARE * (self._tolerance or 0))
        for count, (largest, z) in enumerate(islice(iterations, self._arithmetic.most_halvings), 1):
            size = _scaled(largest, x, scales, z)
            rate = SLOW_RATE if not before else size / before
            reach = [max(abs(a), *(abs(a + k) for k in ks)) for a, *ks in zip(x, *z, strict=True)]
            if size == 0 or (
                rate < SLOW_RATE and all(rate * d <= unit * a for d, a in zip(largest, reach, strict=True))
            ):
                self.rate, self.aged = rate, rate > RENEWED
                return z
            if before and rate >= SLOW_RATE and count > 1 + _followers(x, scales, z):
                if size <= allowed:
                    return z
                self.rate, self.aged = self._arithmetic.zero + 1, True
                raise NoConvergence("an iteration that does not settle")
            before = size
        assert z is not None
        return z


def _scaled(largest: Vector, x: State, scales: Sequence[Number], z: Increments) -> Number:
    """The largest change relative to the scales; of a state that has been zero so far, to where it is now."""
    size = largest[0] * 0
    for i, (d, s) in enumerate(zip(largest, scales, strict=True)):
        if d > 0:
            reach = s if s > 0 else max(abs(x[i] + k[i]) for k in z)
            size = max(size, d / reach if reach > 0 else reach + 1)
    return size


def _followers(x: State, scales: Sequence[Number], z: Increments) -> int:
    """How many states that have been zero so far no longer are: each may follow another one, an iteration later."""
    moved = (max(abs(x[i] + k[i]) for k in z) > 0 for i, s in enumerate(scales) if not s > 0)
    return sum(moved)
