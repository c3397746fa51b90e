"""Derivatives of runs, against differences of runs of fifty digits and against exact ones."""

from __future__ import annotations

import json
from collections import Counter
from fractions import Fraction
from pathlib import Path
from typing import Any

import mpmath
import numpy as np
import pytest
import yaml
from engines import needs_compiler

import hsdsl
from hsdsl import UsageError
from hsdsl.analysis.store.npz import load
from hsdsl.base.numbers.arithmetic import multiprecision
from hsdsl.engine.preparation.values import with_parameters
from hsdsl.engine.scheme import newton, radau
from hsdsl.interface.cli.verbs import obey

MODELS = yaml.safe_load((Path(__file__).parent / "models.yaml").read_text())
DIGITS, STEP = 50, Fraction(1, 10**14)
APART = Fraction(1, 10**9)  # a step that takes tied transitions further apart than the tie of times
OSCILLATOR = "models/oscillator-with-stop-1.yaml"


def recorded(run: Any) -> dict[str, Any]:
    """What a run records, by name."""
    found = {f"time {made.index}": made.time for made in run.transitions}
    for made in run.transitions:
        found |= {f"after {made.index} {x}": v for x, v in made.after.items()}
    return found | {"end": run.final.time, **run.final.state, **run.final.outputs}


def derivatives(found: Any, by: str) -> dict[str, Any]:
    """The same of its derivatives."""
    rows = {f"time {made.index}": made.time for made in found.transitions}
    for made in found.transitions:
        rows |= {f"after {made.index} {x}": row for x, row in made.after.items()}
    rows |= {"end": found.final.time, **found.final.state, **found.final.outputs}
    return {name: row[by] for name, row in rows.items()}


def difference(model: Any, by: str, share: Fraction = STEP, **call: Any) -> dict[str, Any]:
    """Central differences of what a run records."""
    runs = []
    group, _, name = by.rpartition(".")
    kind = "initial" if group else "parameters"
    arithmetic = multiprecision(DIGITS)
    plain = model.simulate(precision=DIGITS, **call | {"until": 0})
    if group:
        value = plain.values[0][plain.arcs[0].states.index(name)]  # where it ends it may have made a transition
    else:
        values = with_parameters(model.pipeline.values(arithmetic), {})
        value = values.parameters[model.program.parameters.index(name)]
    size = abs(value)
    if not value and group:  # what the state comes to in the run
        run = model.simulate(scheme="located", **call | {"tolerance": None})
        size = arithmetic.constant(Fraction(float(np.nanmax(np.abs(run.sample(np.unique(run.times))[name])))))
    step = arithmetic.constant(share) * (size or 1)
    for way in (1, -1):
        moved = {kind: {name: value + way * step}}
        runs.append(recorded(model.simulate(precision=DIGITS, scheme="located", method="taylor", **moved, **call)))
    ahead, behind = runs
    assert ahead.keys() == behind.keys()
    return {k: (ahead[k] - behind[k]) / (2 * step) for k in ahead}


def assert_agree(found: Any, model: Any, **call: Any) -> None:
    for by in found.wrt:
        exact = difference(model, by, **call)
        mine = derivatives(found, by)
        assert mine.keys() == exact.keys()
        size = max(abs(float(v)) for v in exact.values())
        for name, value in exact.items():
            assert abs(mine[name] - float(value)) <= 1e-10 * max(abs(float(value)), 1e-3 * size), (by, name)


@pytest.mark.parametrize("name", MODELS)
def test_differences_of_fifty_digits(name: str) -> None:
    case = MODELS[name]
    model = hsdsl.loads(case["model"])
    assert_agree(model.sensitivity(case["wrt"]), model)


GALLERY = (
    "event-before-end", "grazing-hit", "grazing-miss", "kinked-input", "moving-guard", "narrow-hole",
    "restart-on-guard", "two-crossings", "zeno-ball",
)  # fmt: skip


