"""Fits: parameters found again from runs of a model, with and without noise."""

from __future__ import annotations

import json
import warnings
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.stats import chi2, linregress
from scipy.stats import t as student

import hsdsl
from hsdsl import UsageError
from hsdsl.analysis.plot import style
from hsdsl.interface.cli.verbs import obey

OSCILLATOR = "models/oscillator-with-stop-1.yaml"
TRUE = {"c": 0.9, "a": 0.05}
BALL = """
hsdsl: 1
parameters: {e: {value: 0.7, min: 0.1, max: 1}, g: 9.81}
modes: {fly: {flow: {h: v, v: -g}, transitions: [{name: bounce, when: h <= 0, to: fly, reset: {v: -e*v}}]}}
outputs: {energy: v**2/2 + g*h}
initial: {mode: fly, h: 1, v: 0}
experiment: {until: 1}
"""


@pytest.fixture(scope="module")
def model() -> Any:
    return hsdsl.load(OSCILLATOR)


@pytest.fixture(scope="module")
def samples(model: Any) -> dict[str, Any]:
    """200 samples over three impacts."""
    times = np.linspace(0, 6, 201)[1:]
    run = model.simulate(until=6, scheme="located", method="taylor", tolerance=1e-14)
    assert len(run.transitions) == 3
    table = run.sample(times)
    return {"t": times, "x": table["x"], "v": table["v"]}


@pytest.mark.parametrize("columns", [["x"], ["v"], ["x", "v"]])
@pytest.mark.parametrize("first", [{"c": 0.8, "a": 0.07}, {"c": 0.5, "a": 0.3}])
def test_noiseless(model: Any, samples: dict[str, Any], columns: list[str], first: dict[str, float]) -> None:
    data = {name: samples[name] for name in ("t", *columns)}
    found = model.fit(data, "c,a", parameters=first)
    assert found.success
    for name, value in TRUE.items():
        assert abs(found.values[name] - value) < 1e-10
    assert found.deviation < 1e-10


