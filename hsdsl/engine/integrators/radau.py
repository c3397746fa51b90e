"""Radau IIA of order 5: the method for stiff modes, implicit, with the derivatives of the flow from the model itself.

A step is collocation at the nodes (4 - sqrt 6)/10, (4 + sqrt 6)/10 and 1: the polynomial of degree 3 from the step's
start that has the flow's slope at these three times. It is L-stable: what decays fast is gone after one step, however
long.

What a step must know is expensive: derivatives of the flow, factors of two matrices, a first guess. So what one step
leaves is kept for the next: the derivatives as long as the iterations converge fast, the factors as long as the step
keeps its length too, and the guess is the last polynomial, gone on with.

E. Hairer and G. Wanner, Solving Ordinary Differential Equations II, Springer 1996, IV.5 and IV.8
(doi:10.1007/978-3-642-05221-7).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress

from hsdsl.base.graphs import Elimination
from hsdsl.base.numbers.arithmetic import DOMAIN_ERRORS, Arithmetic, Number
from hsdsl.engine.integrators.blocks import BlockFactors, ComplexBlockFactors, linked
from hsdsl.engine.integrators.collocation import coefficients
from hsdsl.engine.integrators.implicit import RADAU as RADAU
from hsdsl.engine.integrators.implicit import Derivatives
from hsdsl.engine.integrators.linear import (
    ComplexFactors,
    Factors,
    Matrix,
    Singular,
    Vector,
    factored,
    factored_complex,
)
from hsdsl.engine.integrators.newton import Convergence, Increments, Iteration, NoConvergence
from hsdsl.engine.integrators.scales import resolved, rows_of
from hsdsl.engine.integrators.sparse import (
    ComplexSparseFactors,
    SparseFactors,
    sparse_factored,
    sparse_factored_complex,
)
from hsdsl.engine.integrators.stepper import Flow, Polynomial, Stages, State, Stepper


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


_Plain = tuple[Factors | SparseFactors, ComplexFactors | ComplexSparseFactors]
_Both = _Plain | tuple[BlockFactors, ComplexBlockFactors]


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
        self._factors: _Both | None = None
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

    def _factor(self, h: Number) -> _Both:
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

    def _blocks(self, h: Number, rows: Matrix) -> _Both:
        """Factor what the states have, and their derivatives share."""
        of = self._varied
        own = rows if of is None else [row[: of.own] for row in rows[: of.own]]
        real, turning = self._dense(h, own) if self._pattern is None else self._sparse(h, self._pattern)
        if of is None:
            return real, turning
        links = linked(of, h, rows)
        return BlockFactors(of, links, real), ComplexBlockFactors(of, links, turning)

    def _dense(self, h: Number, rows: Matrix) -> _Plain:
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

    def _sparse(self, h: Number, pattern: Elimination) -> _Plain:
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
            du = real.solve([h * a - known.gamma * b for a, b in zip(f, u, strict=True)])
            dv, dw = turning.solve(
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
        if not isinstance(real, BlockFactors):
            return tuple(map(_larger, real.solve(first), real.solve(second)))
        found = list(map(_larger, real.factors.solve(first[:own]), real.factors.solve(second[:own])))
        counted = (a * share for a, share in zip(first[own:], self._lasting, strict=False))
        last = len(self._lasting) + own
        rest = list(map(_larger, counted, second[own:last]))
        return tuple(real.solve_columns(found, [*first[:own], *rest, *first[last:]]))


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
