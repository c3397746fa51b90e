"""Units whose inputs a tool drives make the transitions of runs with the same inputs, whatever its habits are."""

from __future__ import annotations

import math
import random
from bisect import bisect_left, bisect_right
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import pairwise
from string import Template
from typing import Any

import numpy as np
import pytest
from shipped import MODELS as SHIPPED

import hsdsl
from hsdsl.export import files_of, source_of

fmpy = pytest.importorskip("fmpy", reason="FMPy is not installed: pip install 'hsdsl[export]'")
from export.importers import ENDS, EVENTS, Habit, Importer, Signal  # noqa: E402

pytestmark = pytest.mark.exports

UNTIL = 2.9
# each counts its transitions in n
MODELS = {
    "ball in wind": """
modes:
  fly: {flow: {h: v, v: u - 9.81, n: 0}, transitions: [{when: h <= 0, to: fly, reset: {v: -0.8*v, n: n + 1}}]}
initial: {mode: fly, h: 2, v: 0, n: 0}
""",
    "oscillator with a stop": """
modes:
  a: {flow: {x: v, v: 20*u - 0.1*v - 6.25*x, n: 0}, transitions: [{when: x >= 1, to: a, reset: {v: -0.9*v, n: n + 1}}]}
initial: {mode: a, x: 0, v: 1, n: 0}
""",
    "ball on a moving table": """
modes:
  fly: {flow: {h: v, v: -9.81, n: 0}, transitions: [{when: h <= 0.1*u, to: fly, reset: {v: 1 - 0.8*v, n: n + 1}}]}
initial: {mode: fly, h: 1, v: 0, n: 0}
""",
    "thermostat": """
modes:
  on: {flow: {x: 3 - x + u, n: 0}, transitions: [{when: x >= 2 + u/2, to: off, reset: {n: n + 1}}]}
  off: {flow: {x: u - x, n: 0}, transitions: [{when: x <= 1 + u/2, to: on, reset: {n: n + 1}}]}
initial: {mode: on, x: 0, n: 0}
""",
    "pulse width": """
modes:
  high: {flow: {c: 1, y: 1 - y, n: 0}, transitions: [{when: c >= 0.1*(2 + u), to: low, reset: {n: n + 1}}]}
  low: {flow: {c: 1, y: -y, n: 0}, transitions: [{when: c >= 0.31, to: high, reset: {c: 0, n: n + 1}}]}
initial: {mode: high, c: 0, y: 0, n: 0}
""",
    "levels of the input alone": """
modes:
  low: {flow: {x: -x, n: 0}, transitions: [{when: u >= 0.55, to: high, reset: {n: n + 1}}]}
  high: {flow: {x: 1 - x, n: 0}, transitions: [{when: u <= -0.35, to: low, reset: {n: n + 1}}]}
initial: {mode: low, x: 0, n: 0}
""",
    "thresholds that resets move": """
modes:
  a: {flow: {x: 0, y: u, n: 0}, transitions: [{when: u >= x, to: a, reset: {x: x + 0.3, n: n + 1}}]}
initial: {mode: a, x: 0.15, y: 0, n: 0}
""",
    "event": """
modes:
  a: {flow: {x: u - x, n: 0}, transitions: [{event: x >= 0.3, reset: {n: n + 1}}]}
initial: {mode: a, x: 0, n: 0}
""",
    "condition, and a threshold that the input moves": """
modes:
  a:
    flow: {x: 1, y: 0, n: 0}
    transitions: [{when: x + u >= 1, if: x > -9, to: a, reset: {x: x - 1, y: y + 1, n: n + 1}}]
initial: {mode: a, x: 0, y: 0, n: 0}
""",
    "condition of a state": """
modes:
  a: {flow: {x: v, v: 4*u - 9*x, n: 0}, transitions: [{when: x >= 0.45, if: v > 0.5, to: a, reset: {v: -v, n: n + 1}}]}
initial: {mode: a, x: 0, v: 3, n: 0}
""",
}
LEVELS, STEPS = (0.2, 0.9, -0.7, 0.6), (0.7, 1.3, 2.1)


def stepped(times: tuple[float, ...], levels: tuple[float, ...]) -> Signal:
    return lambda t, behind: levels[(bisect_right if behind else bisect_left)(times, t)]


