"""Two feet that touch down almost together: both are met, in their order, at every tolerance and gap.

Tools that look for events one at a time, or wait a moment behind each, lose the second foot here.
"""

import pytest
from shipped import MODELS

import hsdsl

FALLING = 2.3893694922225  # how fast the feet touch down
GAPS = (1e-12, 1e-11, 1e-10, 1e-9, 1e-8, 1e-6, 1e-4, 1e-3)  # seconds between them
TIE = 1e-12
"""Gaps up to this are one instant, and the order is the file's."""


@pytest.fixture(scope="module")
def runner():
    return hsdsl.load(MODELS / "pronking-runner.yaml")


@pytest.mark.parametrize("gap", GAPS)
@pytest.mark.parametrize("tolerance", [1e-3, 1e-6, 1e-9])
@pytest.mark.parametrize("method", ["dopri5", "dop853", "taylor"])
def test_both_feet_touch_down(runner, method, tolerance, gap):
    for first, tilt in (("left", -gap), ("right", gap)):
        run = runner.simulate(
            until=0.3, scheme="located", method=method, tolerance=tolerance, initial={"th": tilt * FALLING}
        )
        edges = [t.edge for t in run.transitions]
        together = run.transitions[1].time - run.transitions[0].time <= TIE
        assert edges == [f"aerial->{first}", f"{first}->ground"] or (gap <= TIE and together)
        assert run.transitions[1].time - run.transitions[0].time == pytest.approx(gap, rel=0.01, abs=1.1 * TIE)
        assert run.verdict.theorem in ("holds", "unknown")
