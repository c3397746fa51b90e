"""Radau IIA of order 5: the method for stiff modes, implicit, with the derivatives of the flow from the model itself.

A step is collocation at the nodes (4 - sqrt 6)/10, (4 + sqrt 6)/10 and 1: the polynomial of degree 3 from the step's
start that has the flow's slope at these three times. It is L-stable: what decays fast is gone after one step, however
long. Weights and inner polynomial follow from the nodes, in whatever numbers are computed with.

The slopes at the nodes solve a system of equations, by simplified Newton iterations that go on to round-off, so that a
step's end is a smooth function of its length, and crossings can be solved on it. Where they do not settle quickly the
step is too long, and a shorter one is tried.

E. Hairer and G. Wanner, Solving Ordinary Differential Equations II, Springer 1996, IV.5 and IV.8
(doi:10.1007/978-3-642-05221-7).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from math import log2

from hsdsl.arithmetic import Arithmetic, Number
from hsdsl.integrators.linear import Factors, Matrix, Singular, factored
from hsdsl.integrators.stepper import Flow, Polynomial, Stages, State, Stepper
from hsdsl.kernel import Routine

SLOW = 0.5  # an iteration that gains less than this factor is one of too long a step, or at round-off
ROUNDING = 2**10  # units of round-off, relative to 1 + |x|: a correction this small may be all noise
SHARE = 1e-2  # of the tolerance, likewise: what an iteration may leave in a badly conditioned step


class NoConvergence(ValueError):
    """The equations of a step are not solved by the iteration: the step is too long."""


@dataclass(frozen=True)
class RadauMethod:
    """The method; its coefficients are made in the number type of a run."""

    name: str = "radau"
    title: str = "Radau IIA, three stages, for stiff flows"
    source: str = "Hairer and Wanner 1996, IV.5 and IV.8, doi:10.1007/978-3-642-05221-7"
    order: int = 5
    error_order: int = 4
    adaptive: bool = True
    digits: int | None = None
    degree: int = 3


RADAU = RadauMethod()


@dataclass(frozen=True)
class Coefficients:
    """Coefficients in one number type.

    Attributes
    ----------
    nodes : tuple of Number
        The three c_i.
    inner : tuple of tuple of Number
        Row i has the coefficients of s, s**2, s**3 in the weight b_i(s) of slope i: the state at the share s of a step
        is x + h sum_i b_i(s) k_i.
    a : tuple of tuple of Number
        a_ij = b_j(c_i); the last row is the weights of the step itself.
    real : Number
        The real eigenvalue of the inverse of a.
    estimate : tuple of Number
        Weights of the slopes in the embedded method's defect, beside the flow at the step's start.
    share : Number
        Where inside a step its polynomial is held against the flow: (6 - sqrt 6)/10.
    values, slope : tuple of Number
        Weights of the slopes in the polynomial and in its derivative there.
    """

    nodes: State
    inner: tuple[State, ...]
    a: tuple[State, ...]
    real: Number
    estimate: State
    share: Number
    values: State
    slope: State


@cache
def coefficients(arithmetic: Arithmetic) -> Coefficients:
    """Make the coefficients in a number type."""
    one = arithmetic.zero + 1
    root = arithmetic.sqrt(6 * one)
    nodes = ((4 - root) / 10, (4 + root) / 10, one)
    inner: list[State] = []
    for i, c in enumerate(nodes):
        p, q = (other for j, other in enumerate(nodes) if j != i)
        scale = (c - p) * (c - q)
        inner.append((p * q / scale, -(p + q) / (2 * scale), one / (3 * scale)))
    share = (6 - root) / 10
    *a, values = (tuple(c * (w[0] + c * (w[1] + c * w[2])) for w in inner) for c in (*nodes, share))
    slope = tuple(w[0] + share * (2 * w[1] + share * 3 * w[2]) for w in inner)
    cubic = arithmetic.functions["pow"](3 * one, one / 3)
    increments = ((-13 - 7 * root) / 3, (-13 + 7 * root) / 3, -one / 3)  # of h sum_j a_ij k_j
    estimate = tuple(sum((e * row[j] for e, row in zip(increments, a, strict=True)), one * 0) for j in range(3))
    return Coefficients(nodes, tuple(inner), tuple(a), 3 + cubic * cubic - cubic, estimate, share, values, slope)


def radau_stepper(jacobian: Routine, tolerance: Number | None, arithmetic: Arithmetic) -> Stepper:
    """Make step functions from a mode's Jacobian; ``tolerance`` is that of an adaptive run.

    The stages of a step are its three slopes and, fourth, the error estimate by h.
    """
    known = coefficients(arithmetic)
    allowed = max(ROUNDING * arithmetic.unit, SHARE * (tolerance or 0))

    def step(flow: Flow, t: Number, h: Number, x: State, slope: State) -> tuple[State, Stages]:
        if not x:
            return (), ((), (), (), ())
        flat = jacobian(t, *x)
        rows = [list(flat[i : i + len(x)]) for i in range(0, len(flat), len(x))]
        slopes = _solved(flow, t, h, x, rows, known, allowed, arithmetic)
        inside = flow(t + known.share * h, *_moved(x, h, known.values, slopes))
        error = _estimate(h, rows, slope, inside, slopes, known)
        return _moved(x, h, known.a[-1], slopes), (*slopes, error)

    def piece(
        flow: Flow, t: Number, h: Number, x: State, z: State, stages: Stages, slope: State, end: State
    ) -> Polynomial:
        zero = tuple(a * 0 for a in x)
        return tuple(_moved(zero, h, weights, stages[:3]) for weights in zip(*known.inner, strict=True))

    def error(h: Number, stages: Stages, end: State) -> State:
        return tuple(h * e for e in stages[3])

    return Stepper(RADAU.name, step, piece, error)


def _moved(x: State, h: Number, weights: State, slopes: Stages) -> State:
    """Move x along weighted slopes: x + h sum_i w_i k_i."""
    return tuple(
        a + h * (weights[0] * k + weights[1] * m + weights[2] * n) for a, k, m, n in zip(x, *slopes, strict=True)
    )


def _solved(
    flow: Flow,
    t: Number,
    h: Number,
    x: State,
    jacobian: Matrix,
    known: Coefficients,
    allowed: Number,
    arithmetic: Arithmetic,
) -> Stages:
    """Solve k_i = f(t + c_i h, x + h sum_j a_ij k_j), beginning with k = 0, which is at the step's start."""
    factors = _factored(_system(h, jacobian, known))
    unit, n, zero, before = arithmetic.unit, len(x), arithmetic.zero, None
    slopes: Stages = (tuple(zero for _ in x),) * 3
    for _ in range(16 - 2 * int(log2(unit))):
        stages = [_moved(x, h, row, slopes) for row in known.a]
        wanted = [flow(t + c * h, *stage) for c, stage in zip(known.nodes, stages, strict=True)]
        off = [f - k for row, ks in zip(wanted, slopes, strict=True) for f, k in zip(row, ks, strict=True)]
        change = factors.solve(off)
        slopes = tuple(
            tuple(k + d for k, d in zip(ks, change[i * n : i * n + n], strict=True)) for i, ks in enumerate(slopes)
        )
        largest = [max(abs(change[i * n + s]) for i in range(3)) for s in range(n)]
        size = max(h * d / (1 + abs(a)) for d, a in zip(largest, x, strict=True))
        if not arithmetic.isfinite(size):
            raise NoConvergence("an iteration that grows beyond all numbers")
        rate = SLOW if not before else size / before
        reach = [max(abs(stage[s]) for stage in (x, *stages)) for s in range(n)]
        if size == 0 or (rate < SLOW and all(rate * h * d <= unit * a for d, a in zip(largest, reach, strict=True))):
            return slopes
        if before and rate >= SLOW:
            if size <= allowed:
                return slopes
            raise NoConvergence("an iteration that does not settle")
        before = size
    return slopes


