"""Runs of many digits: what the tolerance is where nobody gives one, and how many digits it keeps."""

from __future__ import annotations

import mpmath as mp
import pytest

import hsdsl
from hsdsl.analysis.report import as_json
from hsdsl.analysis.report.summary import summary

SPIN = """hsdsl: 1
modes:
  m:
    flow: {x: y, y: -x}
    transitions: [{when: x <= 0, to: m, reset: {y: y}}]
initial: {mode: m, x: 1, y: 0}
experiment: {until: 1.5}
"""
KINKED = SPIN.replace("y: -x}", "y: '-max(x, -5)'}")


@pytest.mark.parametrize("digits", [16, 30, 100])
def test_the_default_tolerance_follows(digits):
    run = hsdsl.loads(SPIN).simulate(precision=digits)
    with mp.workdps(digits + 10):
        assert run.method == "taylor"
        assert abs(run.settings["tolerance"] * mp.mpf(10) ** (digits - 7) - 1) < mp.mpf(10) ** (2 - digits)
        assert as_json(run)["settings"]["tolerance"] == run.settings["tolerance"]
        assert abs(run.final["x"] - mp.cos(mp.mpf("1.5"))) < mp.mpf(10) ** (9 - digits)
    assert "keeps" not in summary(run)


def test_sixteen_digits_have_the_default_of_floats():
    few, plain = (hsdsl.loads(SPIN).simulate(precision=digits) for digits in (16, None))
    assert float(few.settings["tolerance"]) == plain.settings["tolerance"] == 1e-9


@pytest.mark.parametrize(
    ("model", "given", "kept"),
    [
        (KINKED, {}, 9),
        (SPIN, {"method": "dopri5"}, 9),
        (SPIN, {"tolerance": "1e-12"}, 12),
        (SPIN, {"tolerance": "1e-12", "method": "taylor"}, 12),
        (SPIN.replace("until: 1.5", "until: 1.5, tolerance: 1e-20"), {}, 20),
    ],
)
def test_elsewhere_the_digits_kept_are_said(model, given, kept):
    run = hsdsl.loads(model).simulate(precision=50, **given)
    assert round(-mp.log10(run.settings["tolerance"])) == kept
    assert f"50 digits, of which the tolerance keeps {kept}" in " ".join(summary(run).split())


def test_a_fixed_step_has_no_tolerance():
    run = hsdsl.loads(SPIN).simulate(precision=30, step="1/8", method="rk4")
    assert "tolerance" not in run.settings and "keeps" not in summary(run)
