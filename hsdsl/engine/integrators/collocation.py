"""The coefficients of Radau IIA with three stages, in any number type.

All follow from the nodes (4 - sqrt 6)/10, (4 + sqrt 6)/10 and 1. A step's unknowns are the increments
Z_i = u(t + c_i h) - x of the collocation polynomial u, with Z = h A f(x + Z). A similarity T takes the inverse of A to
one real number and a block of two, so that a Newton iteration solves one real and one complex system instead of one of
three times the size.

E. Hairer and G. Wanner, Solving Ordinary Differential Equations II, Springer 1996, IV.8
(doi:10.1007/978-3-642-05221-7).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

from hsdsl.base.numbers.arithmetic import Arithmetic, Number
from hsdsl.engine.integrators.linear import Matrix, factored
from hsdsl.engine.integrators.stepper import State


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
        _weighted((share, share * share, share * share * share), powers),
        _weighted((one, 2 * share, 3 * share * share), powers),
        _weighted((one, 2 * one, 3 * one), powers),
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
    factors, n = factored([list(row) for row in matrix]), len(matrix)
    zero = matrix[0][0] * 0
    columns: Matrix = [factors.solve([zero + (i == j) for i in range(n)]) for j in range(n)]
    return tuple(zip(*columns, strict=True))


def _weighted(terms: State, rows: tuple[State, ...]) -> State:
    """Sum rows with weights."""
    return tuple(terms[0] * a + terms[1] * b + terms[2] * c for a, b, c in zip(*rows, strict=True))