def _system(h: Number, jacobian: Matrix, known: Coefficients) -> Matrix:
    """The matrix I - h a x J of the iteration, over the slopes at all nodes."""
    n = len(jacobian)
    matrix = [[-h * w * d for w in weights for d in row] for weights in known.a for row in jacobian]
    for i in range(3 * n):
        matrix[i][i] = 1 + matrix[i][i]
    return matrix


def _estimate(h: Number, jacobian: Matrix, slope: State, inside: State, slopes: Stages, known: Coefficients) -> State:
    """Estimate the error of a step's end and of the curve inside it, by h, for each state the larger of the two.

    Both are (g - h J)^-1 times a defect of slopes, g the real eigenvalue. That of Hairer and Wanner (IV.8.19), from the
    flow at the start, is the embedded method's; over a decay that the step is too long to show it stays as large as
    what decays. For stiff states that follow a slow motion it is far too small for the curve, so the flow is held
    against the polynomial at one more point, where the polynomial's slope is farthest off.
    """
    matrix = [[-h * d for d in row] for row in jacobian]
    for i, row in enumerate(matrix):
        row[i] = known.real + row[i]
    factors, zero, one = _factored(matrix), tuple(0 * f for f in slope), known.real * 0 + 1
    defects = [
        [f + e for f, e in zip(slope, _moved(zero, one, known.estimate, slopes), strict=True)],
        [f - e for f, e in zip(inside, _moved(zero, one, known.slope, slopes), strict=True)],
    ]
    return tuple(max(pair, key=abs) for pair in zip(*map(factors.solve, defects), strict=True))


def _factored(matrix: Matrix) -> Factors:
    try:
        return factored(matrix)
    except Singular as problem:
        raise NoConvergence(str(problem)) from None