# what the run has for the input, the same for the importing tool, and where it jumps
INPUTS: dict[str, tuple[str, Signal, tuple[float, ...]]] = {
    "constant": ("0.4", lambda t, behind: 0.4, ()),
    "smooth": ("sin(3*t)", lambda t, behind: math.sin(3 * t), ()),
    "stepped": (f"{{times: [0, 0.7, 1.3, 2.1], values: {list(LEVELS)}, hold: zero}}", stepped(STEPS, LEVELS), STEPS),
}
# the input's changes are jumps for one of these tools, and its jumps smooth for others
OTHERWISE = {
    ("condition, and a threshold that the input moves", "smooth"): {"in event mode"},
    ("condition, and a threshold that the input moves", "stepped"): {
        "jumps as if they were smooth",
        "Euler, jumps as if they were smooth",
    },
}
# with how far a transition may be off; only a tool that sets inputs at every evaluation sees the whole of a smooth one
HABITS = {
    "at every evaluation": (Habit(), 1e-6),
    "in event mode": (Habit(sets=EVENTS), 0.02),
    "at ends of steps": (Habit(sets=ENDS, completes=True), 0.02),
    "Euler": (Habit(euler=True, locates=False, step=1e-3), 0.02),
    "Euler, at ends of steps": (Habit(sets=ENDS, euler=True, locates=False, step=1e-3), 0.02),
    "jumps as if they were smooth": (Habit(jumps=False), 0.02),
    "Euler, jumps as if they were smooth": (Habit(jumps=False, euler=True, locates=False, step=1e-3), 0.02),
}


def text_of(body: str, given: str, until: float = UNTIL) -> str:
    return (
        f"hsdsl: 1\ninputs: {{u: {given}}}\n{body}experiment: {{until: {until}, scheme: located, tolerance: 1e-10}}\n"
    )


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    """Units by text and version, each made once; the file's own input is zero."""
    known: dict[Any, str] = {}

    def make(text: str, version: int) -> str:
        if (text, version) not in known:
            ((name, content),) = files_of(source_of(hsdsl.loads(text), {}), f"fmi{version}").items()
            path = tmp_path_factory.mktemp("unit") / name
            path.write_bytes(content)
            known[text, version] = str(path)
        return known[text, version]

    yield make


def test_a_ball_that_counts_comes_to_rest(made: Any) -> None:
    """What it counts with has no limit, and is left as it is."""
    body = MODELS["ball in wind"].replace("-0.8*v", "-0.4*v")
    tool = Importer(made(text_of(body, "0"), 2), {"u": INPUTS["smooth"][1]}, Habit())
    tool.go_to(UNTIL)
    assert not tool.ended
    assert (tool.value("h"), tool.value("v")) == pytest.approx((0, 0), abs=1e-12)
    assert 5 < tool.value("n") < 20


def transitions_of(text: str) -> list[float]:
    """When a run counts."""
    run = hsdsl.loads(text).simulate()
    times = [made.time for made in run.transitions if "re-arms" not in made.edge]
    assert len(times) == run.final.state["n"]
    return times


@pytest.mark.parametrize(
    ("name", "version"),
    [
        pytest.param(name, version, marks=[] if k % 2 == i and k < 5 else pytest.mark.slow)
        for k, name in enumerate(MODELS)
        for i, version in enumerate((2, 3))  # one version of each in turn
    ],
)
@pytest.mark.parametrize("given", INPUTS)
def test_driven_units_make_the_transitions_of_runs(name: str, version: int, given: str, made: Any) -> None:
    body, (text, signal, jumps) = MODELS[name], INPUTS[given]
    exact = transitions_of(text_of(body, text))
    for label, (habit, error) in HABITS.items():
        if label in OTHERWISE.get((name, given), ()):
            continue
        tool = Importer(made(text_of(body, "0"), version), {"u": signal}, habit, jumps)
        tool.go_to(UNTIL)
        close = 1e-6 if not jumps and error < 1 and label.startswith("jumps") else error
        assert tool.counted("n") == pytest.approx([time for time in exact if time > 0], abs=close), label
        assert tool.value("n") == len(exact)


def test_a_ball_that_a_table_outruns_does_not_fall_through_it(made: Any) -> None:
    """Its reset keeps the ball on a table that comes up: the guard is met again and again, and the unit ends."""
    body = MODELS["ball on a moving table"].replace("v: 1 - 0.8*v", "v: -5").replace("0.1*u", "u")
    for habit in (Habit(), Habit(euler=True, locates=False)):
        tool = Importer(made(text_of(body, "-100"), 3), {"u": INPUTS["smooth"][1]}, habit)
        tool.go_to(UNTIL)
        assert tool.ended
        assert tool.rows[-1][1][0] > math.sin(3 * tool.time) - 16 * 0.04  # a step is not longer


