"""Orbital stability, sampled: an execution at a corner of guards with different resets is not stable."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hsdsl
from hsdsl import UsageError
from hsdsl.analysis.orbits.sampling import sampled
from hsdsl.interface.cli.verbs import obey

CORNER = """
hsdsl: 1
title: Two guards that meet
parameters: {k: 0.5}
modes:
  M:
    flow: {x: 1, y: k*(1 + y)}
    transitions: [{when: x >= 1, to: A, reset: {x: 0}}, {when: y >= 1, to: B, reset: {y: -1}}]
  A: {flow: {x: 1 - x, y: -2*y}}
  B: {flow: {x: x/2, y: y}}
initial: {mode: M, x: 0, y: 2*exp(-0.5) - 1}
experiment: {until: 2}
"""
QUADRANTS = "models/digital-control.yaml"
GRAZING = """
hsdsl: 1
modes:
  A: {flow: {x: v, v: -x}, transitions: [{when: x >= 1, to: A, name: hit, reset: {v: -v/2}}]}
initial: {mode: A, x: 0, v: 1}
experiment: {until: 2.5}
"""


@pytest.mark.parametrize(
    ("model", "verdict"),
    [(CORNER, "not stable"), (QUADRANTS, "stable"), (GRAZING, "stable")],
    ids=["corner", "quadrants", "grazing"],
)
def test_verdicts(model: str, verdict: str) -> None:
    loaded = hsdsl.loads(model) if "\n" in model else hsdsl.load(model)
    found = loaded.orbital_stability(samples=4, radii=(1e-4, 1e-7))
    assert found.verdict == verdict, found.sentence
    if model is QUADRANTS:  # it is Lipschitz, though its derivatives depend on the side
        assert found.exponent == pytest.approx(1, abs=0.05)
    if model is GRAZING:  # the speed at the stop is the root of the excess energy
        assert found.exponent == pytest.approx(0.5, abs=0.1)


@pytest.mark.parametrize(
    ("lower", "upper", "verdict"),
    [(1, 0, "not stable"), (1e-9, 0, "undecided"), (0, 0, "undecided"), (0, 1, "stable"), (1e-9, 0.5, "stable")],
)
def test_upper_ends_that_stay_prove_nothing(lower: float, upper: float, verdict: str) -> None:
    """Distances through guards and resets that are not affine are intervals, of which only the lower end is proved."""

    def look(shift: Any) -> tuple[float, float, tuple[str, ...]]:
        radius = abs(shift["x"])
        return (lower if lower == 1 else lower * radius, radius**upper, ())

    found = sampled(["x"], np.ones(1), (1e-3, 1e-5, 1e-7), np.ones((1, 1)), look, "")
    assert found.verdict == verdict
    assert verdict in found.sentence or verdict == "not stable"


def test_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path, picture = tmp_path / "corner.yaml", tmp_path / "stability.svg"
    path.write_text(CORNER)
    words = ["sensitivity", str(path), "--wrt", "initial.y", "--stability", "--plot", str(picture), "--json"]
    assert obey(words) == 0
    found: dict[str, Any] = json.loads(capsys.readouterr().out)
    assert found["orbital_stability"]["verdict"] == "not stable"
    assert found["exists"] is False
    assert picture.stat().st_size > 1000
    assert obey([*words[:4], "--plot", str(picture)]) == 2


def test_bad_input() -> None:
    model = hsdsl.loads(CORNER)
    with pytest.raises(UsageError, match="radii that fall"):
        model.orbital_stability(radii=(1e-5, 1e-3))
    with pytest.raises(UsageError, match="no parameter"):
        model.orbital_stability("initial.z")
