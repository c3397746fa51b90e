"""When floor, sign, abs, min, max and atan2 of time change: every change, at its time, and no other."""

import math
from pathlib import Path

import pytest
from engines import ENGINES

import hsdsl
from hsdsl.base.errors import UsageError
from hsdsl.base.limits import Limits, applied
from hsdsl.base.numbers.arithmetic import FLOAT64, Arithmetic, multiprecision
from hsdsl.engine.backends.python import PythonKernel
from hsdsl.engine.simulate.input_segments import Timeline, make_timeline
from hsdsl.language.elaborate import elaborate
from hsdsl.mathematics.lower import lower

MODEL = """hsdsl: 1
parameters: {{p: 0.3}}
inputs: {{w: {{times: [0, 2, 4], values: [0, 2, 0], hold: linear}}}}
modes: {{a: {{flow: {{x: "{}", y: w}}}}}}
initial: {{mode: a, x: 0, y: 0}}
experiment: {{until: "{}"}}
"""


def timeline(expression: str, until: str, arithmetic: Arithmetic = FLOAT64) -> Timeline:
    program = lower(elaborate("model.yaml", text=MODEL.format(expression, until).encode()))
    kernel = PythonKernel(program, arithmetic)
    parameters = kernel.constant("parameter_0", ())
    return make_timeline(program, kernel, parameters, kernel.constant("until", parameters)[0])


def boundaries(found: Timeline) -> list[float]:
    return [float(s.start) for s in found.segments[1:] if s.start not in (2, 4)]  # those are samples of w


R = math.sqrt(2)
CHANGES: list[tuple[str, str, list[float]]] = [
    ("floor(t/p)", "1", [0.3, 0.6, 0.9]),
    ("floor(-t)", "2.5", [1]),
    ("floor(10*t - 3)", "0.35", [0.1, 0.2, 0.3]),
    ("sign(t - 1/3)", "1", [1 / 3]),
    ("sign(sin(t))", "10", [math.pi, 2 * math.pi, 3 * math.pi]),
    ("abs(sin(t))", "10", [math.pi, 2 * math.pi, 3 * math.pi]),
    ("floor(3*sin(t))", "2", [math.asin(1 / 3), math.asin(2 / 3)]),
    ("floor(sin(t))", "10", [math.pi, 2 * math.pi, 3 * math.pi]),  # 1 and -1 are touched
    ("floor(t**2)", "1.9", [1, R, math.sqrt(3)]),
    ("sign((t - 1)**3)", "1.9", [1]),
    ("sign((t - 1)**2)", "1.9", []),
    ("sign((t - 1)**2 - 1e-12)", "1.9", [1 - 1e-6, 1 + 1e-6]),
    ("sign(tan(t))", "5", [math.pi / 2, math.pi, 3 * math.pi / 2]),
    ("floor(sqrt(t - 1))", "1.9", [1]),  # no value before
    ("max(exp(-t), 1/2)", "1", [math.log(2)]),
    ("min(t**2, 1, t + 1)", "1.9", [1]),
    ("atan2(sin(t), cos(t))", "4", [math.pi / 2, math.pi]),
    ("floor(t - floor(t))", "3.5", [1, 3]),  # where the inner one changes
    ("floor(floor(t)/2)", "3.5", [1, 3]),
    ("sign(1/2 - (t - floor(t)))", "1.9", [1 / 2, 1, 3 / 2]),
    ("sign(max(0, t - 1))", "1.9", [1]),
    ("floor(w)", "3.5", [1, 3]),
    ("sign(w - 1/2)", "3.9", [1 / 2, 3.5]),
    ("floor(x)", "1", []),  # of a state
]  # fmt: skip


@pytest.mark.parametrize("arithmetic", [FLOAT64, multiprecision(30)], ids=["float64", "30 digits"])
@pytest.mark.parametrize(("expression", "until", "expected"), CHANGES, ids=[c[0] for c in CHANGES])
def test_changes(expression: str, until: str, expected: list[float], arithmetic: Arithmetic) -> None:
    expected = [t for t in expected if t < float(until)]
    found = boundaries(timeline(expression, until, arithmetic))
    assert found == pytest.approx(expected, rel=2e-15, abs=2e-15)


