"""Branches of periodic orbits: folds, flips and grazing of an impact oscillator, where closed forms are known."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.linalg import expm

import hsdsl
from hsdsl import UsageError
from hsdsl.interface.cli.verbs import obey

OSCILLATOR = """
hsdsl: 1
title: An impact oscillator
parameters: {{a: 0.05, c: 0.8, w: 1, s: 1, F: {F}, W: {W}}}
modes:
  free:
    flow: {{x: v, v: F*cos(W*t) - 2*a*v - w**2*x}}
    transitions: [{{when: x >= s, to: free, name: impact, reset: {{v: -c*v}}}}]
initial: {{mode: free, x: 0.9, v: -0.4}}
experiment: {{until: 400}}
"""


def kinds(branch: Any) -> dict[str, float]:
    """The parameter of each kind of bifurcation."""
    return {found.kind: found.parameter for found in branch.bifurcations}


def test_flip_and_grazing() -> None:
    branch = hsdsl.loads(OSCILLATOR.format(F=0.6, W=0.8)).continuation("impact", "F", 0.3, 0.7)
    found = kinds(branch)
    assert found.keys() == {"flip", "grazing"}
    assert found["flip"] == pytest.approx(0.5182098665978726, rel=1e-11)
    assert found["grazing"] == pytest.approx(np.hypot(1 - 0.64, 2 * 0.05 * 0.8), rel=1e-8)
    assert all((point.unstable == 0) == (point.parameter > found["flip"]) for point in branch.points)
    assert branch.stable == [(found["flip"], 0.7)]
    assert "stable from F = 0.5182098666 to 0.7" in branch.summary


def test_fold_and_grazing() -> None:
    """Orbits are the roots of a quadratic in the impact velocity v: F**2 = A**2 ((s + p v)**2 + (q v/W)**2)."""
    forcing = np.sqrt(1.99)
    branch = hsdsl.loads(OSCILLATOR.format(F=1.3, W="sqrt(1.99)")).continuation("impact", "F", 0.05, 1.5)
    flow = expm(np.array([[0, 1], [-1, -0.1]]) * 2 * np.pi / forcing)
    p, q = np.linalg.solve(flow - np.eye(2), flow @ [0, 1] + [0, 1 / 0.8])
    size = np.hypot(1 - 1.99, 0.1 * forcing)
    square = p * p + (q / forcing) ** 2
    lowest = size * np.sqrt(1 - p * p / square)
    found = kinds(branch)
    assert found.keys() == {"fold", "grazing"}
    assert found["fold"] == pytest.approx(lowest, rel=1e-9)
    assert found["grazing"] == pytest.approx(1, rel=1e-7)
    assert all(found["fold"] in piece for piece in branch.stable)
    for point in branch.points:
        v = point.state[1]
        assert point.parameter == pytest.approx(size * np.hypot(1 + p * v, q * v / forcing), rel=1e-9)


def test_torus() -> None:
    """The product of the multipliers is c**2 exp(-2 a T): on the unit circle where a is log(c)/T."""
    text = OSCILLATOR.format(F=0.6, W=0.8).replace("c: 0.8", "c: 0.78")
    branch = hsdsl.loads(text).continuation("impact", "a", -0.05, 0.05)
    assert kinds(branch).keys() == {"torus"}
    assert kinds(branch)["torus"] == pytest.approx(np.log(0.78) / (2 * np.pi / 0.8), rel=1e-10)


def test_branch_point_of_two_laps() -> None:
    """Where an orbit flips, the same orbit twice has a multiplier that passes 1: orbits of two laps cross there."""
    text = OSCILLATOR.format(F=0.62, W=0.78).replace("c: 0.8", "c: 0.75")
    once, twice = (hsdsl.loads(text).continuation("impact", "F", 0.5, 0.65, laps=laps) for laps in (1, 2))
    assert kinds(once).keys() == {"flip"} and kinds(twice).keys() == {"branch point"}
    assert kinds(twice)["branch point"] == pytest.approx(kinds(once)["flip"], rel=1e-10)
    assert np.allclose(twice.stable, once.stable, rtol=1e-10)


STOPS = """
hsdsl: 1
parameters: {{a: 0.1, c: 0.7, F: 2, W: {W}, s: 1}}
modes:
  free:
    flow: {{x: v, v: F*cos(W*t) - 2*a*v - x}}
    transitions:
      - {{when: x >= s, to: free, name: right, reset: {{v: -c*v}}}}
      - {{when: x <= -s, to: free, name: left, reset: {{v: -c*v}}}}
