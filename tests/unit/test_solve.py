"""Quantities given by linear equations, against exact solutions and numpy."""

from __future__ import annotations

import mpmath
import numpy as np
import pytest
import sympy as sp
from engines import ENGINES, needs_compiler

import hsdsl
from hsdsl import UsageError
from hsdsl.base.functions import solution
from hsdsl.mathematics.lower.straight import solved

CART = """hsdsl: 1
parameters: {M: 2, m: 1, l: 1/2, g: 9.81}
let: {f: m*l*w**2*sin(q), twice: 2*b}
solve:
  unknowns: [a, b]
  equations:
    - (M + m)*a + m*l*cos(q)*b == f
    - m*l*cos(q)*a + m*l**2*twice/2 == -m*g*l*sin(q)
modes:
  swing:
    flow: {x: v, v: a, q: w, w: b}
outputs:
  energy: (M + m)*v**2/2 + m*l*v*w*cos(q) + m*l**2*w**2/2 - m*g*l*cos(q)
  left: (M + m)*a + m*l*cos(q)*b - f
initial: {mode: swing, x: 0, v: 0, q: 2, w: 0}
experiment: {until: 5}
"""


@pytest.fixture
def cart():
    return hsdsl.loads(CART)


@pytest.mark.parametrize("method", ["taylor", "dop853", "radau"])
def test_a_mass_matrix_keeps_energy(cart, method):
    run = cart.simulate(method=method, tolerance=1e-11)
    energy = run.outputs["energy"] if isinstance(run.outputs, dict) else run.final.outputs["energy"]
    assert np.allclose(energy, -9.81 / 2 * np.cos(2), rtol=1e-8)
    assert abs(run.final.outputs["left"]) < 1e-12


@needs_compiler
@pytest.mark.parametrize("method", ["taylor", "dop853", "radau"])
def test_engines_agree_to_the_last_bit(cart, method):
    python, c = (cart.simulate(method=method, engine=engine) for engine in ("python", "c"))
    assert python.final.state == c.final.state and python.final.outputs == c.final.outputs


def test_many_digits(cart):
    """The same as with the solution by Cramer's rule, written out."""
    d = "((M + m)*m*l**2 - (m*l*cos(q))**2)"
    a = f"(f*m*l**2 + m*l*cos(q)*m*g*l*sin(q))/{d}"
    b = f"(-(M + m)*m*g*l*sin(q) - m*l*cos(q)*f)/{d}"
    begin, end = CART.index(", twice"), CART.index("modes:")
    text = f"{CART[:begin]}, a: {a}, b: {b}}}\n{CART[end:]}"
    by_hand = hsdsl.loads(text).simulate(precision=40, until="1/2")
    found = cart.simulate(precision=40, until="1/2")
    for name, value in by_hand.final.state.items():
        assert mpmath.almosteq(value, found.final.state[name], rel_eps=mpmath.mpf(10) ** -30)


def numbers(rows, right):
    """The unknowns in floats, by the statements that are generated."""
    values = {}

    def name(expr):
        symbol = sp.Symbol(f"s{len(values)}")
        values[symbol] = float(sp.sympify(expr).xreplace(values))
        return symbol

    given = [[name(sp.Float(float(v), 17)) for v in row] for row in rows]
    unknowns = solved(given, [name(sp.Float(float(v), 17)) for v in right], name)
    return np.array([values[x] for x in unknowns])


@pytest.mark.parametrize("size", [2, 3, 5])
def test_random_matrices_in_any_units(size):
    random = np.random.default_rng(size)
    for _ in range(3):
        a, x = random.normal(size=(size, size)), random.normal(size=size)
        a[0, 0] = 0  # elimination without a choice of pivots divides by it
        rows, columns = 10.0 ** random.integers(-9, 9, size), 10.0 ** random.integers(-9, 9, size)
        scaled = rows[:, None] * a * columns
        found = numbers(scaled, scaled @ (x / columns)) * columns
        assert found == pytest.approx(x, rel=1e-11 * np.linalg.cond(a))


@pytest.mark.parametrize("scale", [1e-12, 1.0, 1e12])
def test_singular_matrices_have_no_solution(scale):
    rows = scale * np.array([[1, 2, 3], [0.1, 0.7, 0.9], [1.1, 2.7, 3.9]])
    with pytest.raises((ZeroDivisionError, TypeError)):
        numbers(rows, [1, 2, 3])


