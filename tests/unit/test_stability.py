"""Stability maps: known limits, outcomes of runs, axes, files, and processes that hang or die."""

from __future__ import annotations

import os
import signal
import time
from math import sqrt
from pathlib import Path

import numpy as np
import pytest

import hsdsl
from hsdsl.base.errors import UsageError
from hsdsl.base.processes import CRASHES, HANGS, Lost, in_processes
from hsdsl.engine.integrators import INTEGRATORS
from hsdsl.interface.chart.scene import Tool
from hsdsl.interface.chart.stability import as_csv, as_plain, as_text, read_axes, stability_map
from hsdsl.interface.chart.stability.cells import (
    Bench,
    eigenvalues,
    grows_on_the_axis,
    largest_step,
    stability_polynomial,
)
from hsdsl.interface.chart.stability.picture import plot_stability

GALLERY = Path(__file__).parents[2] / "models" / "gallery"
DECAY = """hsdsl: 1
parameters: {rate: 100}
modes:
  fast:
    flow: {x: -rate*x, y: 1}
    transitions: [{name: late, when: y >= 1, to: slow}]
  slow:
    flow: {x: -x, y: 0}
initial: {mode: fast, x: 1, y: 0}
experiment: {until: 2}
"""
SPIN = "hsdsl: 1\nmodes: {m: {flow: {x: v, v: -9*x}}}\ninitial: {mode: m, x: 1, v: 0}\nexperiment: {until: 5}\n"
PENDULUM = SPIN.replace("-9*x", "-sin(x)")
# the real ends of the stability regions, and those on the imaginary axis (Hairer and Wanner 1996, Sec. IV.2)
LIMITS = {"euler": (2, None), "midpoint": (2, None), "heun": (2, None), "rk4": (2.785293563405282, sqrt(8))}


@pytest.mark.parametrize("name", LIMITS)
def test_known_limits(name: str) -> None:
    real, imaginary = LIMITS[name]
    assert largest_step(name, np.array([-1 + 0j, 0j, 5 + 0j]), 1e-3, 1e3) == pytest.approx(real, rel=1e-9)
    found = largest_step(name, np.array([3j, -3j]), 1e-3, 1e3)
    assert found == (None if imaginary is None else pytest.approx(imaginary / 3, rel=1e-9))
    assert grows_on_the_axis(stability_polynomial(INTEGRATORS[name])) == (imaginary is None)


def test_no_limit_where_none_is_known() -> None:
    decays = np.array([-1 + 0j])
    assert largest_step("radau", decays, 1e-3, 1e3) is None
    assert largest_step("taylor", decays, 1e-3, 1e3) is None
    assert largest_step("euler", decays, 3, 1e3) is None  # all are unstable
    assert largest_step("euler", decays, 1e-3, 1) is None  # none is
    assert largest_step("euler", np.array([1 + 0j]), 1e-3, 1e3) is None  # nothing decays


@pytest.mark.parametrize("name", sorted(INTEGRATORS))
def test_the_polynomial_is_what_a_step_does(name: str) -> None:
    """A step of x'' = -9 x multiplies x + i v/3 by R(-3 i h)."""
    h = 0.4
    run = hsdsl.loads(SPIN).simulate(h, method=name, step=h)
    coefficients = [float(c) for c in stability_polynomial(INTEGRATORS[name])]
    factor = np.polyval(coefficients[::-1], -3j * h)
    assert complex(run.final.state["x"], run.final.state["v"] / 3) == pytest.approx(factor, rel=1e-13)


def test_eigenvalues_of_linear_flows() -> None:
    found = eigenvalues(hsdsl.loads(DECAY), {"parameters": {"rate": 70}})
    assert found is not None
    assert sorted(found.real) == [-70, -1, 0, 0]
    assert eigenvalues(hsdsl.loads(PENDULUM), {}) is None