def test_a_number_alone_is_that_of_the_only_column(
    model: Any, samples: dict[str, Any], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    data = {name: samples[name] for name in ("t", "v")}
    by_name, alone = (model.fit(data, "c", sigma=sigma) for sigma in ({"v": 0.03}, 0.03))
    assert alone.covariance == pytest.approx(by_name.covariance)
    with pytest.raises(UsageError, match="a number for each of x, v"):
        model.fit(samples, "c", sigma=0.03)
    path = tmp_path / "v.csv"
    np.savetxt(path, np.column_stack([data["t"], data["v"]]), delimiter=",", header="t,v", comments="")
    words = ["fit", OSCILLATOR, str(path), "--wrt", "c", "--json", "--sigma"]
    found: list[Any] = []
    for given in ("0.03", "v=0.03"):
        obey([*words, given])
        found.append(json.loads(capsys.readouterr().out)["deviations"])
    assert found[0] == found[1]


def test_a_csv_file_with_gaps(model: Any, samples: dict[str, Any], tmp_path: Path) -> None:
    path = tmp_path / "data.csv"
    rows = zip(samples["t"], samples["x"], samples["v"], strict=True)
    lines = [
        f"{t!r},{x!r},{'' if k % 3 else repr(v)}" for k, (t, x, v) in enumerate(tuple(map(float, r)) for r in rows)
    ]
    path.write_text("\n".join(["t,x,v", *lines]) + "\n")
    found = model.fit(path, ["c", "initial.v"], parameters={"c": 0.8}, initial={"v": 30})
    assert abs(found.values["c"] - 0.9) < 1e-10
    assert abs(found.values["initial.v"] - 31.4) < 1e-8
    assert np.isnan(found.residuals["v"][1])


def inside(model: Any, data: dict[str, Any], noise: np.random.Generator, sigma: dict[str, float] | None) -> bool:
    """Whether the true values are in the region of 95 % of a fit to noisy samples."""
    noisy = {"t": data["t"], "x": data["x"] + 0.05 * noise.standard_normal(len(data["t"]))}
    found = model.fit(noisy, "c,a", sigma=sigma, parameters={"c": 0.88, "a": 0.055})
    off = np.array([found.values[name] - value for name, value in TRUE.items()])
    return bool(off @ np.linalg.solve(found.covariance, off) < 5.991)


def test_noise(model: Any, samples: dict[str, Any]) -> None:
    noise = np.random.default_rng(4)
    assert sum(inside(model, samples, noise, {"x": 0.05}) for _ in range(8)) >= 6


@pytest.mark.parametrize(
    ("sigma", "tries", "least"),
    [
        pytest.param(None, 40, 34, marks=pytest.mark.slow),
        pytest.param(None, 100, 89, marks=pytest.mark.campaign),
        pytest.param({"x": 0.05}, 100, 89, marks=pytest.mark.campaign),
    ],
)
def test_covariance_holds(
    model: Any, samples: dict[str, Any], sigma: dict[str, float] | None, tries: int, least: int
) -> None:
    """Of all tries 95 % are expected inside, and fewer than the least with a probability below 1 %."""
    noise = np.random.default_rng(2026)
    assert sum(inside(model, samples, noise, sigma) for _ in range(tries)) >= least


def test_bounds_of_the_file() -> None:
    model = hsdsl.loads(BALL)
    times = np.linspace(0, 1.4, 50)
    energy = np.where(times < np.sqrt(2 / 9.81), 9.81, 9.81 * 1.2)  # it gains energy, which e <= 1 forbids
    found = model.fit({"t": times, "energy": energy}, "e")
    assert found.values["e"] == pytest.approx(1)
    assert found.at_bound == ("e",) and "at its bound" in found.summary
    times = np.linspace(0, 1, 50)  # before the second bounce
    inside = model.fit({"t": times, "energy": np.where(times < np.sqrt(2 / 9.81), 9.81, 9.81 * 0.7**2)}, "e")
    assert inside.values["e"] == pytest.approx(0.7) and inside.at_bound == ()


@pytest.mark.parametrize("unit", [3e-14, 1.0, 2e9])
def test_units_of_time_change_no_fit(unit: float) -> None:
    """A decay and a first state of zero, in units of time and of the state that differ by the same factor."""
    text = f"""
hsdsl: 1
parameters: {{k: {1.7 / unit}, u: {unit}}}
modes: {{m: {{flow: {{x: 1 - k*x}}}}}}
initial: {{mode: m, x: 0}}
experiment: {{until: 4*u}}
"""
    times = np.linspace(0, 4, 9) * unit
    data = {"t": times, "x": unit * (0.8 + (0.3 - 0.8) * np.exp(-times / (0.8 * unit)))}
    found = hsdsl.loads(text).fit(data, "k,initial.x")
    assert found.values == pytest.approx({"k": 1.25 / unit, "initial.x": 0.3 * unit}, rel=1e-9)


LINE = "hsdsl: 1\nparameters: {a: {value: 1, max: 3}}\nmodes: {m: {flow: {x: a}}}\ninitial: {mode: m, x: 0}\n"
DECAY = "hsdsl: 1\nparameters: {k: {value: 1, min: 0}}\nmodes: {m: {flow: {x: -k*x}}}\ninitial: {mode: m, x: 1}\n"


def test_intervals_of_a_line_are_those_of_student() -> None:
    """Here the sum of squares is a parabola, and the profile gives the intervals of linear regression."""
    t = np.linspace(0.5, 4, 8)
    x = 2 * t + 1 + 0.1 * np.array([1, -1, 2, 0, -2, 1, 0.5, -1.5])
    model = hsdsl.loads(LINE + "experiment: {until: 4}\n")
    found = model.fit({"t": t, "x": x}, "a,initial.x", intervals=0.9)
    by = linregress(t, x)
    chance = student.ppf(0.95, len(t) - 2)
    for name, value, deviation in (("a", by.slope, by.stderr), ("initial.x", by.intercept, by.intercept_stderr)):
        ends = value - chance * deviation, value + chance * deviation
        assert found.intervals[name] == pytest.approx(ends, rel=1e-4)
    assert "; 90 %: " in found.summary and found.as_json()["intervals"]["a"] == [*found.intervals["a"]]
    narrow = hsdsl.loads(LINE.replace("max: 3", f"max: {by.slope + by.stderr / 2}") + "experiment: {until: 4}\n")
    low, high = narrow.fit({"t": t, "x": x}, "a,initial.x", intervals=0.9).intervals["a"]
    assert high == by.slope + by.stderr / 2 and low == pytest.approx(by.slope - chance * by.stderr, rel=1e-4)


def test_intervals_follow_the_sum_of_squares() -> None:
    """Of a decay measured late the sum ends below: any faster decay leaves nothing either."""
    t, sigma = np.array([3.0, 4.0, 5.0]), 0.02
    x = np.array([0.03, 0.01, 0.02])

    def total(k: float) -> float:
        return float(np.sum((np.exp(-k * t) - x) ** 2)) / sigma**2

    model = hsdsl.loads(DECAY + "experiment: {until: 5}\n")
    found = model.fit({"t": t, "x": x}, "k", sigma=sigma, intervals=0.95)
    best = found.values["k"]
    rise = total(best) + chi2.ppf(0.95, 1)
    low, high = found.intervals["k"]
    assert low == pytest.approx(brentq(lambda k: total(k) - rise, 0.1, best), rel=1e-3)
    assert high == np.inf and total(1e3) < rise and "to unbounded" in found.summary
    assert best - low < 0.9 * 1.96 * found.deviations["k"]


def test_intervals_that_cannot_be_are_refused() -> None:
    model, data = hsdsl.loads(DECAY + "experiment: {until: 5}\n"), {"t": [1.0], "x": [0.4]}
    for level, sentence in ((1.0, "a level between 0 and 1, got 1"), (0.9, "leave nothing over to judge by")):
        with pytest.raises(UsageError, match=sentence):
            model.fit(data, "k", intervals=level)
    assert model.fit(data, "k", intervals=0.9, sigma=0.1).intervals["k"][0] == pytest.approx(
        -np.log(0.4 + 0.1 * chi2.ppf(0.9, 1) ** 0.5), rel=1e-3
    )


def test_what_measurements_do_not_determine() -> None:
    model = hsdsl.loads(BALL)
    times = np.linspace(0, 0.4, 20)  # before the first bounce
    found = model.fit({"t": times, "h": 1 - 9.0 * times**2 / 2}, "e,g")
    assert found.values["g"] == pytest.approx(9.0)
    assert np.isinf(found.deviations["e"]) and found.deviations["g"] < 1e-6


def test_a_measurement_at_a_transition_is_named() -> None:
    model = hsdsl.loads(BALL)
    times = np.array([0.1, 0.2, 0.3, np.sqrt(2 / 9.81), 0.6, 0.7])
    run = model.simulate().sample(times)
    found = model.fit({"t": times, "h": run["h"] + 0.01 * np.cos(40 * times)}, "e,g")
    assert any("bounce" in reason for reason in found.nonsmooth)


@pytest.mark.parametrize("columns", ["v", "hv"])
@pytest.mark.parametrize("first", [(0.78, 1.36), (0.71, 1.45), (0.74, 1.5)])
def test_transitions_pass_measurements(columns: str, first: tuple[float, float]) -> None:
    """With other values bounces are on the wrong sides of measured speeds, which no derivative shows."""
    model, times = hsdsl.loads(BALL), np.linspace(0, 2.3, 47)[1:]
    run = model.simulate(until=2.3, parameters={"e": 0.75}, initial={"h": 1.4}, tolerance=1e-13).sample(times)
    start = {"parameters": {"e": first[0]}, "initial": {"h": first[1]}}
    found = model.fit({"t": times, **{name: run[name] for name in columns}}, "e,initial.h", **start)
    assert [*found.values.values()] == pytest.approx([0.75, 1.4], abs=1e-9)
    assert not found.nonsmooth


def test_a_measurement_on_the_wrong_side_is_named() -> None:
    """The speed at 0.44 s is that of after a bounce, which the heights have at 0.4515 s."""
    times = np.linspace(0.04, 0.84, 21)
    run = hsdsl.loads(BALL).simulate(tolerance=1e-13).sample(times)
    wrong = run["v"].copy()
    wrong[10] = 0.7 * 9.81 * 0.4515
    found = hsdsl.loads(BALL).fit({"t": times, "h": run["h"], "v": wrong}, "e,g,initial.h", sigma={"h": 1e-4, "v": 1})
    assert any("t = 0.44 agrees better with the other side of bounce" in reason for reason in found.nonsmooth)


DOSED = """
hsdsl: 1
parameters: {k: 0.4, dose: 3}
modes: {m: {flow: {A: -k*A}, transitions: [{name: take, event: t >= 1.5, reset: {A: A + dose}}]}}
initial: {mode: m, A: 2}
experiment: {until: 4}
"""


def test_a_measurement_at_a_time_that_no_value_moves_is_not_named() -> None:
    model = hsdsl.loads(DOSED)
    times = np.array([0.5, 1.0, 1.5, 2.0, 3.5])
    true = model.simulate(parameters={"k": 0.7}, tolerance=1e-12).sample(times)["A"]
    noisy = true * np.array([1.01, 0.98, 1.0, 1.02, 0.99])
    fit = model.fit({"Time": times, "A": noisy}, wrt="k")
    assert fit.nonsmooth == ()
    assert fit.values["k"] == pytest.approx(0.7, abs=0.05)
    assert repr(fit).startswith("<Fit of ") and f"k {fit.values['k']:.6g}" in repr(fit)
    shown = fit._repr_html_()
    assert "5 measurements" in shown and "<img" in shown
    assert replace(fit, units={"A": "mg"})._repr_html_() != shown  # the picture has the unit


ENDING = """
hsdsl: 1
parameters: {p: 0.9}
modes:
  grow: {flow: {x: p}, transitions: [{when: x >= 1, to: done}]}
  done: {final: true}
initial: {mode: grow, x: 0}
experiment: {until: 2}
"""


def test_a_run_that_ends_early_is_worse_than_any_measurement(monkeypatch: pytest.MonkeyPatch) -> None:
    """At p = 1.8 the first measurement is met, and the run has ended before the second."""
    data = {"t": [0.5, 1.0], "x": [0.9, 0.95]}
    found = hsdsl.loads(ENDING).fit(data, "p", sigma={"x": 1e-5})
    assert found.values["p"] == pytest.approx(1, abs=1e-6)  # the nearest to 0.9*2 at which the run does not end
    monkeypatch.setattr("hsdsl.analysis.fitting.least_squares.TOO_FAR", 1e-9)
    ended = hsdsl.loads(ENDING).fit(data, "p", sigma={"x": 1e-5})
    assert not ended.success
    assert "before the last measurement" in ended.message
    assert np.isnan(ended.residuals["x"]).tolist() == [False, True]


def test_progress(model: Any, samples: dict[str, Any]) -> None:
    answer: list[float] = []
    model.fit({"t": samples["t"], "x": samples["x"]}, "c", progress=lambda runs, values, total: answer.append(total))
    assert answer and answer[-1] < 1e-10


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("t,y\n1,2\n", "no state or output 'y'"),
        ("x,v\n1,2\n", "expected a column t or time"),
        ("t;x\n1;2\n", "separate columns by commas"),
        ("t,x\n1,BLQ\n", "leave the cell empty if nothing was measured"),
        ("t,time,x\n1,2,3\n", "expected a column t or time with the times, got both t and time"),
        ("t,x\n1,a\n", "column x, row 2, got 'a'"),
        ("t,x\n1\n", "row 2 has 1 cells"),
        ("t,x\n-1,2\n", "not negative"),
        ("t,x\n1,\n", "nothing was measured"),
        ("", "is empty"),
        ("t,x\n1,2\n", "cannot determine"),
        ("t,x\n0,1\n1,inf\n", "a finite number in column x, row 3, got 'inf'"),
        ("t,x\n0,1\ninf,1\n", "a finite number in column t, row 3, got 'inf'"),
        ("t,x\nnan,1\n1,1\n", "not negative, got nan"),
        ("t,x, x\n0,1,2\n", "expected a column once, got 'x' twice"),
    ],
)
def test_bad_data(text: str, sentence: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "data.csv"
    path.write_text(text)
    assert obey(["fit", OSCILLATOR, str(path), "--wrt", "c,a"]) == 2
    assert sentence in capsys.readouterr().err


def test_numbers_without_squares() -> None:
    data = {"t": [0.1, 0.7], "h": [1e308, -1e308]}
    with pytest.raises(UsageError, match="column h are too large for its standard deviation"):
        hsdsl.loads(BALL).fit(data, "e", sigma=1e-3)
    with warnings.catch_warnings(action="error"):
        found = hsdsl.loads(BALL).fit(data, "e,g")
    assert np.isinf([*found.deviations.values()]).all()


def test_bad_calls(model: Any, samples: dict[str, Any]) -> None:
    for wrt, call, sentence in (
        ("C", {}, "no parameter"),
        ("c", {"sigma": {"v": 1}}, "no measurements of 'v'"),
        ("c", {"sigma": {"x": 1}, "weights": {"x": 1}}, "got both"),
        ("c", {"weights": {"x": -1}}, "positive"),
        ("c", {"until": 3}, "no argument 'until'"),
    ):
        with pytest.raises(UsageError, match=sentence):
            model.fit({"t": samples["t"], "x": samples["x"]}, wrt, **call)


def test_command(samples: dict[str, Any], tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path, picture = tmp_path / "data.csv", tmp_path / "fit.png"
    rows = zip(samples["t"].tolist(), samples["x"].tolist(), strict=True)
    path.write_text("t,x\n" + "".join(f"{t!r},{x!r}\n" for t, x in rows))
    words = ["fit", OSCILLATOR, str(path), "--wrt", "c,a", "--set", "c=0.8", "--json", "--plot", str(picture)]
    assert obey(words) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["values"]["c"] == pytest.approx(0.9, abs=1e-10)
    assert picture.stat().st_size > 1000


def test_a_picture_of_a_fit_has_a_title_units_and_no_gaps(tmp_path):
    text = """hsdsl: 1
title: A ball that was dropped
units: {t: s, h: m, v: m/s}
parameters: {e: 0.6}
modes: {fly: {flow: {h: v, v: -9.81}, transitions: [{when: h <= 0, to: fly, reset: {v: -e*v}}]}}
initial: {mode: fly, h: 2, v: 0}
experiment: {until: 2}
"""
    data = {"t": [0.2, 0.7, 1.1, 1.5], "h": [1.8, 0.25, 0.95, 0.6], "v": [-2, 4, 0, -3]}
    found = hsdsl.loads(text).fit(data, "e")
    assert found.units == {"t": "s", "h": "m", "v": "m/s"}
    seen = []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(style, "write_figure", lambda figure, *_: seen.append(figure))
        found.plot(tmp_path / "fit.png")
    (figure,) = seen
    height, speed = figure.axes
    assert figure.get_suptitle() == "A ball that was dropped" and "e = " in height.get_title("left")
    assert (height.get_ylabel(), speed.get_xlabel()) == ("h [m]", "time t [s]")
    assert not np.isnan(height.get_lines()[0].get_ydata()).any()  # the height does not jump
    assert np.isnan(speed.get_lines()[0].get_ydata()).any()


TWO_STATES = """hsdsl: 1
parameters: {rate: 1.3}
modes:
  fill: {flow: {x: rate}, transitions: [{when: x >= 2, to: heat, reset: {T: 5}}]}
  heat: {flow: {x: 0, T: 3*rate}, transitions: [{when: T >= 9, to: fill, reset: {x: 0}}]}
initial: {mode: fill, x: 0}
experiment: {until: 6}
"""


def test_measurements_of_a_state_where_the_run_lacks_it_are_refused() -> None:
    """It heats from 1.54 to 2.56."""
    model = hsdsl.loads(TWO_STATES)
    with pytest.raises(UsageError, match="has no T at any time at which it was measured"):
        model.fit({"t": [0.4, 1.1], "T": [5.5, 6]}, "rate")
    found = model.fit(
        {"t": [0.4, 1.8, 2.2], "T": [5.5, 6, 7.6], "x": [0.5, np.nan, np.nan]}, "rate", weights={"T": 1, "x": 1}
    )
    assert np.isnan(found.residuals["T"][0]) and np.isfinite(found.residuals["T"][1:]).all()
    assert "1 measurement," in model.fit({"t": [0.4], "x": [1]}, "rate").summary


SKIPPED = """hsdsl: 1
parameters: {k: {value: 0.9, min: 0.01, max: 1}}
modes:
  early:
    flow: {A: -k*A}
    transitions:
      - {name: take, event: t >= 1 and A <= 1.2, to: late, reset: {A: A + 3}}
      - {name: skip, event: t >= 1 and A > 1.2, to: late}
  late: {flow: {A: -k*A}}
initial: {mode: early, A: 2}
experiment: {until: 4}
"""
DOSES = np.array([0.25, 0.5, 1.5, 2.0, 3.0, 4.0])


def dosed(k: float) -> Any:
    """The dose is taken at t = 1 if 2 exp(-k) <= 1.2, from k = log(2/1.2) on."""
    return 2 * np.exp(-k * DOSES) + (DOSES > 1) * (3 * np.exp(-k * (DOSES - 1)) if k >= np.log(2 / 1.2) else 0)


def test_an_interval_ends_where_a_dose_is_skipped() -> None:
    noise = 0.8 * np.array([1, -1, 1, -1, 1, -1])
    found = hsdsl.loads(SKIPPED).fit({"t": DOSES, "A": dosed(0.7) + noise}, "k", intervals=0.95, sigma=0.8)
    assert found.intervals["k"][0] == pytest.approx(np.log(2 / 1.2), rel=1e-3)
    assert sum("interval of k ends at a jump of the sum: 0.51" in reason for reason in found.nonsmooth) == 1
    assert "`--starts`" in found.nonsmooth[0]


def test_starts_find_the_order_of_transitions(monkeypatch: pytest.MonkeyPatch) -> None:
    model, late = hsdsl.loads(SKIPPED), DOSES > 1
    data = {"t": DOSES[late], "A": dosed(0.3)[late]}
    assert model.fit(data, "k").values["k"] == pytest.approx(0.3, abs=1e-9)  # values around the first lead there
    monkeypatch.setattr("hsdsl.analysis.fitting.jumps.HALVINGS", 0)
    wrong, right = (model.fit(data, "k", starts=starts) for starts in (1, 6))
    assert wrong.deviation > 0.1 and right.values["k"] == pytest.approx(0.3, abs=1e-9)
    with pytest.raises(UsageError, match="starts: expected at least 1, got 0"):
        model.fit(data, "k", starts=0)


@pytest.mark.parametrize("first", [0.02, 0.2, 0.5, 0.52, 0.95])
@pytest.mark.parametrize("true", [0.3, 0.7])
def test_a_fit_finds_the_lower_side_of_a_jump(true: float, first: float) -> None:
    """The minimum is that of the exact sum on a grid, on whichever side of the jump the fit begins."""
    x = dosed(true) + 0.05 * np.array([1, -1, 0.5, -0.5, 1, -1])
    grid = np.linspace(0.01, 1, 100_001)
    best = min(grid, key=lambda k: float(np.sum((dosed(k) - x) ** 2)))
    found = hsdsl.loads(SKIPPED).fit({"t": DOSES, "A": x}, "k", parameters={"k": first})
    assert found.values["k"] == pytest.approx(best, abs=1e-5)
    assert "beside a jump" not in found.summary


def test_a_fit_that_ends_beside_a_jump_says_so() -> None:
    """Its decay is that of k = 0.45, where no dose would be taken: the sum falls down to the jump at 0.51."""
    x = 2 * np.exp(-0.45 * DOSES) + (DOSES > 1) * 3 * np.exp(-0.45 * (DOSES - 1))
    found = hsdsl.loads(SKIPPED).fit({"t": DOSES, "A": x}, "k")
    assert found.values["k"] == pytest.approx(np.log(2 / 1.2), abs=1e-9)
    assert "the fit ended beside a jump of the sum of squares" in found.summary


def profiled(k: float, x: Any) -> float:
    """The least sum of squares with k: the first amount is that of a linear fit, or at the end of its side."""
    fades, dose = np.exp(-k * DOSES), (DOSES > 1) * 3 * np.exp(-k * (DOSES - 1))
    sums: list[float] = []
    for taken in (True, False):
        rest = x - dose if taken else x
        amount = (min if taken else max)(float(rest @ fades / (fades @ fades)), 1.2 * np.exp(k))
        sums.append(float(np.sum((rest - amount * fades) ** 2)))
    return min(sums)


def test_a_fit_of_several_values_follows_the_sum_along_a_jump() -> None:
    """Measured with k = 0.45 and a first amount from which no dose would be taken, and with the dose."""
    noise = 0.02 * np.array([1, -1, 0.5, -0.5, 1, -1])
    x = 2.2 * np.exp(-0.45 * DOSES) + (DOSES > 1) * 3 * np.exp(-0.45 * (DOSES - 1)) + noise
    found = hsdsl.loads(SKIPPED).fit({"t": DOSES, "A": x}, "k,initial.A")
    grid = np.linspace(0.2, 0.9, 70_001)
    sums = np.array([profiled(k, x) for k in grid])
    assert found.values["k"] == pytest.approx(grid[int(np.argmin(sums))], abs=2e-5)
    assert found.values["initial.A"] == pytest.approx(1.2 * np.exp(found.values["k"]), rel=1e-8)
    assert float(np.sum(found.residuals["A"] ** 2)) == pytest.approx(float(sums.min()), rel=1e-6)
    assert "where the run makes skip at t = 1" in found.summary


def test_an_interval_follows_the_sum_along_a_jump() -> None:
    """The dose is taken while the first amount is at most 1.2 exp(k): the others follow that line to a low k."""
    x = dosed(0.53) + 0.1 * np.array([1, -1, 0.5, -0.5, 0.3, -0.3])
    found = hsdsl.loads(SKIPPED).fit({"t": DOSES, "A": x}, "k,initial.A", sigma=0.1, intervals=0.95)
    grid = np.linspace(0.2, 0.9, 70_001)
    sums = np.array([profiled(k, x) for k in grid])
    inside = sums <= sums.min() + 0.01 * chi2.ppf(0.95, 1)
    best = int(np.argmin(sums))
    assert found.values["k"] == pytest.approx(grid[best], abs=2e-5)
    low, high = (int(np.flatnonzero(~inside[side])[0]) for side in (slice(best, None, -1), slice(best, None)))
    assert found.intervals["k"] == pytest.approx((grid[best - low], grid[best + high]), abs=1e-4)
    assert grid[best - low] < np.log(2 / 1.2) and not any("interval of k" in reason for reason in found.nonsmooth)


@pytest.mark.parametrize(("sigma", "explained"), [(0.1, True), (0.03, False)])
def test_residuals_that_deviations_do_not_allow_are_warned_of(sigma: float, explained: bool) -> None:
    t = np.linspace(0.5, 4, 8)
    off = 0.1 * np.array([1, -1, 1, 0, -1, 1, 0.5, -1.5])
    model = hsdsl.loads(LINE + "experiment: {until: 4}\n")
    found = model.fit({"t": t, "x": 2 * t + off}, "a", sigma=sigma)
    left = 2 * t + off - t * float(t @ (2 * t + off) / (t @ t))
    assert found.chance == pytest.approx(chi2.sf(float(left @ left) / sigma**2, 7), rel=1e-6)
    assert found.as_json()["chance"] == found.chance and bool(found.as_json()["warnings"]) != explained
    assert ("the model does not explain the data: chi2 = " in found.summary) != explained
    assert "7 degrees of freedom" in found.summary or explained
    assert model.fit({"t": t, "x": 2 * t + off}, "a").chance is None


@pytest.mark.parametrize(("rate", "named"), [("p", False), ("1.5*p", True)])
def test_a_transition_that_changes_nothing_measured_is_not_named(rate: str, named: bool) -> None:
    """It passes x = 1 near the measurement at t = 1; the next mode grows at the same rate, or faster."""
    text = f"""
hsdsl: 1
parameters: {{p: 0.9}}
modes:
  before: {{flow: {{x: p}}, transitions: [{{name: passed, when: x >= 1, to: after}}]}}
  after: {{flow: {{x: {rate}}}}}
initial: {{mode: before, x: 0}}
experiment: {{until: 2}}
"""
    times = np.array([0.25, 0.5, 1.0, 1.25])
    x = times + (0.5 * (times - 1) * (times > 1) if named else 0) + 0.02 * np.array([1, -1, 1, -1])
    found = hsdsl.loads(text).fit({"t": times, "x": x}, "p", sigma=0.02)
    assert any("within its uncertainty" in reason for reason in found.nonsmooth) == named


@pytest.mark.parametrize("level", [None, 0.95])
def test_runs_that_overflow_end_no_fit(level: float | None) -> None:
    """A negative volume makes a growth that no number holds."""
    text = """hsdsl: 1
parameters: {V: 0.002}
modes: {m: {flow: {A: -A/V}}}
outputs: {c: A/V}
initial: {mode: m, A: 1}
experiment: {until: 4}
"""
    with warnings.catch_warnings(action="error"):
        found = hsdsl.loads(text).fit({"t": [1, 2, 4], "c": [0.2, 0.09, 0.05]}, "V", intervals=level, starts=3)
    assert np.isfinite(found.values["V"])


def test_values_without_a_run_end_no_fit() -> None:
    """The first state has no root for k < 0.5, where the sum of squares is still below its level."""
    model = hsdsl.loads(DECAY.replace("x: 1}", "x: sqrt(k - 0.5)}") + "experiment: {until: 1}\n")
    data = {"t": [0.1, 0.2, 0.3], "x": [0.2, -0.2, 0.3]}
    found = model.fit(data, "k", intervals=0.95, starts=4)
    assert found.intervals["k"][0] == pytest.approx(0.5, rel=1e-3)
    assert any("interval of k ends at a jump" in reason for reason in found.nonsmooth)
    with pytest.raises(UsageError, match="no finite value"):
        model.fit(data, "k", parameters={"k": 0.1})


def test_a_summary_has_the_digits_that_the_deviation_leaves() -> None:
    t, x = np.array([1.0, 2.0, 3.0, 4.0]), np.array([2.1, 3.9, 6.2, 7.9])
    found = hsdsl.loads(LINE + "experiment: {until: 4}\n").fit({"t": t, "x": x}, "a")
    slope, off = float(t @ x / (t @ t)), x - t * float(t @ x / (t @ t))
    deviation = float(off @ off / 3 / (t @ t)) ** 0.5
    assert f"  a  {slope:.3f} +- {deviation:.3f}" in found.summary and 0.01 < deviation < 0.1
    assert "\nconverged: the " in found.summary
    assert found.residuals["x"] == pytest.approx(off, abs=1e-6)  # measured minus run
    for given, line in (
        (123.4, "a  45680 +- 120"),
        (0.0996, "a  45678.00 +- 0.10"),
        (3e-9, "a  45678.0000000 +- 3.0e-09"),
    ):
        shown = replace(found, values={"a": 45678.0}, covariance=np.array([[given**2]]), at_bound=())
        assert line in shown.summary