ALL = [path.stem for path in sorted(Path("models/gallery").glob("*.yaml"))]


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=pytest.mark.slow if name in GALLERY else pytest.mark.campaign) for name in ALL]
)
def test_gallery(name: str) -> None:
    """Scenes whose derivatives exist, by all parameters; each number relative to the largest of its kind."""
    model = hsdsl.load(f"models/gallery/{name}.yaml")
    states = model.program.modes[model.program.initial_mode].states
    found = model.sensitivity([*model.program.parameters, *(f"initial.{x}" for x in states)])
    if found.starts:  # moved by these, executions start beyond a guard
        found = model.sensitivity([by for by in found.wrt if not model.sensitivity(by).starts])
    if not found.exists:
        assert name not in GALLERY and found.verdict.theorem != "holds"
        pytest.skip(f"its verdict is {found.verdict.theorem}: {found.reasons[0]}")
    for by in found.wrt:
        tied = any(made.alternatives for made in found.execution.transitions)
        exact, mine = difference(model, by, APART if tied else STEP, tolerance="1e-36"), derivatives(found, by)
        if tied:  # nearby they go in another order
            exact = {key: value for key, value in exact.items() if key.split()[0] not in ("time", "after")}
        sizes: dict[str, float] = {}
        for kind, value in ((key.split()[-1 if "after" in key else 0], value) for key, value in exact.items()):
            sizes[kind] = max(sizes.get(kind, 0.0), abs(float(value)))
        for key, value in exact.items():
            size = sizes[key.split()[-1 if "after" in key else 0]]
            assert abs(mine[key] - float(value)) <= 1e-10 * size + 1e-15, (by, key)


def test_an_end_at_a_wall() -> None:
    """Nothing goes on behind it, and its time moves."""
    text = "parameters: {{k: 1}}\nmodes: {{A: {{flow: {{x: k}}, domain: [x <= 2]{}}}}}"
    text = "hsdsl: 1\n" + text + "\ninitial: {{mode: A, x: 0}}\nexperiment: {{until: 5}}"
    hit = ", transitions: [{when: x >= 1, name: hit, to: A, reset: {x: x/2}, if: t < 1.2}]"
    found = hsdsl.loads(text.format(hit)).sensitivity("k")
    assert found.exists is False
    assert found.transitions[0].time["k"] == pytest.approx(-1)
    assert np.isnan([found.final.time["k"], found.final.state["x"]["k"]]).all()


@pytest.mark.parametrize("until", [3, 2e7])
def test_instants_are_told_apart_however_long_the_run_goes_on(until: float) -> None:
    text = f"""
hsdsl: 1
parameters: {{gap: 3e-7}}
modes:
  a: {{flow: {{x: 1}}, transitions: [{{when: x >= 2, to: b}}]}}
  b: {{flow: {{x: 3}}, transitions: [{{when: x >= 2 + gap, to: c}}]}}
  c: {{flow: {{x: 0}}}}
initial: {{mode: a, x: 0}}
experiment: {{until: {until}}}
"""
    found = hsdsl.loads(text).sensitivity("gap")
    assert found.exists and found.final.state["x"]["gap"] == 1
    assert found.transitions[1].time["gap"] == pytest.approx(1 / 3)


def test_a_start_on_a_guard() -> None:
    """Derivatives are those of the executions that start inside: below the floor a ball bounces without end."""
    model = hsdsl.load("models/gallery/event-at-start.yaml")
    found = model.sensitivity("initial.h")
    assert found.exists is False and "the run starts on the surface of bounce" in found.reasons[0]
    call = {"precision": DIGITS, "scheme": "located", "method": "taylor", "tolerance": "1e-36"}
    runs = [recorded(model.simulate(**call, initial={"h": h})) for h in ("1e-14", "0")]
    slopes = {key: (runs[0][key] - runs[1][key]) * 10**14 for key in runs[0]}
    assert derivatives(found, "initial.h") == pytest.approx({k: float(s) for k, s in slopes.items()}, abs=1e-12)


