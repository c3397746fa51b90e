"""Radau IIA: its coefficients, its stability, and stiff equations with known solutions."""

from __future__ import annotations

from typing import Any

import mpmath as mp
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm

import hsdsl
from hsdsl.base.numbers.arithmetic import FLOAT64, multiprecision
from hsdsl.engine.backends.python import PythonKernel
from hsdsl.engine.integrators.radau import NoConvergence, coefficients, radau_stepper
from hsdsl.engine.integrators.stepper import Derivatives
from hsdsl.engine.scheme.linear import factored, factored_complex, solve, solve_complex

MANY = multiprecision(50)


def model(flow: str, initial: str, until: Any = 1, transitions: str = "") -> Any:
    """A model of one mode ``m``."""
    text = (
        f"hsdsl: 1\nmodes:\n  m:\n    flow: {flow}\n    {transitions}\n"
        f"initial: {{mode: m, {initial}}}\nexperiment: {{until: {until}, method: radau}}\n"
    )
    return hsdsl.loads(text)


def weights(nodes: Any) -> list[Any]:
    """The integrals from 0 to each node of the polynomials of degree 2 that are 1 at one node and 0 at the others."""
    columns = list[Any]()
    for i, c in enumerate(nodes):
        p, q = (other for j, other in enumerate(nodes) if j != i)
        scale = (c - p) * (c - q)
        columns.append(tuple(s * (p * q + s * (-(p + q) / 2 + s / 3)) / scale for s in nodes))
    return list(zip(*columns, strict=True))


def test_coefficients_as_published() -> None:
    """The table in closed form, with the root of 6 in fifty digits."""
    known, root = coefficients(MANY), MANY.sqrt(MANY.zero + 6)
    published = [
        [(88 - 7 * root) / 360, (296 - 169 * root) / 1800, (-2 + 3 * root) / 225],
        [(296 + 169 * root) / 1800, (88 + 7 * root) / 360, (-2 - 3 * root) / 225],
        [(16 - root) / 36, (16 + root) / 36, (MANY.zero + 1) / 9],
    ]
    for row, expected in zip(weights(known.node), published, strict=True):
        assert all(abs(a - w) <= 8 * MANY.unit for a, w in zip(row, expected, strict=True))


def test_quadrature_of_order_five_and_no_more() -> None:
    known = coefficients(MANY)
    off = [
        abs(
            sum(b * c ** (k - 1) for b, c in zip(weights(known.node)[-1], known.node, strict=True))
            - MANY.sqrt(MANY.zero + 1) / k
        )
        for k in range(1, 7)
    ]
    assert max(off[:5]) <= 8 * MANY.unit
    assert off[5] > 1e-4


def test_the_estimate_vanishes_up_to_degree_two_and_no_further() -> None:
    """Flow at the start and weighted slopes: the embedded method has order 3, so the estimate falls as h**4."""
    known = coefficients(MANY)
    sums = [sum(e * c**k for e, c in zip(known.estimate, known.node, strict=True)) + (k == 1) for k in range(1, 5)]
    assert max(map(abs, sums[:3])) <= 64 * MANY.unit
    assert abs(sums[3]) > 0.01


def test_one_real_and_one_complex_system() -> None:
    """The similarity takes the inverse of a to its eigenvalues; a times that is the similarity again."""
    known, zero = coefficients(MANY), MANY.zero
    middle = [[known.gamma, zero, zero], [zero, known.alpha, known.beta], [zero, -known.beta, known.alpha]]

    def product(p: Any, q: Any) -> list[list[Any]]:
        return [
            [sum((a * b for a, b in zip(row, column, strict=True)), zero) for column in zip(*q, strict=True)]
            for row in p
        ]

    for found, expected in (
        (product(weights(known.node), product(known.mix, middle)), known.mix),
        (product(known.mix, known.unmix), [[zero + (i == j) for j in range(3)] for i in range(3)]),
    ):
        pairs = [(a, b) for row, line in zip(found, expected, strict=True) for a, b in zip(row, line, strict=True)]
        assert max(abs(a - b) for a, b in pairs) <= 256 * MANY.unit