@pytest.mark.parametrize(
    ("expression", "jumps"), [("floor(t)", True), ("sign(t - 1)", True), ("abs(t - 1)", False), ("min(t, 1)", False)]
)
def test_a_kink_is_no_jump(expression: str, jumps: bool) -> None:
    assert [s.jump for s in timeline(expression, "1.5").segments] == [False, jumps]


def test_more_changes_than_the_limit_are_refused() -> None:
    for expression in ("floor(1e4*t)", "sign(sin(1e5*t))"):
        with applied(Limits(switches=1000)), pytest.raises(UsageError, match="more than 1000 times"):
            timeline(expression, "1")


def test_a_model_carries_its_limit(tmp_path: Path) -> None:
    path = tmp_path / "model.yaml"
    path.write_text(MODEL.format("floor(20*t)", "1"))
    with pytest.raises(UsageError, match="--limit switches=100"):
        try:
            hsdsl.load(path, limits=Limits(switches=10)).simulate()
        except UsageError as error:
            raise UsageError(f"{error} {error.hint}") from None
    assert hsdsl.load(path).simulate().final.state["x"] == pytest.approx(9.5)


def test_thousands_of_changes_are_followed() -> None:
    run = hsdsl.loads(MODEL.format("sign(sin(t) - (50*t - floor(50*t)))", "20*pi")).simulate()
    assert len(run.arcs) > 4000
    assert run.verdict.theorem == "holds"


@pytest.mark.parametrize("text", ["abs(max(sin(t), 0.4) - 0.4)", "max(max(sin(t), 0.4) - 0.4, 0)"])
def test_a_level_that_an_input_stays_at(text: str) -> None:
    """It is off the level while the sine is above 0.4."""
    model = hsdsl.loads(f"""
hsdsl: 1
inputs: {{u: "{text}"}}
modes: {{A: {{flow: {{x: u}}}}}}
initial: {{mode: A, x: 0}}
experiment: {{until: 6}}
""")
    start = math.asin(0.4)
    assert model.simulate().final.state["x"] == pytest.approx(
        2 * math.cos(start) - 0.4 * (math.pi - 2 * start), rel=1e-9
    )


TWO_PARTS = 2 / 3 / 0.3 * (0.7**1.5 + 0.5**1.5)  # the integral of sqrt(|0.3 t - 0.7|) until 4
ROOTS: list[tuple[str, str, float]] = [
    ("sqrt(abs(0.3*t - 0.7))", "4", TWO_PARTS),
    ("max(t/3 - 0.604, 0)**1.5", "3", 3 / 2.5 * 0.396**2.5),
    ("sqrt(max(sin(t), 0))", "3*pi", 2 * 2.396280469471184),
    ("sqrt(0.7*t - floor(0.7*t))", "20/7", 2 * 2 / 3 / 0.7),
    ("acos(min(t/3, 1))", "4", 3.0),
    ("sqrt(2.1 - w)", "4", 2 * 2 / 3 * (2.1**1.5 - 0.1**1.5)),
]


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("method", ["auto", "dopri5", "dop853", "radau"])
@pytest.mark.parametrize(("text", "until", "right"), ROOTS, ids=[text for text, _, _ in ROOTS])
def test_rounding_at_a_switch_takes_no_root_of_its_value(
    engine: str, method: str, text: str, until: str, right: float
) -> None:
    run = hsdsl.loads(MODEL.format(text, until)).simulate(method=method, engine=engine)
    assert run.stop.reason == "until", run.stop
    assert run.final.state["x"] == pytest.approx(right, rel=2e-7)


@pytest.mark.parametrize("method", ["taylor", "dopri5", "dop853", "radau"])
@pytest.mark.parametrize("text", ["sqrt(1 - t)", "sqrt(w - 1 + t/4)", "log(0.5 - abs(t - 1))"])
def test_a_root_that_ends_has_no_value(method: str, text: str) -> None:
    assert hsdsl.loads(MODEL.format(text, "3")).simulate(method=method).stop.reason == "not_finite"
