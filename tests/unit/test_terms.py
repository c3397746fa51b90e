"""Bounds on the terms of flows: what round-off is relative to, and runs along flows that are nothing but that."""

from __future__ import annotations

import random

import pytest
from engines import COMPILER, assert_engines_agree

import hsdsl
from hsdsl.base.numbers.arithmetic import FLOAT64, multiprecision
from hsdsl.engine.backends.python import PythonKernel

JUMP = "floor(y/100)"  # 0
EXPRESSIONS = [
    "sin(x)**2 + cos(x)**2 - 1",
    "(x + 1e8*y) - 1e8*y - x",
    "atan2(sin(x), cos(x)) - x",
    "x*(1e6 + y) - x*1e6 - x*y",
    "exp(x)*exp(-x) - 1 + (sqrt(y)**2 - y)",
    "log(x*y) - log(x) - log(y)",
    "(x + y)**5 - (x**5 + 5*x**4*y + 10*x**3*y**2 + 10*x**2*y**3 + 5*x*y**4 + y**5)",
    "select(x - y, x/y, y/x)*min(x, y)/max(x, y) - (select(x - y, 1, (y/x)*(x/y)))",
    "tanh(x) - (exp(x) - exp(-x))/(exp(x) + exp(-x)) + sin(1e5*t) - sin(1e5*t + 2*pi)",
    "abs(x - 3) - (3 - x) + x**y - exp(y*log(x))",
]

# a Geneva drive: the wheel's angle by the direction of the pin, against the angle that its speed adds up to
GENEVA = """hsdsl: 1
parameters: {{omega: {omega}, r: {r}, C: sqrt(2)*r, k: {k}}}
let:
  u: C - r*cos(a)
  w: r*sin(a)
  # the derivative of atan2(w, u), and the same by the law of cosines: what the pin slides across its slot
  across: omega*(r*cos(a)*u - r*sin(a)*w)/(u**2 + w**2) - omega*(r*C*cos(a) - r**2)/(C**2 + r**2 - 2*C*r*cos(a))
modes:
  dwell:
    flow: {{a: omega, n: 0, e: 'k*(atan2(sin(a - pi), cos(a - pi)) - (a - pi))', f: 0}}
    transitions: [{{name: engage, when: a >= 7*pi/4, to: drive, reset: {{a: a - 2*pi}}}}]
  drive:
    flow: {{a: omega, n: 0, e: 'k*(across + {jump})', f: 'e + k*(atan2(sin(a), cos(a)) - a)'}}
    transitions: [{{name: release, when: a >= pi/4, to: dwell, reset: {{n: n + 1}}}}]
initial: {{mode: dwell, a: 1, n: 0, e: 0, f: 0}}
experiment: {{until: {until}}}
"""


@pytest.mark.parametrize("text", EXPRESSIONS)
def test_terms_bound_the_round_off_of_a_flow(text: str) -> None:
    """Against fifty digits at the same floats."""
    model = hsdsl.loads(
        f"hsdsl: 1\nmodes: {{m: {{flow: {{x: '{text} + {JUMP}', y: 0}}}}}}\n"
        "initial: {mode: m, x: 1, y: 1}\nexperiment: {until: 1}\n"
    )
    floats, exact = PythonKernel(model.program, FLOAT64), PythonKernel(model.program, multiprecision(50))
    terms, draw = floats.terms(0, ()), random.Random(text)
    assert terms is not None
    for _ in range(50):
        at = draw.uniform(0, 1), draw.uniform(0.5, 2), draw.uniform(0.5, 2)
        value, _ = floats.bind(0, ()).flow(*at)
        expected, _ = exact.bind(0, ()).flow(*(exact.arithmetic.zero + v for v in at))
        bound, _ = terms(*at, *map(abs, at[1:]))
        assert abs(float(value - expected)) <= 2 * FLOAT64.unit * bound
        assert abs(value) <= bound


@pytest.mark.parametrize("method", ["dopri5", "dop853", "radau"])
@pytest.mark.parametrize("tolerance", [1e-6, 1e-9, 1e-12])
@pytest.mark.parametrize("omega, r, k, jump", [(1.7, 0.4, 40, "floor(a/90 + 1/8)"), (300, 5, 1e-3, "1 - sign(n + 1)")])
def test_round_off_of_a_mechanism_at_rest_is_no_motion(omega, r, k, jump, tolerance, method) -> None:
    model = hsdsl.loads(GENEVA.format(omega=omega, r=r, k=k, jump=jump, until=15 / omega))
    arguments = {"method": method, "tolerance": tolerance}
    run = assert_engines_agree(model, **arguments) if COMPILER else model.simulate(**arguments)
    assert run.stop.reason == "until" and [each.edge for each in run.transitions] == ["engage", "release"] * 2
    assert len(run.times) < 400  # thousands, where steps are fitted to round-off
    assert abs(run.final.state["e"]) < 1e-12 * k