def test_increments_and_polynomial() -> None:
    """The polynomial through increments of a cubic is the cubic, and so are its value and slope inside."""
    known = coefficients(MANY)
    z = [(c + 2 * c**2 - 3 * c**3,) for c in known.node]
    found = [sum(w * k[0] for w, k in zip(row, z, strict=True)) for row in known.power]
    assert max(abs(f - w) for f, w in zip(found, (1, 2, -3), strict=True)) <= 256 * MANY.unit
    s = known.share
    assert abs(sum(w * k[0] for w, k in zip(known.value, z, strict=True)) - (s + 2 * s**2 - 3 * s**3)) <= MANY.unit * 64
    assert abs(sum(w * k[0] for w, k in zip(known.slope, z, strict=True)) - (1 + 4 * s - 9 * s**2)) <= MANY.unit * 256


def one_step(rate: float, h: float) -> tuple[float, float]:
    """End and error estimate of one step from 1 along x' = rate x."""
    stepper = radau_stepper(Derivatives(lambda t, x: (rate,), [1.0]), 1e-14, FLOAT64)
    z, stages = stepper.step(lambda t, x: (rate * x,), 0.0, h, (1.0,), (rate,))
    assert stepper.error is not None
    return z[0], stepper.error(h, stages, (rate * z[0],))[0]


@pytest.mark.parametrize("product", [-0.1, -1.0, -10.0, -1e3, -1e8, 0.5])
def test_stability_function(product: float) -> None:
    """One step multiplies by the (2, 3) Pade approximant of the exponential, which vanishes at infinity."""
    s = mp.mpf(product)
    expected = (1 + 2 * s / 5 + s**2 / 20) / (1 - 3 * s / 5 + 3 * s**2 / 20 - s**3 / 60)
    for h in (1.0, 1e-3):
        assert abs(one_step(product / h, h)[0] - expected) <= 1e-15


def test_what_decays_is_gone_after_one_step() -> None:
    end, error = one_step(-1e8, 1.0)
    assert abs(end) <= 4e-8
    assert abs(abs(error) - 1) <= 0.1  # but the curve inside the step is wrong by that much, and the estimate says so


@pytest.mark.parametrize("rate", [-1e2, -1e6, -1e9])
@pytest.mark.parametrize("scheme", ["relaxed", "located"])
def test_prothero_robinson(rate: float, scheme: str) -> None:
    """The equation x' = rate (x - cos t) - sin t is solved by cos t, whatever the rate; between the samples too."""
    made = model(f"{{x: {rate!r}*(x - cos(t)) - sin(t)}}", "x: 1", 10)
    for tolerance in (1e-4, 1e-7):
        run = made.simulate(tolerance=tolerance, scheme=scheme)
        times = np.linspace(0, 10, 501)
        assert np.max(np.abs(run.sample(times)["x"] - np.cos(times))) <= 10 * tolerance
        assert len(run.times) <= 10 * tolerance**-0.25


def test_van_der_pol() -> None:
    """At mu = 1000, in its own time, against the reference solution of the Test Set for IVP Solvers."""
    made = model('{x: v, v: "((1 - x**2)*v - x)/1e-6"}', "x: 2, v: 0", 2)
    run = made.simulate(tolerance=1e-8)
    assert abs(run.final.state["x"] - 1.706167732170483) <= 1e-8
    peak = np.max(np.abs(run.values[:, 1]))  # v's scale, 1.3e3: its errors are compared with that
    assert abs(run.final.state["v"] + 0.8928097010247975) <= 1e-8 * peak
    assert len(run.times) <= 5000


