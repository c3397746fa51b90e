"""What is written twice: inner loops that in C are tuned by hand (``primitives.h``), each with the same bits."""

from __future__ import annotations

from hsdsl.base.numbers.arithmetic import Number
from hsdsl.engine.scheme.words import Here, Room, Time, Vector, may_fail


def fill_bernstein(binomials: Vector, c: Vector, n: int, b: Room) -> None:
    """Fill in the Bernstein coefficients on [0, 1] of c_0 + c_1 s + ...: b_i = sum_k C(i, k) c_k / C(n, k).

    The sums are made as in Pascal's triangle, without products.
    """
    row = n * (n + 1) // 2
    b[: n + 1] = [a / m for a, m in zip(c, binomials[row : row + n + 1], strict=False)]
    for k in range(1, n + 1):
        for i in range(n, k - 1, -1):
            b[i] = b[i] + b[i - 1]


def largest_of(b: Vector, n: int) -> Number:
    """The largest of b_0, ..., b_n."""
    return max(b[: n + 1])


def least_of(b: Vector, n: int) -> Number:
    """The least of b_0, ..., b_n."""
    return min(b[: n + 1])


@may_fail
def flow_between(here: Here, k: int, t: Time, x: Vector, t1: Time, z: Vector, s: Number) -> Number:
    """Component k of the flow at the share s of the way from (t, x) to (t1, z)."""
    return here.flow(t + s * (t1 - t), *(a + s * (b - a) for a, b in zip(x, z, strict=True)))[k]