def test_explicit_runs_blow_up_beyond_the_limit_and_only_there() -> None:
    model = hsdsl.loads(DECAY)
    found = stability_map(model, "h=1e-3:1:7,rate=10:1e3:3", methods=["euler", "rk4"], with_rho=False)
    for panel in found.panels:
        factor = 2 if panel.tool.method == "euler" else 2.785293563405282
        for j, rate in enumerate(found.y.values):
            limit = panel.limit[j]  # type: ignore[index]
            assert limit == pytest.approx(factor / rate, rel=1e-6)
            for i, h in enumerate(found.x.values):
                word = panel.cells[j][i].word
                assert word in (("converged", "inaccurate") if h < limit else ("blown up", "inaccurate")), (rate, h)
                if h > 2 * limit and h < 0.1:
                    assert word == "blown up"
                if h < limit / 10:
                    assert word == "converged" and panel.cells[j][i].error < 0.05


def test_errors_of_converged_runs_fall_with_the_order_of_the_method() -> None:
    falling = "modes: {m: {flow: {x: v, v: -x}, transitions: [{when: x <= -1/2, to: m, reset: {v: -v}}]}}"
    text = f"hsdsl: 1\n{falling}\ninitial: {{mode: m, x: 1, v: 0}}\nexperiment: {{until: 3, scheme: located}}"
    found = stability_map(
        hsdsl.loads(text), "h=1e-2:1e-1:2,initial.v=0:1e-2:2:lin", methods=["midpoint", "rk4"], with_rho=False
    )
    for panel, order in zip(found.panels, (2, 4), strict=True):
        errors = np.array([[cell.error for cell in row] for row in panel.cells])
        assert np.log10(errors[:, 1:] / errors[:, :-1]) == pytest.approx(order, abs=0.4), panel.tool.method


def bench(text: str, rho: bool = False) -> Bench:
    return Bench(hsdsl.loads(text), rho)


def test_words_of_runs() -> None:
    swing = Bench(hsdsl.load(GALLERY / "two-crossings.yaml"), True)
    fine = swing.run(Tool("", "located", "dopri5"), {"tolerance": 1e-9})
    assert (fine.word, fine.transitions) == ("converged", 20)
    assert swing.run(Tool("", "located", "euler"), {"step": 1}).word == "blown up"
    assert swing.run(Tool("", "located", "heun"), {"step": 0.5}).word == "inaccurate"
    assert swing.run(Tool("", "located", "rk4"), {"step": 1}).word == "wrong transitions"
    assert swing.run(Tool("", "paoli-schatzman"), {"step": 1e-2}).word == "refused"
    assert swing.run(Tool("scipy"), {"tolerance": 1e-6}).word == "wrong transitions"
    rolls = Bench(hsdsl.load(GALLERY / "rolling-ball.yaml"), False)
    assert rolls.run(Tool("", "located", "dopri5"), {"parameters": {"e": 0.4}}).word in ("no reference", "converged")
    blown = bench(DECAY).run(Tool("", "located", "euler"), {"step": 0.05})
    assert blown.word == "blown up"
    starts = Bench(hsdsl.load(GALLERY / "event-at-start.yaml"), True)
    late = starts.run(Tool("", "relaxed", "dopri5"), {"tolerance": 1e-9, "relaxation": 1e-6})
    assert late.word == "converged"
    assert 1e-6 < late.rho < 1e-5  # three strips


def test_other_edges_are_wrong_transitions() -> None:
    """Both guards are crossed within one step; the count of transitions is the same."""
    text = """hsdsl: 1
parameters: {late: 1e-3}
modes:
  m:
    flow: {x: 1, y: 1 + t**7}
    transitions: [{name: a, when: x >= 1, to: n}, {name: b, when: y >= 1.125 + late, to: n}]
  n: {flow: {x: 0, y: 0}}
initial: {mode: m, x: 0, y: 0}
experiment: {until: 2}
"""
    here = bench(text)
    assert here.run(Tool("", "located", "dop853"), {"tolerance": 1e-10}).word == "converged"
    assert (
        here.run(Tool("", "located", "euler"), {"step": 0.5, "parameters": {"late": -1e-3}}).word == "wrong transitions"
    )


