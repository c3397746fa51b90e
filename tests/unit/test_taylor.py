"""Taylor coefficients by recurrences: against exact series, SymPy's derivatives, and random expressions."""

from __future__ import annotations

from fractions import Fraction
from math import factorial
from typing import Any

import mpmath as mp
import pytest
import sympy as sp
from hypothesis import given, settings
from hypothesis import strategies as st

import hsdsl
from hsdsl.base.functions import FUNCTIONS
from hsdsl.base.numbers.arithmetic import FLOAT64, multiprecision
from hsdsl.engine.backends.python import PythonKernel

MANY = multiprecision(60)
DIGITS = mp.mpf(10) ** -50


def kernel(directory: Any, flow: str, surfaces: list[str], arithmetic: Any = MANY, parameters: str = "{}") -> Any:
    """The kernel of a model of one mode with these surfaces as walls."""
    path = directory / "model.yaml"
    rest = ", v: 0" if "v:" in flow else ""
    walls = "".join(f'\n      - "{text} <= 0"' for text in surfaces)
    path.write_text(
        f"hsdsl: 1\nparameters: {parameters}\nmodes:\n  m:\n    flow: {flow}\n    domain: [] \n"
        f"initial: {{mode: m, x: 0{rest}}}\nexperiment: {{until: 1}}\n".replace("[] ", walls or "[]")
    )
    program = hsdsl.load(path).program
    return PythonKernel(program, arithmetic), program


def series(directory: Any, flow: str, order: int, x: list[Any], t: Any = 0, **more: Any) -> Any:
    """The coefficients of the first state along a flow."""
    made, program = kernel(directory, flow, [], **more)
    data = tuple(made.constant(f"parameter_{i}", ())[0] for i in range(len(program.parameters)))
    start = tuple(made.arithmetic.zero + v for v in x)
    return both(made.taylor(0, data), order, made.arithmetic.zero + t, start)[0][0]


def both(taylor: Any, order: int, t: Any, x: Any) -> Any:
    """The coefficients of states and of surfaces, up to the order."""
    lines = taylor.flow(order, t, x)
    return [line[: order + 1] for line in lines[1 : len(x) + 1]], taylor.surfaces(order, lines)


def near(actual: Any, expected: Any) -> bool:
    return all(abs(a - w) <= DIGITS * max(1, abs(w)) for a, w in zip(actual, expected, strict=True))


EXACT = {
    "constant": ("{x: 3}", [2], lambda k: [2, 3, *[0] * 20][k]),
    "exponential": ("{x: x}", [1], lambda k: mp.mpf(1) / factorial(k)),
    "geometric": ("{x: x**2}", [1], lambda k: 1),
    "a rational function": ("{x: 1/(2 - t)}", [0], lambda k: 0 if k == 0 else mp.mpf(1) / (k * 2**k)),
    "a root": ("{x: 1/(2*x)}", [1], lambda k: mp.binomial(mp.mpf(1) / 2, k)),
    "a power of a zero": ("{x: t**3}", [0], lambda k: mp.mpf(k == 4) / 4),
    "a sine as an oscillator": ("{x: v, v: -x}", [0, 1], lambda k: mp.mpf([0, 1, 0, -1][k % 4]) / factorial(k)),
    "a power by a parameter": ("{x: p*x**(1 - 1/p)}", [1], lambda k: mp.binomial(3, k)),
    "nothing moves": ("{x: 0}", [5], lambda k: 5 * (k == 0)),
}


@pytest.mark.parametrize("name", EXACT)
def test_series_of_known_solutions(name: str, tmp_path: Any) -> None:
    flow, start, expected = EXACT[name]
    with mp.workdps(60):
        more = {"parameters": "{p: 3}"} if "p" in flow else {}
        assert near(series(tmp_path, flow, 20, start, **more), [expected(k) for k in range(21)])


ARGUMENTS = {"acosh": "2 + x", "atan2": "1 + x, 2 - x**2", "log": "1 + x", "sqrt": "1 + x"}
SMOOTH = [name for name in FUNCTIONS if name not in ("abs", "sign", "floor", "min", "max", "select")]
EXPRESSIONS = [f"{name}({ARGUMENTS.get(name, 'x + x**2/3')})" for name in SMOOTH] + [
    "(1 + x)**(7/3)",
    "(1 + x)**-5",
    "x**9",
    "(2 + x)**x",
    "2**x",
    "(3 - x)**0.5/(1 + x)",
    "p*x*sin(x)/cos(x) - pi*x + 1",
    "sin(x)**2 + cos(x)**2 + sin(x)*cosh(x)",
    "x**p",
]