def test_derivatives():
    names = sp.symbols("p q r s u v", real=True)
    made = solution(sp.Integer(1), sp.Integer(2), *names)
    p, q, r, s, u, v = names
    exact = (p * v - r * u) / (p * s - q * r)
    at = dict(zip(names, map(sp.Rational, (3, 1, 2, 5, 7, 4)), strict=True))

    def value(expr):
        plain = expr.replace(solution, lambda i, n, *e: sp.Matrix(2, 2, e[:4]).LUsolve(sp.Matrix(e[4:]))[int(i)])
        return sp.simplify(plain.xreplace(at))

    for name in names:
        assert value(made.diff(name)) == exact.diff(name).xreplace(at)


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("method", ["taylor", "dop853"])
def test_a_singular_start_is_a_failure_with_its_place(engine, method):
    text = """hsdsl: 1
modes: {m: {solve: {unknowns: [a, b], equations: [x*a + b == 1, a + b == 2]}, flow: {x: 1, y: a}}}
initial: {mode: m, x: 1, y: 0}
experiment: {until: 1}
"""
    run = hsdsl.loads(text).simulate(engine=engine, method=method)
    assert run.stop.reason == "not_finite" and "the flow of y, a" in run.stop.message


def test_modes_have_their_own():
    text = """hsdsl: 1
modes:
  one: {solve: {unknowns: [a], equations: [2*a == 4]}, flow: {x: a}, transitions: [{when: x >= 2*a, to: two}]}
  two: {solve: {unknowns: [a], equations: [a + 3 == x - a]}, let: {b: 2*a}, flow: {x: b}}
initial: {mode: one, x: 0}
experiment: {until: 3}
"""
    run = hsdsl.loads(text).simulate()
    assert run.transitions[0].time == pytest.approx(2, abs=1e-12)
    assert run.final.state["x"] == pytest.approx(3 + np.exp(1), rel=1e-9)  # x' = x - 3 from 4


def test_sensitivities(cart):
    found = cart.sensitivity("m", until=1).final.state["q"]["m"]
    plus, minus = (
        cart.simulate(until=1, tolerance=1e-12, parameters={"m": 1 + h}).final.state["q"] for h in (1e-5, -1e-5)
    )
    assert found == pytest.approx((plus - minus) / 2e-5, rel=1e-6)


COUPLED = """hsdsl: 1
parameters: {m: 1.8, k: 4, s: 0.2}
solve:
  unknowns: [ax, ay]
  equations: ["m*ax + 0.3*cos(x)*ay == -k*x - 0.1*u", "0.4*ax + (m + 1)*ay == sin(2*t) - w - 1"]
modes:
  free:
    flow: {x: u, u: ax, w: ay}
    transitions: [{name: stop, when: x >= s, to: held, reset: {u: -u/2 + 0.1*ay, w: 0.8*w}}]
  held:
    flow: {x: u, u: ax - u, w: ay}
    transitions: [{name: pull, when: ax + ay >= -k*s/2, to: free, reset: {w: w + ax}}]
initial: {mode: free, x: 0, u: 1.2, w: 0.1}
experiment: {until: 0.8}
"""


def test_sensitivities_through_guards_and_resets_with_unknowns():
    """Derivatives of unknowns are unknowns of the same matrix: written out, those of leaps would have no end."""
    model = hsdsl.loads(COUPLED)
    found = model.sensitivity("m,initial.u", engine="python")
    assert [made.edge for made in found.transitions] == ["stop", "pull"]
    h = 1e-5
    for group, name, value in (("parameters", "m", 1.8), ("initial", "u", 1.2)):
        by = name if group == "parameters" else f"initial.{name}"
        runs = [model.simulate(tolerance=1e-13, **{group: {name: value + way * h}}) for way in (1, -1)]
        times = [run.transitions[1].time for run in runs]
        assert found.transitions[1].time[by] == pytest.approx((times[0] - times[1]) / (2 * h), rel=1e-7)
        for x, row in found.final.state.items():
            ends = [run.final.state[x] for run in runs]
            assert row[by] == pytest.approx((ends[0] - ends[1]) / (2 * h), rel=1e-7)


def test_what_cannot_keep_them_refuses(cart):
    from hsdsl.export import files_of, source_of

    with pytest.raises(UsageError, match="solve"):
        files_of(source_of(cart, {}), "latex")
    with pytest.raises(UsageError, match="solve"):
        cart.completed()