def test_references_follow_the_numbers() -> None:
    decay = bench(DECAY)
    slow, fast = (decay.scene({"parameters": {"rate": rate}}) for rate in (1.0, 50.0))
    assert not isinstance(slow, str) and not isinstance(fast, str)
    assert slow.exact(1.0).state["x"] == pytest.approx(np.exp(-1))
    assert fast.exact(0.1).state["x"] == pytest.approx(np.exp(-5))
    assert decay.scene({"parameters": {"rate": 1.0}}) is slow
    exact = Bench(hsdsl.load(GALLERY / "stiff-contact.yaml"), False).scene({"step": 1e-3})
    assert not isinstance(exact, str) and exact.exact.scheme == "exact"


def test_peers_run_at_the_numbers_of_the_map() -> None:
    found = stability_map(
        hsdsl.load(GALLERY / "grazing-hit.yaml"),
        "tolerance=1e-8:1e-4:2,gap=1e-6:0.3:2",
        methods=["taylor"],
        against=["scipy"],
        with_rho=False,
    )
    ours, scipy = found.panels
    assert [[cell.word for cell in row] for row in scipy.cells] == [["wrong transitions"] * 2, ["converged"] * 2]
    assert ours.cells[0][0].word == ours.cells[1][0].word == "converged"
    assert ours.cells[1][0].transitions == 2
    assert ours.limit is None


BAD = [
    ("h", "expected two names"),
    ("h,relaxation,rate", "expected two names"),
    ("h,rat", "there is no setting, parameter or initial value 'rat'"),
    ("h,x", "it is a state"),
    ("h,t", "it is time"),
    ("h,h", "got h twice"),
    ("h,step", "exclude each other"),
    ("h,tolerance", "exclude each other"),
    ("rate,rate", "got rate twice"),
    ("h=1:1:5,rate", "expected FROM below TO"),
    ("h=2:1,rate", "expected FROM below TO"),
    ("h=1e-3:1:1,rate", "2 to 400 values"),
    ("h=1e-3:1:1.5,rate", "expected FROM:TO:COUNT"),
    ("h=1e-3,rate", "expected FROM:TO:COUNT"),
    ("h=a:b,rate", "expected FROM:TO:COUNT"),
    ("h=nan:1,rate", "expected FROM:TO:COUNT"),
    ("h=1e-3:inf,rate", "expected FROM:TO:COUNT"),
    ("h=0:1,rate", "expected positive ends"),
    ("h=-1:1:5:lin,rate", "expected positive ends"),
    ("h,initial.y", "its value is 0, so give a range"),
    ("h=1e-3:1:400,rate=1:2:400", "at most 40,000 runs"),
]


@pytest.mark.parametrize(("text", "message"), BAD)
def test_axes_that_cannot_be(text: str, message: str) -> None:
    with pytest.raises(UsageError, match=message):
        read_axes(hsdsl.loads(DECAY), text, 2.0, {})


def test_axes() -> None:
    x, y = read_axes(hsdsl.loads(DECAY), "h=1e-4:1e-1:4, initial.x=-1:1:3:lin", 2.0, {})
    assert (x.kind, y.kind, x.logarithmic, y.logarithmic) == ("step", "initial", True, False)
    assert x.values == pytest.approx((1e-4, 1e-3, 1e-2, 1e-1))
    assert y.values == (-1, 0, 1)
    assert y.onto({"initial": {"y": 3}}, 0.5) == {"initial": {"y": 3, "x": 0.5}}
    x, y = read_axes(hsdsl.loads(DECAY), "relaxation,rate", 2.0, {})
    assert (min(y.values), max(y.values)) == pytest.approx((10, 1000))
    assert (min(x.values), max(x.values)) == pytest.approx((2e-10, 2e-2))