@pytest.mark.parametrize("given", INPUTS)
def test_co_simulation_holds_inputs_between_communication_points(given: str, made: Any) -> None:
    """As a run does whose input has a sample at each of them, to the last bit that steps leave."""
    points, name = np.linspace(0, UNTIL, 30), "oscillator with a stop"
    signal = INPUTS[given][1]
    values = [signal(time, True) for time in points[:-1]]
    samples = f"{{times: {[float(t) for t in points[:-1]]}, values: {values}, hold: zero}}"
    run = hsdsl.loads(text_of(MODELS[name], samples)).simulate()
    signals = np.array([(t, signal(t, True)) for t in points], dtype=[("time", float), ("u", float)])
    description: Any = fmpy.read_model_description(path := made(text_of(MODELS[name], "0"), 2))
    reference = {v.name: v.valueReference for v in description.modelVariables}
    unit: Any = fmpy.instantiate_fmu(fmpy.extract(path), description, "CoSimulation")
    unit.setupExperiment(startTime=0.0)
    unit.enterInitializationMode()
    unit.setReal([reference["u"]], [signals["u"][0]])
    unit.exitInitializationMode()
    for (start, value), end in zip(signals[:-1], points[1:], strict=True):
        unit.setReal([reference["u"]], [value])
        unit.doStep(currentCommunicationPoint=start, communicationStepSize=end - start)
    end = dict(zip(("x", "v", "n"), unit.getReal([reference[name] for name in ("x", "v", "n")]), strict=True))
    assert end == pytest.approx(run.final.state, abs=1e-8)


# small models that an input drives
RANDOM = [
    """
modes:
  fly: {flow: {h: v, v: $a*u - 9.81, n: 0}, transitions: [{when: h <= 0, to: fly, reset: {v: -$b*v, n: n + 1}}]}
initial: {mode: fly, h: 1 + $b, v: $a - 1, n: 0}
""",
    """
modes:
  a:
    flow: {x: v, v: 10*$a*u - 0.2*v - 6*x, n: 0}
    transitions: [{when: x >= $b, to: a, reset: {v: -$b*v, n: n + 1}}]
initial: {mode: a, x: 0, v: $a, n: 0}
""",
    """
modes:
  on: {flow: {x: 2 + $a - x + u, n: 0}, transitions: [{when: x >= 1 + $b + u/4, to: off, reset: {n: n + 1}}]}
  off: {flow: {x: u - $a*x, n: 0}, transitions: [{when: x <= $b + u/4, to: on, reset: {n: n + 1}}]}
initial: {mode: on, x: 0, n: 0}
""",
    """
modes:
  on: {flow: {c: 1, y: $a - y, n: 0}, transitions: [{when: c >= $b*(0.4 + u/8), to: off, reset: {n: n + 1}}]}
  off: {flow: {c: 1, y: u - y, n: 0}, transitions: [{when: c >= $b, to: on, reset: {c: 0, n: n + 1}}]}
initial: {mode: on, c: 0, y: 0, n: 0}
""",
    """
modes:
  fly: {flow: {h: v, v: -9.81, n: 0}, transitions: [{when: h <= u/10, to: fly, reset: {v: $a - $b*v, n: n + 1}}]}
initial: {mode: fly, h: 1 + $a, v: 0, n: 0}
""",
]


@dataclass(frozen=True)
class Driven:
    """A random unit with its input: as text that is shifted in time, and as FMPy takes it."""

    body: str
    given: Callable[[float], str]
    signals: np.ndarray[Any, Any]

    @classmethod
    def drawn(cls, draw: random.Random) -> Driven:
        """A model with a smooth or a stepped input."""
        values = {"a": str(draw.uniform(0.5, 2)), "b": str(draw.uniform(0.3, 0.9))}
        body = Template(draw.choice(RANDOM)).substitute(values)
        if draw.random() < 0.5:
            a, w, f = draw.uniform(0.3, 1.5), draw.uniform(0.5, 5), draw.uniform(0, 6)
            rows = [(t, a * math.sin(w * t + f)) for t in np.linspace(0, UNTIL, 5801)]
            return cls(body, lambda shift: f"{a}*sin({w}*(t + {shift}) + {f})", cls._signals(rows))
        jumps = sorted(round(draw.uniform(0.1, UNTIL - 0.1), 3) for _ in range(3))
        levels = [round(draw.uniform(-1.5, 1.5), 2) for _ in range(4)]
        pairs = zip([0.0, *jumps, UNTIL], [*levels, levels[-1]], [levels[0], *levels], strict=True)
        rows = [(time, value) for time, behind, before in pairs for value in (before, behind)][1:-1]
        times = [0.0, *jumps]
        return cls(
            body,
            lambda shift: f"{{times: {[t + shift for t in times]}, values: {levels}, hold: zero}}",
            cls._signals(rows),
        )

    @staticmethod
    def _signals(rows: list[tuple[float, float]]) -> np.ndarray[Any, Any]:
        return np.array(rows, dtype=[("time", float), ("u", float)])

    def transitions(self, shift: float = 0.0) -> list[float]:
        """Those of the run."""
        run = hsdsl.loads(text_of(self.body, self.given(shift))).simulate()
        return [made.time for made in run.transitions] if run.stop.reason == "until" else []

    def is_well_conditioned(self) -> bool:
        """Whether inputs that are a little late make the same transitions, not far away, and none come fast."""
        exact = self.transitions()
        if not exact or any(after - before < 0.05 for before, after in pairwise([*exact, UNTIL])):
            return False
        return all(agree(exact, self.transitions(shift), 0.015) for shift in (-4e-3, 4e-3))


