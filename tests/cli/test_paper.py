"""``python examples/paper``: the quick mode from end to end, its numbers against known ones, and its page."""

from __future__ import annotations

import csv
import math
import re
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from paper.__main__ import main
from paper.accuracy import findings, measure, measure_rival, velocity_reversed
from paper.parts import PARTS
from paper.runner import CAPTION, KNOWN, guard_curves, snapshots

from hsdsl import load
from hsdsl.analysis.exact import reference

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "paper.md"
PICTURES = (
    "fig01-digital-control", "fig14a-stop", "fig14bc-exact", "fig14d-rho", "fig14e-rho-hat", "fig14f-times",
    "fig15-runner", "fig16-guards", "fig17-strides",
)  # fmt: skip
IMPACTS = {
    1: [(0.0921688846962224, 25.63319276295), (2.50726703183029, 9.553841056913), (5.17014144099789, 6.423540818419),
        (7.59723563299129, 23.51720843596), (12.6384702081505, 26.51527341105), (15.1125718953819, 4.867779979315)],
    2: [(4.666529220829659, 0.20074827327271), (4.890984802322314, 0.094864277230307),
        (4.982391960472027, 0.04608270512409)],
}  # fmt: skip


def table(folder, name):
    with open(folder / f"{name}.csv", newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def every_part_says_what_it_does_and_writes_its_pictures(out, answer):
    for name, part in PARTS.items():
        assert f"{name}: {part.summary}" in answer
    assert {path.stem for path in out.glob("*.png")} == set(PICTURES)
    for name in PICTURES:
        assert (out / f"{name}.png").read_bytes().startswith(b"\x89PNG")
        assert ElementTree.parse(out / f"{name}.svg").getroot().tag.endswith("svg")
        assert (ROOT / "docs" / "images" / "paper" / f"{name}.png").is_file()


def digital_control_distances_are_linear_in_delta_and_the_rivals_stay(out):
    rows = table(out, "digital-control")
    known = {
        ("rho", "x y"): math.sqrt(1.04), ("rho", "x z"): math.sqrt(1.09), ("rho", "y z"): math.sqrt(2),
        ("quotient", "y(2) z(2)"): math.sqrt(0.49 + 0.64),
    }  # fmt: skip
    assert {float(row["delta"]) for row in rows} == {1e-1, 1e-6}
    for row in rows:
        delta, lower, upper = (float(row[name]) for name in ("delta", "lower", "upper"))
        if (row["metric"], row["pair"]) in known:
            value = known[row["metric"], row["pair"]] * delta
            slack = 6e-10 if row["executions"] == "relaxed" else 1e-9 * delta + 1e-14
            assert lower - slack <= value <= upper + slack
            assert upper - lower <= 1.1e-7 * upper + 1e-13
        else:
            assert row["pair"] == "y z" and lower >= 1 - 1e-12


def table_1_is_the_printed_one(out):
    rows = [{name: float(value) for name, value in row.items()} for row in table(out, "table-1")]
    first = [0.05, 0.9, 40 * math.pi, 20, 20 * math.cos(2.5), 11.36, 31.4, 14, 2.5]
    second = [0.95, 0.5, 4 * math.pi, 1, math.cos(1), -0.8, 0, -0.8, 1]
    assert [list(row.values())[1:] for row in rows] == [
        pytest.approx(first, rel=1e-15),
        pytest.approx(second, rel=1e-15),
    ]


def impacts_are_the_exact_ones(out):
    for example, impacts in IMPACTS.items():
        rows = table(out, f"impacts-{example}")
        for row, (time, velocity) in zip(rows, impacts, strict=False):
            assert float(row["time"]) == pytest.approx(time, abs=2e-14 * (1 + time))
            assert float(row["velocity before"]) == pytest.approx(velocity, abs=1e-11)
    rows = table(out, "impacts-1")
    assert len(rows) == 49
    assert float(rows[-1]["time"]) == pytest.approx(123.216813425158, abs=1e-12)


def accuracy_has_bounds_in_order_and_reversing_the_velocity_is_worse(out):
    rows = [{name: float(value) for name, value in row.items()} for row in table(out, "accuracy")]
    assert len(rows) == 4
    for row in rows:
        assert 0 < row["rho_lower"] <= row["rho_upper"] <= 1.06 * row["rho_lower"]
        assert row["rho_hat"] < row["rho_upper"] < row["rho_reversed"]


def times_name_the_engine(out):
    rows = table(out, "times")
    assert {row["engine"] for row in rows} >= {"python"}
    assert {row["scheme"] for row in rows} == {"relaxed", "paoli-schatzman"}
    assert all(float(row["seconds"]) > 0 for row in rows)


def runner_events_are_late_by_the_strips_alone(out):
    rows = table(out, "runner-events")
    for stride, known in KNOWN.items():
        mine = [row for row in rows if row["stride"] == stride]
        assert len(mine) == 5
        for k, (row, time) in enumerate(zip(mine, known, strict=True)):
            assert -1e-9 <= float(row["fine time"]) - float(time) <= 1e-8 * (k + 1)
            assert -2e-5 <= float(row["time"]) - float(time) <= 1e-2 * k + 2e-5


def test_the_guards_drawn_are_the_models():
    """The states at which the simulated runner touches down lie on the curves."""
    model = load(ROOT / "models" / "pronking-runner.yaml")
    run = model.simulate(initial={"w": -0.4})
    for t, name in zip(run.transitions, ("G(a,l)", "G(l,g)"), strict=False):
        assert guard_curves(np.array([t.before["th"]]))[name][0] == pytest.approx(t.before["z"], abs=1e-12)
    run = model.simulate(initial={"w": 0.4})
    for t, name in zip(run.transitions, ("G(a,r)", "G(r,g)"), strict=False):
        assert guard_curves(np.array([t.before["th"]]))[name][0] == pytest.approx(t.before["z"], abs=1e-12)


def test_snapshots_have_stance_legs_no_longer_than_at_rest_and_feet_where_the_model_pins_them():
    model = load(ROOT / "models" / "pronking-runner.yaml")
    poses = snapshots(model.simulate(initial={"w": -0.4}, **CAPTION))
    assert [pose.event for pose in poses] == [
        "start", "left touchdown", "right touchdown", "lowest point", "left lift-off", "right lift-off", "apex",
    ]  # fmt: skip
    assert [pose.feet_down for pose in poses] == [0, 1, 2, 2, 1, 0, 0]
    for pose in poses:
        for leg in pose.legs:
            length = math.dist(leg.hip, leg.foot)
            assert leg.foot[1] == 0 and length < 1.02 if leg.doing == "stance" else length == pytest.approx(1)
        assert math.dist(*(leg.hip for leg in pose.legs)) == pytest.approx(1)


def test_reversing_the_velocity_mirrors_it_inside_each_step():
    model = load(ROOT / "models" / "oscillator-with-stop-1.yaml")
    run = model.simulate(until=2, step=0.1, relaxation=1e-6)
    other = velocity_reversed(run)
    arc = run.arcs[2]
    times = run.times[arc.first : arc.last + 1]
    quarter, three = times[:-1] + np.diff(times) / 4, times[:-1] + 3 * np.diff(times) / 4
    assert other.sample(quarter)["v"] == pytest.approx(run.sample(three)["v"], rel=1e-12)
    assert other.sample(quarter)["x"] == pytest.approx(run.sample(quarter)["x"], rel=1e-12)


def test_the_finest_step_against_what_others_recorded():
    """Example 1 at h = 5e-4: rho-hat as the authors' program has it, and what their reversed velocity makes of rho."""
    model = load(ROOT / "models" / "oscillator-with-stop-1.yaml")
    truth = reference(model)
    fine = measure(1, model, truth, 5e-4, 2e-5)
    assert fine.rho_upper <= 2.5e-4 and fine.rho_upper - fine.rho_lower <= 1e-5
    assert fine.rho_hat <= 8.7e-5
    assert fine.rho_reversed == pytest.approx(3.47e-2, rel=0.25)
    rival = measure_rival(1, model, truth, 5e-4)
    assert rival.rho_hat == pytest.approx(0.318, abs=5e-4)
    for finding in findings([fine], [rival]):
        on_page(finding.cells)


@pytest.mark.slow
def test_the_finest_step_with_the_largest_relaxation():
    for example, recorded in ((1, 2.03e-3), (2, 1.28e-5)):
        model = load(ROOT / "models" / f"oscillator-with-stop-{example}.yaml")
        point = measure(example, model, reference(model), 5e-4, 2e-2)
        assert recorded / 2 < point.rho_hat < 1.1 * recorded
        for finding in findings([point], []):
            on_page(finding.cells)


@pytest.mark.slow
def test_the_finest_step_of_example_2():
    model = load(ROOT / "models" / "oscillator-with-stop-2.yaml")
    truth = reference(model)
    fine = measure(2, model, truth, 5e-4, 2e-5)
    assert fine.rho_upper <= 1.2e-4
    assert fine.rho_hat <= 5e-8
    for finding in findings([fine], [measure_rival(2, model, truth, 5e-4)]):
        on_page(finding.cells)


def page_table():
    rows = re.findall(
        r"^\| ([^|]+) \| ([^|]+) \| ([^|]+) \| ([^|]*) \|$", PAGE.read_text(encoding="utf-8"), re.MULTILINE
    )
    return {(figure.strip(), quantity.strip()): here.strip() for figure, quantity, here, _ in rows}


def on_page(cells):
    figure, quantity, here, _ = cells
    written = page_table()[figure, quantity]
    try:
        number = float(here)
    except ValueError:
        assert written == here
    else:
        assert float(written) == pytest.approx(number, rel=2e-3, abs=1e-12)


def the_page_says_what_a_run_finds(out, printed):
    rows = [row for row in table(out, "summary") if row["where"] != "Fig. 14f"]
    assert len(rows) >= 40
    for row in rows:
        on_page((row["where"], row["what"], row["here"], row["known"]))
        assert row["what"] in printed


@pytest.mark.slow
def test_a_quick_run_from_end_to_end(tmp_path, capsys):
    """One test, since one run serves all checks and takes half a minute."""
    out = tmp_path / "figures"
    assert main(["--quick", "--out", str(out)]) == 0
    captured = capsys.readouterr()
    every_part_says_what_it_does_and_writes_its_pictures(out, captured.err)
    digital_control_distances_are_linear_in_delta_and_the_rivals_stay(out)
    table_1_is_the_printed_one(out)
    impacts_are_the_exact_ones(out)
    accuracy_has_bounds_in_order_and_reversing_the_velocity_is_worse(out)
    times_name_the_engine(out)
    runner_events_are_late_by_the_strips_alone(out)
    the_page_says_what_a_run_finds(out, captured.out)


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["--only", "nothing"], "invalid choice: 'nothing'"),
        (["--models", "nowhere", "--only", "table-1"], "there is no nowhere"),
        (["--out", __file__], "cannot make the folder"),
    ],
)
def test_wrong_usage_is_two_and_a_sentence(arguments, sentence, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    try:
        code = main(arguments)
    except SystemExit as stopped:
        code = stopped.code
    assert code == 2
    assert sentence in capsys.readouterr().err
