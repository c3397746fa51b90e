"""One mass and one stop: which models the scheme paoli-schatzman takes, and what it makes of them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

import hsdsl

CASES = yaml.safe_load((Path(__file__).parent / "one_stop.yaml").read_text())


def changed(changes: dict[str, str]) -> Any:
    """The base model with changes, loaded; every change must find its text."""
    text = CASES["base"]
    for old, new in changes.items():
        assert old in text
        text = text.replace(old, new)
    return hsdsl.loads(text)


@pytest.mark.parametrize("case", CASES["accepted"])
def test_accepted(case: str) -> None:
    """Smooth until it hits, so short of the stop it must agree with the relaxed scheme to second order."""
    model = changed(CASES["accepted"][case])
    run, other = model.simulate(), model.simulate(scheme="relaxed", method="dopri5", tolerance="1e-9")
    end = min([1.0, *(t.time for t in other.transitions)])
    assert end > 0.5
    times = np.linspace(0, end - 0.02, 40)
    assert np.max(np.abs(run.sample(times)["x"] - other.sample(times)["x"])) <= 3e-4
    assert np.max(np.abs(run.sample(times)["v"] - other.sample(times)["v"])) <= 3e-4


@pytest.mark.parametrize("case", CASES["refused"])
def test_refused(case: str) -> None:
    changes, words = CASES["refused"][case]
    with pytest.raises(hsdsl.UsageError) as refusal:
        changed(changes).simulate()
    assert words in str(refusal.value)
    assert str(refusal.value).count(".") <= 1


HITS = {"until": 12, "initial": {"v": "2"}}


def test_a_stop_below_mirrors_one_above() -> None:
    above = changed({}).simulate(**HITS)
    mirrored = {"x >= top": "x <= -top", "cos(t)": "-cos(t)"}
    below = changed(mirrored).simulate(until=12, initial={"v": -2})
    assert len(above.transitions) > 1
    assert np.array_equal(above.values, -below.values)
    assert [t.time for t in above.transitions] == [t.time for t in below.transitions]


def test_the_rebound_has_its_restitution() -> None:
    """Two steps of contact turn one quotient of positions into -c times another, up to the force over two steps."""
    for impact in changed({}).simulate(**HITS).transitions:
        assert abs(impact.after["v"] + impact.before["v"] / 2) <= 3 * 1e-2
        assert impact.time == impact.resumed


def test_rows_are_the_recurrence() -> None:
    """The formula, written out, with c = 1/2, x_max = 1, k = 1, a = 0."""
    run = changed({}).simulate(**HITS)
    h, z = 1e-2, [0.0, 2e-2 + 1e-4 / 2]
    for k in range(1, 1200):
        y = h**2 * np.cos(k * h) + (2 - h**2) * z[k] - z[k - 1] / 2
        z.append(-z[k - 1] / 2 + min(y, 1.5))
    sampled = run.sample(np.arange(1201) * h)["x"]
    assert np.max(np.abs(sampled - z)) <= 1e-11


def test_a_sampled_input_drives_it_as_its_expression_does() -> None:
    expression = changed({"cos(t)": "1 - t/2"}).simulate(until=2)
    samples = changed({"cos(t)": "{times: [0, 1/2, 2], values: [1, 3/4, 0], hold: linear}"}).simulate(until=2)
    assert np.allclose(expression.values, samples.values, rtol=0, atol=1e-12)


def test_other_numbers() -> None:
    model = changed({})
    quick, exact = model.simulate(**HITS), model.simulate(**HITS, precision=30)
    assert exact.digits == 30
    assert np.max(np.abs(quick.values - exact.values.astype(float))) <= 1e-9


def test_it_ends_at_until_and_at_the_limit_of_transitions() -> None:
    model = changed({})
    for until in ("1", "1.005", "0.001", "0"):
        run = model.simulate(until=until)
        assert (run.stop.reason, run.times[-1]) == ("until", float(until))
    run = model.simulate(**HITS, max_transitions=1)
    assert run.stop.reason == "transition_limit"
    assert len(run.transitions) == 1


def test_too_long_a_step_says_so() -> None:
    run = changed({"u - x": "u - 1e6*x", "top: 1": "top: 1e300"}).simulate(until=100, initial={"x": 1})
    assert run.stop.reason == "not_finite"
    assert "shorten the step" in run.stop.message


def test_what_it_cannot_know_it_says(tmp_path: Path) -> None:
    run = changed({}).simulate()
    assert run.verdict.theorem == "unknown"
    assert any("difference quotients" in reason for reason in run.verdict.reasons)
    assert set(run.settings) == {"until", "step", "max_transitions"}
    run.save(tmp_path / "run.npz")
    from hsdsl.analysis.store import load

    assert load(tmp_path / "run.npz") == run