def agree(some: list[float], others: list[float], error: float) -> bool:
    return len(some) == len(others) and all(abs(x - y) <= error for x, y in zip(some, others, strict=True))


WIND = """
modes:
  fly: {flow: {h: v, v: u - 9.81, n: 0}, transitions: [{when: h <= 0, to: fly, reset: {v: -0.8*v, n: n + 1}}]}
initial: {mode: fly, h: 10, v: 0, n: 0}
"""


@pytest.mark.parametrize("version", [2, 3])
@pytest.mark.parametrize(
    ("solver", "error"),
    [({"solver": "CVode", "relative_tolerance": 1e-9}, 5e-3), ({"solver": "Euler", "step_size": 1e-3}, 5e-2)],
    ids=["CVode", "Euler"],
)
def test_a_ball_in_wind_under_fmpy_bounces_twice(solver: dict[str, Any], error: float, version: int, made: Any) -> None:
    times = np.linspace(0, 5, 5001)
    signals = np.array(list(zip(times, 0.5 * np.sin(3 * times), strict=True)), dtype=[("time", float), ("u", float)])
    result = fmpy.simulate_fmu(
        made(text_of(WIND, "0", 5), version),
        fmi_type="ModelExchange",
        stop_time=5,
        output_interval=1e-3,
        input=signals,
        **solver,
    )
    assert result["time"][1:][np.diff(result["n"]) != 0] == pytest.approx([1.4486, 3.7176], abs=error)
    assert (result["h"][-1], result["n"][-1]) == pytest.approx((3.322, 2), abs=error)


@pytest.mark.slow
@pytest.mark.parametrize("version", [2, 3])
@pytest.mark.parametrize(
    ("solver", "error"),
    [
        ({"solver": "CVode", "relative_tolerance": 1e-9, "output_interval": 0.01}, 5e-3),
        ({"solver": "Euler", "step_size": 1e-4, "output_interval": 1e-4}, 5e-3),
    ],
    ids=["CVode", "Euler"],
)
def test_the_oscillator_under_fmpy_makes_its_impacts(
    solver: dict[str, Any], error: float, version: int, made: Any
) -> None:
    """By the times of its closed form."""
    times = np.linspace(0, 20, 20001)
    signals = np.array(list(zip(times, 20 * np.cos(2.5 * times), strict=True)), dtype=[("time", float), ("u", float)])
    path = made((SHIPPED / "oscillator-with-stop-1.yaml").read_text(), version)
    result = fmpy.simulate_fmu(path, fmi_type="ModelExchange", stop_time=20, input=signals, **solver)
    same = (np.diff(result["time"]) == 0) & (np.diff(result["v"]) != 0)
    exact = [0.092169, 2.507267, 5.170141, 7.597236, 12.63847, 15.112572, 17.6689]
    assert result["time"][1:][same] == pytest.approx(exact, abs=error)


@pytest.mark.parametrize(
    "seed", [*range(4), *(pytest.param(seed, marks=pytest.mark.campaign) for seed in range(4, 100))]
)
def test_random_units_under_fmpy_make_the_transitions_of_runs(seed: int, made: Any) -> None:
    draw = random.Random(seed)
    driven = next(found for found in iter(lambda: Driven.drawn(draw), None) if found.is_well_conditioned())
    path = made(text_of(driven.body, "0"), 2 + seed % 2)
    for solver in (
        {"solver": "CVode", "relative_tolerance": 1e-7, "output_interval": UNTIL / 580},
        {"solver": "Euler", "step_size": UNTIL / 5800, "output_interval": UNTIL / 5800},
    ):
        result = fmpy.simulate_fmu(path, fmi_type="ModelExchange", stop_time=UNTIL, input=driven.signals, **solver)
        assert result["time"][-1] == pytest.approx(UNTIL)
        found = np.repeat(result["time"], np.diff(result["n"], prepend=0.0).astype(int))
        assert found == pytest.approx(driven.transitions(), abs=0.03), solver