def test_implicit_steps_of_derivatives_share_factors(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of a linear flow one Jacobian serves each mode, and few factorings serve all steps, as without derivatives."""
    made = Counter[str]()
    for module, name in ((radau, "evaluate_jacobian"), (radau, "factor_dense"), (newton, "iterate")):
        plain = getattr(module, name)

        def noted(*given: Any, plain: Any = plain) -> Any:
            made[plain.__name__] += 1
            return plain(*given)

        monkeypatch.setattr(module, name, noted)
    call: dict[str, Any] = {"method": "radau", "tolerance": 1e-7, "until": 2, "engine": "python"}
    found = hsdsl.load("models/stiff-switch.yaml").sensitivity("fast,slow,initial.y2", **call)
    steps = len(found.execution.times)
    assert 0 < made["evaluate_jacobian"] <= 2 * len(found.execution.arcs)
    assert 0 < made["factor_dense"] < steps / 3
    assert 0 < made["iterate"] < 2 * steps


PRODUCTS = """
hsdsl: 1
parameters: {a: 0.7, b: 1.3}
modes:
  A:
    flow: {x: y*z*a - x, y: (x + b)*(z - y), z: x*y*x - z*b}
    transitions: [{name: up, when: x*(1 + 0.1*y) >= 0.4*a + 0.05*sin(9*t), to: B, reset: {x: -x*b, z: z + y*x}}]
  B:
    flow: {x: 1 - z*x, y: x*z - y*y*a, z: b*(x - y)*z}
    transitions: [{name: down, when: x >= 0.5, to: A, reset: {x: x - 0.6}}]
initial: {mode: A, x: 0.2, y: 1.1, z: 0.9}
experiment: {until: 1.5}
"""


@needs_compiler
@pytest.mark.parametrize("count", [1, 2, 3, 5])
@pytest.mark.parametrize("text", [PRODUCTS, Path("models/gallery/lorenz-section.yaml").read_text()])
def test_engines_agree_on_derivatives(text: str, count: int) -> None:
    """To the last bit: compiled series sum products that share a factor in one loop, two of them as a vector."""
    model = hsdsl.loads(text)
    wrt = [*model.program.parameters, "initial.z", "initial.x", "initial.y"][:count]
    python, compiled = (model.sensitivity(wrt, until=0.7, engine=engine).execution for engine in ("python", "c"))
    assert len(python.transitions) == len(compiled.transitions) > 0
    assert np.array_equal(python.values, compiled.values, equal_nan=True)
    assert np.array_equal(python.coefficients, compiled.coefficients, equal_nan=True)


@needs_compiler
def test_memory_of_wide_rows_is_used_again() -> None:
    """A run writes where the one before it wrote: fresh memory costs more than a short run."""
    model = hsdsl.load("models/gallery/lorenz-section.yaml")
    names = [*model.program.parameters, "initial.x", "initial.y", "initial.z"]
    runs = [model.sensitivity(names, until=1).setting.augmented.plan for _ in range(2)]
    assert runs[0] is runs[1] and runs[0] is not None
    workspace = runs[0].workspaces.take()
    chunk = workspace.chunks.table.values
    workspace.clear(0, 2**30)
    assert workspace.chunks.table.values == chunk


def test_oscillator() -> None:
    model = hsdsl.load(OSCILLATOR)
    found = model.simulate(until=3).sensitivity("c,a,omega,x_max,initial.x,initial.v")  # of a relaxed run
    assert found.exists
    assert_agree(found, model, until=3, tolerance="1e-36")


def test_fifty_digits_of_a_derivative() -> None:
    """Decay until 1/2 is reached, then from 2: everything is known."""
    text = (
        "hsdsl: 1\nparameters: {a: 1/3}\nmodes:\n  A: {flow: {x: -a*x}, transitions:"
        " [{when: x <= 1/2, to: A, name: half, reset: {x: 2}}]}\ninitial: {mode: A, x: 1}\nexperiment: {until: 3}\n"
    )
    found = hsdsl.loads(text).sensitivity("a", precision=50)
    with mpmath.workdps(60):
        a = mpmath.mpf(1) / 3
        assert abs(found.transitions[0].time["a"] + mpmath.log(2) / a**2) < mpmath.mpf("1e-38")
        value = 2 * mpmath.exp(-3 * a + mpmath.log(2))
        assert abs(found.final.state["x"]["a"] + 3 * value) < mpmath.mpf("1e-38")


def test_samples() -> None:
    model = hsdsl.loads(MODELS["end"]["model"])
    table = model.sensitivity("T", samples=5).sample()
    late, early = (model.simulate(samples=5, parameters={"T": 2 + d}) for d in (1e-5, -1e-5))
    for name in ("x", "v", "E"):
        slope = (late.sample(late.sample_times)[name] - early.sample(early.sample_times)[name]) / 2e-5
        assert np.allclose(table.slopes[name][:, 0], slope, rtol=1e-6, atol=1e-6)
    fixed = model.sensitivity("T").sample([0.5, 1])
    assert np.array_equal(fixed.slopes["x"], np.zeros((2, 1)))


RIGID = """
hsdsl: 1
parameters: {{m: 1, I: {inertia}, d: 0.5, e: 0.5, g: 9.81}}
let: {{at_left: vz - d*cos(th)*w, at_right: vz + d*cos(th)*w, mobility: 1/m + (d*cos(th))**2/I}}
modes:
  air:
    flow: {{z: vz, th: w, vz: -g, w: 0}}
    transitions:
      - when: z - d*sin(th) <= 0
        if: at_left < 0
        to: air
        name: left
        reset: {{vz: vz - (1 + e)*at_left/mobility/m, w: w + (1 + e)*at_left/mobility*d*cos(th)/I}}
      - when: z + d*sin(th) <= 0
        if: at_right < 0
        to: air
        name: right
        reset: {{vz: vz - (1 + e)*at_right/mobility/m, w: w - (1 + e)*at_right/mobility*d*cos(th)/I}}
initial: {{mode: air, z: (2**2 - 1)/(2*g), th: 0, vz: -1, w: 0}}
experiment: {{until: 0.25}}
"""
STATES = ("z", "th", "vz", "w")


def saltation(model: Any, first: str) -> np.ndarray[Any, Any]:
    """The saltation matrix of an order: the derivatives right after a tie, without the flow before it."""
    found = model.sensitivity([f"initial.{x}" for x in STATES])
    (tie,) = found.ties
    (order,) = (order for order in tie.orders if order.first == first)
    time = tie.time
    before = np.eye(4)
    before[0, 2] = before[1, 3] = time
    after = np.array([[order.slopes[x][f"initial.{y}"] for y in STATES] for x in STATES])
    return after @ np.linalg.inv(before)


def rigid(inertia: float) -> Any:
    """Two rigid feet that touch down together at a speed of 2."""
    return hsdsl.loads(RIGID.format(inertia=inertia))


def test_feet_whose_order_matters() -> None:
    model = rigid(0.5)
    found = model.sensitivity("initial.th,initial.z")
    assert found.exists is False
    assert "lead to different states" in found.reasons[0]
    assert np.isnan(found.final.state["z"]["initial.z"])
    left = [[-0.5, -0.25, 0, 0], [0.5, -0.25, 0, 0], [7.3575, 6.13125, -0.5, -0.25], [-2.4525, 11.03625, 0.5, -0.25]]
    turn = np.diag([1, -1, 1, -1])
    assert np.allclose(saltation(model, "left"), left, atol=1e-9)
    assert np.allclose(saltation(model, "right"), turn @ left @ turn, atol=1e-9)


def test_feet_whose_order_does_not_matter() -> None:
    found = rigid(0.25).sensitivity("initial.th,initial.z")
    assert not found.breaks
    expected = [[-0.5, 0, 0, 0], [0, -0.5, 0, 0], [7.3575, 0, -0.5, 0], [0, 7.3575, 0, -0.5]]
    assert np.allclose(saltation(rigid(0.25), "left"), expected, atol=1e-9)


QUADRANTS = """
hsdsl: 1
modes:
  A: {flow: {x: 1, y: 1}, transitions: [{when: x >= 0, to: X, name: x first}, {when: y >= 0, to: Y, name: y first}]}
  X: {flow: {x: 2, y: 0.5}, transitions: [{when: y >= 0, to: B}]}
  Y: {flow: {x: 3, y: 1}, transitions: [{when: x >= 0, to: B}]}
  B: {flow: {x: 1, y: 1}}
initial: {mode: A, x: -1, y: -1}
experiment: {until: 2}
"""


def test_one_sided_derivatives() -> None:
    model = hsdsl.loads(QUADRANTS)
    found = model.sensitivity("initial.x,initial.y")
    assert found.exists is False
    expected = {"x first": [[3, -2], [-1, 2]], "y first": [[1 / 3, 2 / 3], [0, 1]]}
    assert found.sides.keys() == expected.keys()
    for first, matrix in expected.items():
        state = found.sides[first].final.state
        assert np.allclose([[*state[x].values()] for x in "xy"], matrix, rtol=1e-12)
    for way, first in ((1e-7, "x first"), (-1e-7, "y first")):
        run = model.simulate(initial={"x": -1 + way})
        assert np.isclose((run.final.state["x"] - 1) / way, expected[first][0][0], rtol=1e-6)


TWO_GUARDS = """
hsdsl: 1
parameters: {{a: 2, b: 0.25}}
modes:
  A:
    flow: {{x: 1, y: b}}
    transitions:
      - {{when: x >= 2, to: B, name: one, reset: {{y: y + x - 2}}}}
      - {{when: {guard}, to: B, name: two, reset: {{y: {lands}}}}}
  B: {{flow: {{x: 1, y: 0}}}}
initial: {{mode: A, x: 0.5, y: 0}}
experiment: {{until: 3}}
"""


@pytest.mark.parametrize(
    ("guard", "lands", "wrt", "slopes"),
    [
        ("a*x >= 4", "y - 5*(x - 2)", "a", {"one": 0, "two": 5 - 0.25}),  # x of two is 4/a; y flows up to there
        ("a*x >= 4", "y - 5*(x - 2)", "initial.x", None),  # the guards part by a alone
        ("3*x >= 6", "y - 5*(x - 2)", "a", None),
        ("x + (y - 3/8)**2 >= 2", "y + 2*(y - 3/8)", "initial.y", {"one": 1, "two": 3}),
    ],
)
def test_guards_that_touch_are_two(guard: str, lands: str, wrt: str, slopes: dict[str, float] | None) -> None:
    """Guards with one gradient at a point, that nearby executions reach one by one: in proportion they are one."""
    found = hsdsl.loads(TWO_GUARDS.format(guard=guard, lands=lands)).sensitivity(wrt)
    assert [made.alternatives for made in found.execution.transitions] == [("two",)]
    assert found.exists is (slopes is None)
    assert {first: side.final.state["y"][wrt] for first, side in found.sides.items()} == pytest.approx(slopes or {})


DOSES = """
hsdsl: 1
parameters: {T: 2.25, k: 0.3, low: 1.5}
modes:
  before: {flow: {A: -k*A}, transitions: [{when: A <= low, to: after, name: falls}]}
  after: {flow: {A: -k*A}, transitions: [{name: dose, EVENT, reset: {A: A + 2}}]}
initial: {mode: before, A: 2}
experiment: {until: 5}
"""


@pytest.mark.parametrize(
    "event", ["event: t >= T", 'event: "t >= T and A < 1.2"', "event: t > T - 1, delay: 1, values: execution"]
)
def test_an_event_at_a_time_that_moves(event: str) -> None:
    """What an event remembers jumps with its condition, and that is no jump of an input."""
    model = hsdsl.loads(DOSES.replace("EVENT", event))
    assert model.simulate().verdict.theorem == "holds"
    found = model.sensitivity("T,k,initial.A")
    assert found.exists is True
    later = 2 * np.exp(-0.3 * (5 - 2.25))
    exact = {"T": 0.3 * later, "k": -10 * np.exp(-0.3 * 5) - (5 - 2.25) * later, "initial.A": np.exp(-0.3 * 5)}
    assert found.final.state["A"] == pytest.approx(exact, rel=1e-10)


GRAZING = """
hsdsl: 1
parameters: {s: 1}
modes:
  A: {flow: {x: v, v: -x}, transitions: [{when: x >= s, to: A, name: hit, reset: {v: -v}}]}
initial: {mode: A, x: 0, v: 1}
experiment: {until: 3}
"""


@pytest.mark.parametrize(
    ("level", "exists"), [("1", False), ("1 - 1e-12", False), ("1 - 1e-6", True), ("1 + 1e-6", True)]
)
def test_grazing(level: str, exists: bool | None) -> None:
    found = hsdsl.loads(GRAZING).sensitivity("s,initial.v", parameters={"s": level})
    assert found.exists is exists
    if not exists:
        assert found.reasons


def test_near_grazing() -> None:
    """It hits at asin(s): the derivative by s is 1/sqrt(1 - s**2)."""
    found = hsdsl.loads(GRAZING).sensitivity("s", parameters={"s": "1 - 1e-6"})
    s = 1 - 1e-6
    assert np.isclose(found.transitions[0].time["s"], 1 / np.sqrt(1 - s * s), rtol=1e-8)


def test_the_reason_of_a_stop_is_given_once() -> None:
    found = hsdsl.load("models/gallery/stick-slip.yaml").simulate(completion="none").sensitivity("belt")
    assert len(found.reasons) == 1 and "the run ends there (zeno)" in found.reasons[0]


def test_a_zeno_point_ends_derivatives() -> None:
    found = hsdsl.load("models/bouncing-ball.yaml").sensitivity("e", until=13)
    assert found.exists is False
    assert np.isnan(found.final.state["h"]["e"])


@pytest.mark.parametrize("written", [False, True])
def test_derivatives_through_sticking(written: bool) -> None:
    """Sliding ends where the flow is tangent to its surface, for all executions from nearby: derivatives exist."""
    model = hsdsl.load("models/gallery/stick-slip.yaml")
    if written:
        model = hsdsl.loads(model.completed())
        assert model.sliding.program.modes == model.program.modes  # what is completed is not completed again
    found = model.sensitivity("belt", until=6)
    assert found.exists is True and not found.reasons
    ends = [model.simulate(until=6, parameters={"belt": 0.1 + d}, tolerance=1e-13).final.state for d in (1e-6, -1e-6)]
    for name, row in found.final.state.items():
        assert row["belt"] == pytest.approx((ends[0][name] - ends[1][name]) / 2e-6, rel=1e-6)


STRIBECK = """
hsdsl: 1
parameters: {J: 1.7, m: 0.4, k: 2.3, c: 0.05, d: 0.3, drive: 1.9, static: 1.5, kinetic: 0.9, fast: 0.7}
let: {shaft: k*x + c*(u - v)}
modes:
  on:
    flow: {x: u - v, u: (drive - d*u - shaft)/J, v: (shaft - kinetic - (static - kinetic)*exp(-v/fast))/m}
    transitions: [{name: sticks, when: v <= 0, to: back}]
  back:
    flow: {x: u - v, u: (drive - d*u - shaft)/J, v: (shaft + kinetic + (static - kinetic)*exp(v/fast))/m}
    transitions: [{name: turns, when: v >= 0, to: on}]
initial: {mode: on, x: 0.2, u: 0.4, v: 0.1}
experiment: {until: 4, completion: auto}
"""


@pytest.mark.parametrize(("wrt", "value"), [("c", 0.05), ("fast", 0.7), ("static", 1.5), ("kinetic", 0.9), ("J", 1.7)])
def test_derivatives_through_the_end_of_sticking(wrt: str, value: float) -> None:
    """Executions from nearby land on the surface, too, where the flow is zero by cancellation."""
    model = hsdsl.loads(STRIBECK)
    found = model.sensitivity(wrt)
    assert found.exists is True and not found.reasons
    ends = [model.simulate(parameters={wrt: value + d}, tolerance=1e-13).final.state for d in (1e-6, -1e-6)]
    for x, row in found.final.state.items():
        assert row[wrt] == pytest.approx((ends[0][x] - ends[1][x]) / 2e-6, rel=1e-5, abs=1e-7)


LANDING = """
hsdsl: 1
parameters: {{a: 1}}
modes:
  A: {{flow: {{x: 1, y: 0}}, transitions: [{{when: x >= 1, to: B, name: go, reset: {{y: {lands}}}}}]}}
  B: {{flow: {{x: 1, y: 1 - x}}, transitions: [{{when: y >= 0, to: C, name: up}}]}}
  C: {{flow: {{x: 0, y: 0}}}}
initial: {{mode: A, x: 0, y: 0}}
experiment: {{until: 2}}
"""


@pytest.mark.parametrize(
    ("lands", "wrt", "exists"), [("a - 1", "a", False), ("y", "initial.y", False), ("0", "initial.x", True)]
)
def test_tangent_landings(lands: str, wrt: str, exists: bool) -> None:
    """Only where states near the guard land on the surface at the rate zero too is there a derivative."""
    assert hsdsl.loads(LANDING.format(lands=lands)).sensitivity(wrt).exists is exists


MOVING_JUMP = """
hsdsl: 1
parameters: {w: 2}
inputs: {u: sign(sin(w*t))}
modes: {A: {flow: {x: u}}}
initial: {mode: A, x: 0}
experiment: {until: 3}
"""


def test_moving_jumps_are_refused() -> None:
    with pytest.raises(UsageError, match="the times at which"):
        hsdsl.loads(MOVING_JUMP).sensitivity("w")
    assert hsdsl.loads(MOVING_JUMP).sensitivity("initial.x").final.state["x"] == {"initial.x": 1}


@pytest.mark.parametrize(
    ("wrt", "call", "sentence", "hint"),
    [
        ("C", {}, "no parameter or initial state 'C'", "'c'"),
        ("v", {}, "no parameter or initial state 'v'", "'initial.v'"),
        ("initial.mode", {}, "no parameter or initial state 'initial.mode'", "no number"),
        ("", {}, "got none", "for example"),
        (3, {}, "got 3", "for example"),
        ("c", {"step": 1e-3}, "no argument 'step'", ""),
        ("c", {"scheme": "relaxed"}, "no argument 'scheme'", ""),
        ("c", {"method": "midpoint"}, "got 'midpoint' with fixed steps", "dop853"),
        ("c", {"tolerence": 1e-3}, "no argument 'tolerence'", "tolerance"),
    ],
)
def test_bad_input(wrt: Any, call: dict[str, Any], sentence: str, hint: str) -> None:
    with pytest.raises(UsageError) as caught:
        hsdsl.load(OSCILLATOR).sensitivity(wrt, **call)
    assert sentence in str(caught.value)
    assert hint in (caught.value.hint or "")


def test_a_run_from_a_file_has_no_model(tmp_path: Path) -> None:
    run = hsdsl.load(OSCILLATOR).simulate(until=1)
    run.save(tmp_path / "run.npz")
    with pytest.raises(UsageError, match="no model"):
        load(tmp_path / "run.npz").sensitivity("c")


def test_command(capsys: pytest.CaptureFixture[str]) -> None:
    words = ["sensitivity", OSCILLATOR, "--wrt", "c,initial.v", "--until", "3"]
    assert obey(words) == 0
    text = capsys.readouterr().out
    assert "they exist: yes" in text and "d/d initial.v" in text
    assert obey([*words, "--at", "end"]) == 2
    assert "there is no part 'end'" in capsys.readouterr().err
    assert obey([*words, "--json", "--at", "outputs", "--set", "experiment.samples=4"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["samples"]["times"] == [0, 1, 2, 3]
    assert len(found["samples"]["values"]["x"]["c"]) == 4
    assert obey([*words[:3], "C"]) == 2
    assert "did you mean 'c'?" in capsys.readouterr().err