@pytest.mark.parametrize("seed", range(4))
def test_random_linear_systems(seed: int) -> None:
    """Rates from 1 to 1e6 in random directions: against the matrix exponential, and another Radau code."""
    rng = np.random.default_rng(seed)
    basis = rng.normal(size=(3, 3))
    matrix = basis @ np.diag(-(10.0 ** rng.uniform(0, 6, 3))) @ np.linalg.inv(basis)
    start = rng.normal(size=3)
    rows = [" + ".join(f"({float(a)!r})*{s}" for a, s in zip(row, "xyz", strict=True)) for row in matrix]
    flow = "{" + ", ".join(f'{s}: "{row}"' for s, row in zip("xyz", rows, strict=True)) + "}"
    initial = ", ".join(f"{s}: {float(a)!r}" for s, a in zip("xyz", start, strict=True))
    run = model(flow, initial).simulate(tolerance=1e-6)
    theirs = solve_ivp(
        lambda t, x: matrix @ x, (0, 1), start, "Radau", rtol=1e-8, atol=1e-8, jac=matrix, dense_output=True
    ).sol
    for t in np.concatenate([10.0 ** np.linspace(-7, 0, 20), [0.5]]):
        found = np.array(list(run(float(t)).state.values()))
        assert np.max(np.abs(found - expm(matrix * t) @ start)) <= 1e-5
        assert np.max(np.abs(found - theirs(t))) <= 1e-5


FLOWS = ["x*v", "sin(x)/(2 + v**2)", "sqrt(x)*exp(-v)", "x**v + atan2(x, v)", "abs(x - v) + min(x, v)", "sign(x)*t"]


@pytest.mark.parametrize("flow", FLOWS)
def test_jacobian(flow: str) -> None:
    """Against differences in fifty digits."""
    made = PythonKernel(model(f"{{x: {flow!r}, v: x - t*v}}", "x: 0, v: 0").program, MANY)
    slopes, field = made.jacobian(0, ()), made.bind(0, ()).flow
    t, x, v, h = (MANY.zero + n for n in (0.5, 0.75, 1.25, 1e-20))
    columns = [
        [(a - b) / (2 * h) for a, b in zip(field(t, *up), field(t, *down), strict=True)]
        for up, down in [((x + h, v), (x - h, v)), ((x, v + h), (x, v - h))]
    ]
    expected = [columns[j][i] for i in range(2) for j in range(2)]
    assert all(abs(a - b) <= 1e-28 for a, b in zip(slopes(t, x, v), expected, strict=True))


def test_many_digits() -> None:
    """A decay with rate 1000 beside a slow one, in thirty digits."""
    run = model("{x: -1000*(x - v), v: -v}", "x: 1, v: 1", "1/100").simulate(precision=30, tolerance=1e-15)
    with mp.workdps(40):
        v = mp.exp(mp.mpf(-1) / 100)
        x = mp.mpf(1000) / 999 * v + (1 - mp.mpf(1000) / 999) * mp.exp(-10)
        assert abs(mp.mpf(str(run.final.state["x"])) - x) <= 1e-14
        assert abs(mp.mpf(str(run.final.state["v"])) - v) <= 1e-14


@pytest.mark.parametrize("scheme", ["relaxed", "located"])
def test_crossings(scheme: str) -> None:
    """A ball on the way down, up and down again: bounces at the known times."""
    bounce = "transitions: [{when: h <= 0, to: m, reset: {v: -v}}]"
    run = model("{h: v, v: -2}", "h: 1, v: 0", 4.5, bounce).simulate(tolerance=1e-9, scheme=scheme, relaxation=1e-12)
    assert np.allclose([t.time for t in run.transitions], [1, 3], rtol=0, atol=1e-11)


@pytest.mark.parametrize("scheme", ["relaxed", "located"])
@pytest.mark.parametrize("size", [{"tolerance": 1e-6}, {"step": 0.01}])
def test_blow_up(scheme: str, size: dict[str, float]) -> None:
    run = model("{x: x**2}", "x: 1", 2).simulate(scheme=scheme, **size)
    assert run.stop.reason == "not_finite"
    assert abs(run.stop.time - 1) <= 1e-3