@pytest.mark.parametrize("text", EXPRESSIONS)
def test_surfaces_along_a_straight_flow(text: str, tmp_path: Any) -> None:
    made, _ = kernel(tmp_path, "{x: 1}", [text], parameters="{p: 5}")
    found = both(made.taylor(0, (MANY.zero + 5,)), 8, MANY.zero, (MANY.constant(Fraction(3, 10)),))[1][0]
    residual = hsdsl.load(tmp_path / "model.yaml").system.modes[0].walls[0].residual
    x, p = (sp.Symbol(name, real=True) for name in "xp")
    with mp.workdps(60):
        expected = mp.taylor(sp.lambdify(x, residual.subs(p, 5), "mpmath"), mp.mpf(3) / 10, 8)  # by differences
        assert near([mp.mpf(c) for c in found], expected)


def test_a_whole_power_of_a_series_that_begins_with_zero(tmp_path: Any) -> None:
    made, _ = kernel(tmp_path, "{x: 1}", ["x**p"], parameters="{p: 3}")
    assert both(made.taylor(0, (MANY.zero + 3,)), 5, MANY.zero, (MANY.zero,))[1][0] == [0, 0, 0, 1, 0, 0]


def test_kinked_flows_have_no_series_and_kinked_surfaces_none_of_theirs(tmp_path: Any) -> None:
    made, _ = kernel(tmp_path, "{x: abs(x)}", ["x"])
    assert made.taylor(0, ()) is None
    made, _ = kernel(tmp_path, "{x: 1}", ["sin(abs(x))", "sin(x)"], FLOAT64)
    states, surfaces = both(made.taylor(0, ()), 2, 0.0, (0.0,))
    assert states == [[0.0, 1.0, 0.0]] and surfaces[0] is None and surfaces[1] == [0.0, 1.0, 0.0]


LEAVES = st.sampled_from(["x", "t", "p", "2", "1/3", "pi"])
TREES = st.recursive(
    LEAVES,
    lambda inner: st.one_of(
        st.tuples(inner, st.sampled_from("+-*"), inner).map(lambda p: f"({p[0]} {p[1]} {p[2]})"),
        st.tuples(st.sampled_from(["sin", "cos", "tanh", "atan", "asinh", "exp"]), inner).map(
            lambda p: f"{p[0]}({p[1]})"
        ),
        inner.map(lambda u: f"1/(2 + sin({u}))"),
        inner.map(lambda u: f"sqrt(2 + cos({u}))"),
        inner.map(lambda u: f"({u})**3"),
    ),
    max_leaves=6,
)


@settings(max_examples=40, deadline=None)
@given(flow=TREES, surface=TREES)
def test_coefficients_of_random_expressions_are_derivatives(tmp_path_factory: Any, flow: str, surface: str) -> None:
    """The series' sum near the point solves the equation, and gives the surface there, to the order of the series."""
    made, _ = kernel(
        tmp_path_factory.mktemp("m"), f'{{x: "{flow}"}}', [f"({surface})*t + {surface}"], parameters="{p: 0.7}"
    )
    data = (MANY.constant(Fraction(7, 10)),)
    x, t, s, order = MANY.zero + 0.3, MANY.zero + 0.1, MANY.constant(Fraction(1, 10**12)), 4
    try:
        (states,), (residual,) = both(made.taylor(0, data), order, t, (x,))
    except (OverflowError, ValueError):
        return
    sums = [sum(c * s**k for k, c in enumerate(row)) for row in (states, residual)]
    slope = sum(k * c * s ** (k - 1) for k, c in enumerate(states) if k)
    bound = made.bind(0, data)
    size = max(1, *(abs(c) for c in (*states, *residual)))
    assert abs(slope - bound.flow(t + s, sums[0])[0]) <= size**6 * 1e-44
    assert abs(sums[1] - bound.surfaces(t + s, sums[0])[0]) <= size**6 * 1e-44


KINKED = """
hsdsl: 1
modes:
  a: {flow: {x: "abs(x) - 1"}}
initial: {mode: a, x: 0}
experiment: {until: 1, method: taylor}
"""


def test_kinked_flows_are_refused_in_a_sentence() -> None:
    with pytest.raises(hsdsl.UsageError, match="needs smooth flows; that of mode a has abs"):
        hsdsl.loads(KINKED).simulate()


def test_a_flow_without_a_series_stops_in_a_sentence() -> None:
    run = hsdsl.loads(KINKED.replace("abs(x) - 1", "1 + sqrt(t)")).simulate()
    assert run.stop.reason == "not_finite"
    assert "the flow of mode a has no Taylor series at t = 0; another method may go on" in run.stop.message


def test_an_even_solution_is_no_trap() -> None:
    """All coefficients up to the order vanish at the start."""
    run = hsdsl.loads(KINKED.replace("abs(x) - 1", "t**40")).simulate(tolerance=1e-12)
    assert run.final.state["x"] == pytest.approx(1 / 41, abs=1e-11)
