"""Radau IIA for a mode: its coefficients in any number type, and room for its steps.

How it steps is in `hsdsl.engine.scheme.radau`, from which C is printed.
"""

from __future__ import annotations

from functools import cache
from typing import Any

from hsdsl.base.numbers.arithmetic import Arithmetic, Number
from hsdsl.engine.integrators.stepper import RADAU as RADAU
from hsdsl.engine.integrators.stepper import Derivatives, Flow, Polynomial, Stages, State, Stepper, make_resolved
from hsdsl.engine.scheme.linear import Blocks, Factors, factored, solve
from hsdsl.engine.scheme.newton import Radau, enough_of
from hsdsl.engine.scheme.primitives import Collocation
from hsdsl.engine.scheme.radau import fill_piece, look_closer, radau_landing, radau_step


class NoConvergence(ValueError):
    """The equations of a step are not solved by the iteration: the step is too long."""


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
    """Steps along one stretch of flow."""

    def __init__(self, of: Derivatives, tolerance: Number | None, arithmetic: Arithmetic) -> None:
        self._of, self._known = of, coefficients(arithmetic)
        self.blocks = blocks_of(of, len(of.scales))
        self.text = make_radau(self.blocks, tolerance or 0, of.soon, arithmetic)
        self._tried: tuple[Number, Number, State] | None = None

    def step(self, flow: Flow, t: Number, h: Number, x: State, slope: State) -> tuple[State, Stages]:
        """Try a step, solved as well as its tolerance asks for."""
        self._begin(flow, t, h, x)
        z = list(x)
        self._check(
            radau_step(self._of, self.blocks, self._known, self.text, t, h, x, slope, self._of.scales, z)
        )  # fmt: skip
        return tuple(z), (*self._increments(), tuple(self.text.error) if self.text.tolerance > 0 else ())

    def landing(self, flow: Flow, t: Number, h: Number, x: State, slope: State) -> tuple[State, Stages]:
        """Make a part of the last step, solved to round-off: its end is a smooth function of its length."""
        self._begin(flow, t, h, x)
        z, measured = list(x), self._of.measured
        self._check(
            radau_landing(
                self._of, self.blocks, self._known, self.text, t, h, x, self._of.scales, len(measured), measured, z
            )
        )
        return tuple(z), (*self._increments(), ())

    def piece(
        self, flow: Flow, t: Number, h: Number, x: State, z: State, stages: Stages, slope: State, end: State
    ) -> Polynomial:
        """The polynomial through the increments."""
        n = len(x)
        c: list[Number] = [0] * (3 * n)
        fill_piece(self.blocks, self._known, self.text, n, c)
        return tuple(tuple(c[i : i + n]) for i in (0, n, 2 * n))

    def scales(self, closer: bool) -> Any:
        """The scales of the states over the step last tried; ``closer``, with a look at the terms of the flow."""
        if closer and self._tried is not None:
            look_closer(self._of, self.blocks, self.text, *self._tried, self._of.scales)
        return self.text.scales

    def _begin(self, flow: Flow, t: Number, h: Number, x: State) -> None:
        self._of.flow, self._tried, self.text.at[:] = flow, (t, h, x), x

    def _increments(self) -> Stages:
        return tuple(map(tuple, self.text.z))

    def _check(self, solved: bool) -> None:
        if not solved:
            raise NoConvergence("an iteration that does not settle")


def blocks_of(of: Derivatives, n: int) -> Blocks:
    """What a step of n states solves for."""
    v, places = of.varied, range(n * n) if of.places is None else of.places
    if v is None:
        return Blocks(n, n, n, len(places), len(places), places, None, of.pattern, False)
    flowing = v.columns[-1]
    whole = flowing == v.own * (1 + v.count)
    return Blocks(flowing, v.own, n, len(places), v.entries, places, v, v.elimination, whole)


def make_radau(of: Blocks, tolerance: Number, soon: Number, arithmetic: Arithmetic) -> Radau:
    """Room for steps, before the first one."""
    zero, unit = arithmetic.zero, arithmetic.unit
    entries = of.pattern.size if of.pattern else of.own * of.own

    def room(size: int) -> list[Number]:
        return [zero] * size

    def rooms(count: int) -> list[list[Number]]:
        return [room(of.width) for _ in range(count)]

    links = of.varied.links if of.varied else 0
    factors = Factors(
        room(entries), room(entries), room(entries), [0] * of.own, [0] * of.own, room(links), rooms(2), rooms(4)
    )
    return Radau(
        unit=unit, tolerance=tolerance,
        enough=enough_of(unit, tolerance, arithmetic.sqrt(tolerance)) if tolerance > 0 else zero,
        soon=soon, most=arithmetic.most_halvings,
        has_jacobian=False, stepped=False, factored=False, stale=False, lifted=False,
        jacobian_at=zero, factored_for=zero, start=zero, length=zero, rate=zero + 1, eta=zero + 1,
        rows=room(0), fresh=room(0), lasting=room(of.width), scales=(), least=room(of.width),
        z=rooms(3), last=rooms(3), ended=room(of.width), whole=False,
        transformed=rooms(3), change=rooms(3), slopes=rooms(3), right=rooms(3),
        largest=room(of.width), error=room(of.width), at=room(of.width), factors=factors,
        resolved=make_resolved(of.width, tolerance, arithmetic),
    )  # fmt: skip


@cache
def coefficients(arithmetic: Arithmetic) -> Collocation:
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
    return Collocation(
        nodes,
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
    n, order = len(matrix), [0, 0, 0]
    zero = matrix[0][0] * 0
    factors = [a for row in matrix for a in row]
    factored(n, factors, order, [1] * n, None)
    columns = [[zero] * n for _ in matrix]
    for j, column in enumerate(columns):
        solve(n, factors, order, [zero + (i == j) for i in range(n)], column)
    return tuple(zip(*columns, strict=True))


def _combined(terms: State, rows: tuple[State, ...]) -> State:
    """Sum rows with weights."""
    return tuple(terms[0] * a + terms[1] * b + terms[2] * c for a, b, c in zip(*rows, strict=True))
