"""Flows that are small differences of large terms, whose last digits states and time do not tell."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import mpmath as mp
import pytest
import sympy as sp
from engines import assert_engines_agree, needs_compiler

import hsdsl
from hsdsl.mathematics.lower.mode import may_hide

UNIT = 2.0**-53
X, V, T = sp.symbols("x v t", real=True)
L, K = sp.symbols("L k", positive=True)
HIDE = [
    sp.sqrt(L**2 + X**2) - L,
    1 - sp.cos(X),
    sp.exp(X / L) - 1 - X / L,
    K * ((X + L) ** 2 - L**2),
    L + K * X - K,
    V * (sp.log(L + X) - sp.log(L)),
    1 / (1 + sp.sqrt(L + X) - sp.sqrt(L)),
]
DO_NOT = [
    -K * X - L * V,
    K * (X - L) + V,
    (1 - X**2) * V - X,
    -X / (X**2 + V**2) ** sp.Rational(3, 2),
    -K * sp.sin(X) - L * V,
    10 * (V - X),
    X * (28 - V) - T,
    (L - K) * X,
    sp.exp(L * X) * V,
]
# a flow of W by the parameters k and L and a state x, which oscillates with w; and what it is
FLOWS: dict[str, tuple[str, Callable[..., Any]]] = {
    "a root": ("k*(sqrt(L**2 + x**2) - L)", lambda k, size, x: k * (mp.sqrt(size**2 + x**2) - size)),
    "a cosine": ("k*L*(1 - cos(x/L))", lambda k, size, x: k * size * (1 - mp.cos(x / size))),
    "an exponential": ("k*L*(exp(x/L) - 1 - x/L)", lambda k, size, x: k * size * (mp.exp(x / size) - 1 - x / size)),
    "a square": ("k*((x + L)**2/L - L)", lambda k, size, x: k * ((x + size) ** 2 / size - size)),
    "states": ("k*(sqrt(a**2 + x**2) - b)", lambda k, size, x: k * (mp.sqrt(size**2 + x**2) - size)),
    "nothing": ("k*L*(sin(x)**2 + cos(x)**2 - 1)", lambda k, size, x: mp.mpf(0)),
}
MODEL = """hsdsl: 1
parameters: {{k: {k!r}, L: {size!r}, w: {w!r}}}
modes: {{run: {{flow: {{W: "{flow}", x: v, v: -w**2*x, a: 0, b: 0, V: W}}}}}}
initial: {{mode: run, W: 0, x: 0, v: {w!r}, a: L, b: L, V: 0}}
experiment: {{until: {until!r}}}
"""


def model_of(name: str, k: float, size: float, w: float) -> hsdsl.Model:
    return hsdsl.loads(MODEL.format(k=k, size=size, w=w, flow=FLOWS[name][0], until=10 / w))


@pytest.mark.parametrize("expr", HIDE, ids=str)
def test_sums_that_may_hide_terms(expr: sp.Expr) -> None:
    assert may_hide([X, expr], (X, V, T))


@pytest.mark.parametrize("expr", DO_NOT, ids=str)
def test_sums_whose_terms_are_seen(expr: sp.Expr) -> None:
    assert not may_hide([X, expr], (X, V, T))


@needs_compiler
@pytest.mark.parametrize("sizes", [(1.0, 1e5, 1.0), (1e-7, 1e3, 1e4), (1e8, 1e6, 1e-3)], ids=str)
@pytest.mark.parametrize("name", FLOWS)
def test_runs_are_as_right_as_their_numbers(name: str, sizes: tuple[float, float, float]) -> None:
    """The integral of W's flow along sin(w t), by every adaptive method in both schemes."""
    k, size, w = sizes
    model, until = model_of(name, *sizes), 10 / w
    exact = mp.quad(lambda t: FLOWS[name][1](k, mp.mpf(size), mp.sin(w * t)), mp.linspace(0, until, 7))
    noise = 64 * UNIT * k * size * until
    for method in ("taylor", "dopri5", "dop853", "radau"):
        for scheme in ("located", "relaxed"):
            run = model.simulate(method=method, scheme=scheme)
            assert run.stop.complete and len(run.times) < 4000
            assert abs(run.final["W"] - exact) < noise + 1e-5 * abs(exact), (method, scheme)


@needs_compiler
@pytest.mark.parametrize("method", ["taylor", "dopri5", "radau"])
@pytest.mark.parametrize("name", ["a root", "a cosine", "states"])
def test_engines_agree_there(name: str, method: str) -> None:
    assert_engines_agree(model_of(name, 1.0, 1e5, 1.0), method=method)
