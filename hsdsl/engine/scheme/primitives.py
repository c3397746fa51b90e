"""What the text of the scheme may say beside Python's own words, and what is written twice.

First kinds of values, and what a function is in C. Then inner loops that in C are tuned by hand (``primitives.h``),
each with the same bits, and what is of a model: its routines, and records that C has in its headers.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import reduce
from operator import add
from typing import Any, TypeVar

from hsdsl.base.numbers.arithmetic import Number

Time = Number  # an instant: of 64 bits also where numbers have 32
Vector = Sequence[Number]  # that is only read
Room = list[Number]  # that is written
Indices = Sequence[int]  # that are only read
IndexRoom = list[int]  # that are written
each = range  # for passes of which none depends on another: C may make several at once
Count = int  # of 64 bits
Here = Any  # in C the run; in Python what primitives need of the mode that it is in
Function = TypeVar("Function", bound=Callable[..., Any])


def inline(function: Function) -> Function:
    """In C its text is put where it is called."""
    return function


def may_fail(function: Function) -> Function:
    """It may raise one of ``DOMAIN_ERRORS``; in C it returns whether it has failed."""
    return function


@dataclass(frozen=True)
class Collocation:
    """Coefficients of Radau IIA.

    Attributes
    ----------
    node : Vector
        The three c_i.
    power : sequence of Vector
        Row m has the weights of the three increments in the polynomial's coefficient of s**(m + 1), s the share of
        the step.
    gamma, alpha, beta : Number
        The eigenvalues of the inverse of A: gamma and alpha +- i beta.
    mix, unmix : sequence of Vector
        T, whose columns are an eigenvector to gamma and the parts of one to alpha + i beta, and its inverse.
    estimate : Vector
        Weights of the increments in the embedded method's defect, added to h times the flow at the step's start.
    share : Number
        Where inside a step its polynomial is compared with the flow: (6 - sqrt 6)/10.
    value, slope : Vector
        Weights of the increments in the polynomial and in its derivative by s there.
    end_slope : Vector
        Weights of the increments in the derivative by s at the step's end.
    """

    node: Vector
    power: Sequence[Vector]
    gamma: Number
    alpha: Number
    beta: Number
    mix: Sequence[Vector]
    unmix: Sequence[Vector]
    estimate: Vector
    share: Number
    value: Vector
    slope: Vector
    end_slope: Vector


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


@may_fail
def flow_at(here: Here, t: Time, x: Vector, out: Room) -> None:
    """The flow."""
    out[:] = here.flow(t, *x)


def has_terms(here: Here) -> bool:
    """Whether a routine bounds the terms of the flow."""
    return here.terms is not None


@may_fail
def terms_at(here: Here, t: Time, x: Vector, sizes: Vector, out: Room) -> None:
    """The sizes of the terms of the flow, at states of these sizes."""
    out[:] = here.terms(t, *x, *sizes)


@may_fail
def derivatives_at(here: Here, t: Time, x: Vector, out: Room) -> None:
    """The derivatives of the flow by the states, those that are not zero everywhere."""
    derivatives = here.jacobian(t, *x)
    out[:] = derivatives if here.places is None else [derivatives[place] for place in here.places]


@inline
def sum_of(v: Vector, n: int) -> Number:
    """A sum, made of four so that none must wait for another."""
    whole = n - n % 4
    a, b, c, d = (reduce(add, v[i:whole:4], 0) for i in range(4))
    return (reduce(add, v[whole:n], a) + b) + (c + d)