@pytest.mark.parametrize("scheme", ["relaxed", "located"])
@pytest.mark.parametrize("size", [{"tolerance": 1e-6}, pytest.param({"step": 0.01}, marks=pytest.mark.slow)])
def test_a_flow_that_jumps_against_itself(scheme: str, size: dict[str, float]) -> None:
    """No step over x = 0 solves x' = -sign(x), which stays there; the run ends and says so."""
    run = model("{x: -sign(x)}", "x: 1", 2).simulate(scheme=scheme, **size)
    assert run.stop.reason == "step_underflow"
    assert abs(run.final.state["x"]) <= size.get("tolerance", 1e-8)
    most = 1e4 * 1e-6  # it gives up after ten thousand rejections, of steps about as long as the tolerance
    assert 1 - 1e-8 <= run.stop.time <= 1 + most


@pytest.mark.parametrize("scheme", ["relaxed", "located"])
def test_robertson(scheme: str) -> None:
    """Three reactions with rates from 0.04 to 3e7, against published values at t = 40; their sum is kept."""
    rates = '{a: "-0.04*a + 1e4*b*c", b: "0.04*a - 1e4*b*c - 3e7*b**2", c: "3e7*b**2"}'
    run = model(rates, "a: 1, b: 0, c: 0", 40).simulate(tolerance=1e-9, scheme=scheme)
    found = run.final.state
    assert np.allclose(list(found.values()), [0.7158270688, 9.185534765e-6, 0.2841637457], rtol=1e-8, atol=0)
    assert abs(sum(found.values()) - 1) <= 1e-14


@pytest.mark.parametrize("scheme", ["relaxed", "located"])
def test_a_flow_without_derivatives(scheme: str) -> None:
    run = model("{x: 1 + sqrt(x)}", "x: 0").simulate(scheme=scheme)
    assert run.stop.reason == "not_finite"
    assert "the flow of mode m has no derivatives at t = 0" in run.stop.message


def test_a_step_that_newton_does_not_solve() -> None:
    stepper = radau_stepper(Derivatives(lambda t, x: (2 * x,), [1.0]), None, FLOAT64)
    with pytest.raises(NoConvergence):
        stepper.step(lambda t, x: (x * x,), 0.0, 10.0, (1.0,), (1.0,))


def test_engines() -> None:
    made = model("{x: -x}", "x: 1")
    assert made.simulate().engine == "c"
    assert made.simulate(precision=20, until=0.1, tolerance=1e-4).engine == "python"


def test_a_mode_without_states() -> None:
    text = "hsdsl: 1\nmodes: {m: {flow: {}}}\ninitial: {mode: m}\nexperiment: {until: 1, method: radau}\n"
    assert hsdsl.loads(text).simulate().stop.reason == "until"


@pytest.mark.parametrize("size", [1, 2, 7, 40])
def test_complex_linear_equations(size: int) -> None:
    rng = np.random.default_rng(size)
    real, imaginary = rng.normal(size=(2, size, size))
    if size > 1:
        real[0, 0] = imaginary[0, 0] = 0
    right = np.arange(1.0, size + 1) - 1j
    re, im, order, a, b = real.ravel().tolist(), imaginary.ravel().tolist(), [0] * size, [0.0] * size, [0.0] * size
    assert factored_complex(size, re, im, order, [1.0] * size, None)
    solve_complex(size, re, im, order, right.real.tolist(), right.imag.tolist(), a, b)
    assert np.allclose((real + 1j * imaginary) @ (np.array(a) + 1j * np.array(b)), right, rtol=0, atol=1e-11)


@pytest.mark.parametrize("size", [1, 2, 7, 40])
def test_linear_equations(size: int) -> None:
    matrix = np.random.default_rng(size).normal(size=(size, size))
    matrix[0, 0] = 0 if size > 1 else 1  # a pivot must be looked for
    right = np.arange(1.0, size + 1)
    factors, order, found = matrix.ravel().tolist(), [0] * size, [0.0] * size
    assert factored(size, factors, order, [1.0] * size, None)
    solve(size, factors, order, right.tolist(), found)
    assert np.allclose(matrix @ found, right, rtol=0, atol=1e-11)


def test_a_singular_matrix() -> None:
    assert not factored(2, [1.0, 2.0, 2.0, 4.0], [0, 0], [1.0, 1.0], None)
    assert not factored_complex(2, [1.0, 2.0, 2.0, 4.0], [0.0] * 4, [0, 0], [1.0, 1.0], None)