def test_a_range_left_out_is_about_the_value_that_runs_have() -> None:
    derived = hsdsl.loads(DECAY.replace("{rate: 100}", "{half: 20, rate: 5*half}"))
    for name, base in (("rate", {"parameters": {"half": 3}}), ("initial.x", {"initial": {"x": 15}})):
        _, y = read_axes(derived, f"h,{name}", 2.0, base)
        assert (min(y.values), max(y.values)) == pytest.approx((1.5, 150))


def test_bounds_of_a_parameter_are_refused_before_anything_runs() -> None:
    bounded = DECAY.replace("{rate: 100}", "{rate: {value: 100, max: 200}}")
    with pytest.raises(UsageError, match="200"):
        stability_map(hsdsl.loads(bounded), "h,rate=10:300:3")


def test_text_counts_and_tables_agree() -> None:
    found = stability_map(hsdsl.loads(DECAY), "h=1e-3:1e-2:2,relaxation=1e-6:1e-4:2", methods=["rk4"])
    assert as_text(found).startswith("relaxed rk4  4 converged")
    assert as_csv(found).count("\n") == 5
    assert len(as_plain(found)["runs"]) == 4


def hanging(task: str) -> str:
    if task == "hang":
        while True:
            pass
    if task == "die":
        os.kill(os.getpid(), signal.SIGKILL)
    if task == "raise":
        raise ValueError("no")
    return task.upper()


def test_processes_end_what_hangs_and_go_on() -> None:
    tasks = ["a", "hang", "b", "die", "c", "d"]
    began = time.monotonic()
    found = dict(in_processes(hanging, tasks, 2, 0.5))
    assert [found[k] for k in (0, 2, 4, 5)] == ["A", "B", "C", "D"]
    assert (found[1], found[3]) == (Lost(HANGS), Lost(CRASHES))
    assert time.monotonic() - began < 30


def test_processes_pass_errors_on() -> None:
    with pytest.raises(ValueError, match="no"):
        list(in_processes(hanging, ["a", "raise"], 1, 5.0))


def test_cells_without_a_reference_are_hatched(tmp_path: Path) -> None:
    text = DECAY.replace("flow: {x: -x, y: 0}", "flow: {x: -x, y: 0}\n    domain: [x >= rate/1e9]")
    found = stability_map(hsdsl.loads(text), "h=1e-3:1e-2:2,rate=10:40:2", with_rho=False, processes=1)
    words = {cell.word for cell in found.panels[0].cells[1]}
    assert words == {"no reference"}
    plot_stability(tmp_path / "map.svg", found)
    assert "<pattern" in (tmp_path / "map.svg").read_text()


@pytest.mark.parametrize("count", [1, 4, 5])
def test_every_column_of_panels_has_an_axis_with_numbers(count: int) -> None:
    methods = ["euler", "heun", "midpoint", "ralston", "rk4"][:count]
    found = stability_map(
        hsdsl.loads(DECAY), "h=1e-3:1e-2:2,rate=10:40:2", methods=methods, with_rho=False, processes=1
    )
    figure = plot_stability.__wrapped__(found)
    panels = [axes for axes in figure.axes if axes.get_visible()]
    lowest = panels[-min(3, count) :]
    assert {axes.get_subplotspec().colspan.start for axes in lowest} == set(range(min(3, count)))
    assert [axes for axes in panels if axes.get_xlabel() == "h"] == lowest
    assert all(axes.xaxis.get_tick_params()["labelbottom"] for axes in lowest)


def test_names_are_checked_and_may_be_one_text() -> None:
    model = hsdsl.loads(DECAY)
    found = stability_map(model, "h=1e-3:1e-2:2,rate=10:40:2", methods="euler, rk4", schemes="located", with_rho=False)
    assert [panel.tool.label for panel in found.panels] == ["located euler", "located rk4"]
    for words in ({"methods": "rk5"}, {"schemes": ["locate"]}, {"against": "scypi"}):
        with pytest.raises(UsageError, match="there is no"):
            stability_map(model, "h,rate", **words)
