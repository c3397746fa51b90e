"""Corrections of recorded steps that no series repeats: by how much a shadow run moves away from the run along one.

The run is at p(s) at the share s of a step of length h, and the shadow run at p(0) + e where it begins. A polynomial by
Radau IIA is off inside by more than at its end, by two powers of h: so much that changes of the derivatives along the
step matter. It fails the flow by a multiple of M(s), the product of s - c over its nodes. So with u, of what it fails
where that is most, the shadow run is first taken to be at q(s) = p(s) + e + u m(s), m being the integral of M, which is
0 at both ends. Then it is at q(s) + d(s), where, J being the derivatives of the flow by the states at the step's end,

    d' = h J d + g,    g(s) = h f(t + s h, q(s)) - q'(s),    d(1) = integral of exp((1 - s) h J) g(s) over [0, 1].

That is one iteration of Newton's method from q, for polynomials of any method. Of g the values at the four nodes of
Radau's quadrature are taken, which is exact to degree 6: collocation by three of them leaves out no less. The
exponential of each power of s has a rational function instead, with one pole of order 6, so that one real matrix is
factored. Its series agree with the exact ones to the power 3 of h J, and with those at infinity to the power -2: so
small an error as that of a stiff state at the end of a step is found, of which defects elsewhere in the step are
thousands of times as large. The pole 1/5 makes the shadow run's own steps A-stable, and keeps the amplitude of an
oscillation of one radian a step to 1e-4.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from math import comb, factorial, sqrt

import numpy as np

from hsdsl.base.numbers.enclosures import Array

NODES, POWERS = 4, 6
POLE = 1 / 5
INSIDE = (6 - sqrt(6)) / 10  # where a polynomial by Radau IIA is held against the flow: `collocation`


@dataclass(frozen=True)
class Correction:
    """The coefficients of a correction.

    Attributes
    ----------
    nodes : array, shape (4,)
    weights : array, shape (6, 4)
        d(1) is the sum of W**(m + 1) times the sum of ``weights[m, i]`` g at node i, W the inverse of 1 - h J/5.
    bulge, slope : array, shape (4,)
        m and M at the nodes, for M = 1 where the polynomial is held against the flow.
    """

    nodes: Array
    weights: Array
    bulge: Array
    slope: Array


def corrected(defect: Callable[[float, Array, Array], Array], apart: Array, slopes: Array) -> tuple[Array, Array]:
    """Return how far p is off inside, and d(1).

    Parameters
    ----------
    defect : callable
        ``defect(s, away, rate)``: how badly p, moved by ``away`` and its slope by ``rate``, solves the equation at s.
    apart, slopes : array
        e and h J.
    """
    known, w = correction(), np.linalg.inv(np.eye(len(slopes)) - POLE * slopes)
    zero = np.zeros(len(apart))
    u = w @ defect(INSIDE, zero, zero)
    places = zip(known.nodes.tolist(), known.bulge, known.slope, strict=True)
    g = np.array([defect(s, apart + u * m, u * rate) for s, m, rate in places])
    end = np.zeros(len(slopes))
    for weights in known.weights[::-1]:
        end = w @ (weights @ g + end)
    return POLE * u, end


@cache
def correction() -> Correction:
    """Make the coefficients."""
    from numpy.polynomial import Legendre, Polynomial  # few runs need them

    roots: list[float] = Legendre([*np.zeros(NODES - 1), -1.0, 1.0]).roots().real.tolist()
    nodes = np.array([*((1 + root) / 2 for root in sorted(roots)[:-1]), 1.0])
    to_powers = np.linalg.inv(np.vander(nodes, increasing=True))
    weights = np.column_stack([_of_power(k) for k in range(NODES)]) @ to_powers
    fails = Polynomial.fromroots([(4 - sqrt(6)) / 10, (4 + sqrt(6)) / 10, 1])
    fails /= fails(INSIDE)
    return Correction(nodes, weights, fails.integ()(nodes), fails(nodes))


def _of_power(k: int) -> Array:
    """Weights of W, W**2, ... in the integral of exp((1 - s) z) s**k, where W = 1/(1 - z/5).

    At infinity W is -5/z - 25/z**2 - ..., and the integral -1/z - k/z**2 - .... The coefficient of z**i is
    C(m + i, i)/5**i in W**(m + 1), and k!/(k + i + 1)! in the integral.
    """
    first = [POLE, POLE - k * POLE**2]
    powers = range(POWERS - len(first))
    terms = np.array([[comb(m + i, i) * POLE**i for m in range(POWERS)] for i in powers])
    right = [factorial(k) / factorial(k + i + 1) for i in powers] - terms[:, :2] @ first
    return np.array([*first, *np.linalg.solve(terms[:, 2:], right)])