initial: {{mode: free, x: 0.2, v: 0.4}}
experiment: {{until: 300}}
"""


@pytest.mark.slow
def test_orbits_that_lose_a_symmetry() -> None:
    """Between two branch points of the symmetric orbit there is a circle of others, which turns at both."""
    symmetric, others = (hsdsl.loads(STOPS.format(W=W)).continuation("right", "W", 0.9, 1.7) for W in (1.65, 1.25))
    assert [found.kind for found in symmetric.bifurcations] == ["branch point"] * 2
    assert [found.kind for found in others.bifurcations] == ["fold"] * 2
    assert others.ends == ("the branch is closed",) * 2
    assert np.array_equal(others.points[0].state, others.points[-1].state)
    values = [sorted(found.parameter for found in branch.bifurcations) for branch in (symmetric, others)]
    assert np.allclose(*values, rtol=1e-7)
    (_, first), (second, _) = symmetric.stable
    assert np.allclose([first, second], values[0])


def test_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    model, picture = tmp_path / "model.yaml", tmp_path / "branch.png"
    model.write_text(OSCILLATOR.format(F=0.6, W=0.8))
    words = ["orbit", str(model), "--section", "impact", "--continue", "F=0.55:0.65", "--json", "--plot", str(picture)]
    assert obey(words) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["bifurcations"] == []
    assert [found["points"][0]["parameter"], found["points"][-1]["parameter"]] == pytest.approx([0.55, 0.65])
    assert picture.stat().st_size > 1000


@pytest.mark.parametrize(
    ("text", "sentence"),
    [("F", "expected PARAM=A:B"), ("G=0:1", "no parameter 'G'"), ("F=1:1", "a range of F"), ("F=0.5:u", "")],
)
def test_bad_ranges(text: str, sentence: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    model = tmp_path / "model.yaml"
    model.write_text(OSCILLATOR.format(F=0.6, W=0.8))
    assert obey(["orbit", str(model), "--section", "impact", "--continue", text]) == 2
    assert sentence in capsys.readouterr().err


def test_a_range_that_ends_at_a_bound_of_the_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    model = tmp_path / "model.yaml"
    model.write_text(OSCILLATOR.format(F=0.6, W=0.8).replace("c: 0.8", "c: {value: 0.8, min: 0.7, max: 0.83}"))
    words = ["orbit", str(model), "--section", "impact", "--continue"]
    assert obey([*words, "c=0.83:0.7"]) == 0
    text = capsys.readouterr().out
    assert all(f"to c = {end}: the parameter is at the end of its range" in text for end in (0.7, 0.83))
    assert obey([*words, "c=0.75:0.9"]) == 2
    assert capsys.readouterr().err.startswith("hsdsl: parameter c = 0.9 is beyond its maximum 0.83\n")


def test_bad_call() -> None:
    with pytest.raises(UsageError, match="no transition"):
        hsdsl.loads(OSCILLATOR.format(F=0.6, W=0.8)).continuation("hit", "F", 0, 1)


def test_section_through_zero() -> None:
    """A guard through zero begins and ends the same mode: a start at round-off of it is on it, not beyond.

    The multiplier of the orbit of small mu is exp(-2 pi mu) to first order; the period for mu = 1 is that of many.
    """
    flow = "flow: {x: y, y: mu*(1 - x**2)*y - x}"
    model = hsdsl.loads(f"""
hsdsl: 1
parameters: {{mu: 1}}
modes:
  neg: {{{flow}, transitions: [{{when: x >= 0, to: pos, name: up}}]}}
  pos: {{{flow}, transitions: [{{when: x <= 0, to: neg, name: down}}]}}
initial: {{mode: neg, x: -1, y: 1}}
experiment: {{until: 40}}
""")
    found = model.continuation("up", "mu", 0.1, 6)
    assert [round(point.parameter, 9) for point in (found.points[0], found.points[-1])] == [0.1, 6]
    assert not found.bifurcations
    assert len(found.points) < 80
    assert found.points[0].multipliers[0].real == pytest.approx(np.exp(-0.2 * np.pi), rel=0.01)
    assert found.first.period == pytest.approx(6.6632868593231301896996820305, rel=1e-11)


@pytest.mark.slow
def test_branch_that_ends_where_transitions_accumulate() -> None:
    """Laps of two tanks become ever shorter as the inflow falls to what flows out of both."""
    model = hsdsl.loads("""
hsdsl: 1
parameters: {w: 1.8, r: 0.5}
modes:
  one: {flow: {h: w - 0.8, k: -0.7*sqrt(k)}, transitions: [{when: k <= r, to: two, name: to_two}]}
  two: {flow: {h: -0.8*sqrt(h), k: w - 0.7}, transitions: [{when: h <= r, to: one, name: to_one}]}
initial: {mode: one, h: 1, k: 1.2}
experiment: {until: 60}
""")
    found = model.continuation("to_one", "w", 1, 1.9)
    level = np.sqrt(0.5)
    assert found.points[-1].parameter == pytest.approx(1.9)
    first = found.points[0]
    assert first.period < 0.01 * found.first.period
    assert (first.parameter - 0.8) * (first.parameter - 0.7) == pytest.approx(0.8 * 0.7 * level**2, rel=0.01)


STUCK = """
hsdsl: 1
parameters: {J: 1.7, m: 0.4, k: 2.3, c: 0.05, d: 0.4, drive: {value: 2, unit: N*m}, static: 1.7, kinetic: 0.9}
let: {shaft: k*x + c*(u - v)}
modes:
  on:
    flow: {x: u - v, u: (drive - d*u - shaft)/J, v: (shaft - kinetic - (static - kinetic)*exp(-v/0.7))/m}
    transitions: [{name: sticks, when: v <= 0, to: back}]
  back:
    flow: {x: u - v, u: (drive - d*u - shaft)/J, v: (shaft + kinetic + (static - kinetic)*exp(v/0.7))/m}
    transitions: [{name: turns, when: v >= 0, to: on}]
units: {u: rad/s}
initial: {mode: on, x: 0.2, u: 0.4, v: 0.1}
experiment: {until: 40, completion: auto}
"""


def test_a_picture_shows_no_state_that_is_round_off_at_the_section(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    drawn: list[Any] = []
    monkeypatch.setattr("hsdsl.analysis.plot.analyses.plot_branch", lambda *given: drawn.extend(given))
    model = hsdsl.loads(hsdsl.loads(STUCK).completed())
    model.continuation("sliding_on_back->on", "drive", 1.98, 2.02).plot(tmp_path / "branch.png")
    assert drawn[1:3] == ["drive [N*m]", "u [rad/s] after the section"]  # v is zero there
