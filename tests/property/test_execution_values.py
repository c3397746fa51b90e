"""An execution's values against closed forms, over random balls and times."""

from __future__ import annotations

import hand_made
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hsdsl.base.numbers import decimals

BALLS = st.fixed_dictionaries(
    {
        "bounces": st.integers(0, 6),
        "wait": st.sampled_from([0.0, 0.125, 0.01]),
        "restitution": st.sampled_from(["0.5", "0.9", "1"]),
        "pieces": st.integers(1, 4),
    }
)


def exact(run, t):
    """Compute the state by walking through the transitions: free fall between them, rest in a strip."""
    start, h, v = 0.0, 2.0, 0.0
    for transition in run.transitions:
        if t < transition.time:
            break
        if t < transition.resumed:
            return 0.0, transition.before["v"]
        start, h, v = transition.resumed, 0.0, transition.after["v"]
    s = t - start
    return h + v * s - s * s / 2, v - s


@given(BALLS, st.lists(st.floats(0, 1), min_size=1, max_size=20))
def test_samples_lie_on_the_exact_solution(parameters, fractions):
    run = hand_made.bouncing_ball(**parameters)
    times = np.array(fractions) * run.times[-1]
    samples = run.sample(times)
    expected = np.array([exact(run, t) for t in times])
    np.testing.assert_allclose(np.stack([samples["h"], samples["v"]], axis=1), expected, rtol=0, atol=2e-14)


@given(BALLS, st.floats(0, 1), st.sampled_from(["left", "right"]))
def test_a_point_is_the_sample(parameters, fraction, side):
    run = hand_made.bouncing_ball(**parameters)
    t = fraction * run.times[-1]
    point, samples = run(t, side), run.sample([t], side)
    assert (point.mode, point.jump, point.kind) == (samples.mode[0], samples.jump[0], samples.kind[0])
    assert [point["h"], point["v"], point["energy"]] == [samples[name][0] for name in ("h", "v", "energy")]


@given(BALLS)
def test_at_rows_the_recorded_value_is_returned(parameters):
    run = hand_made.bouncing_ball(**parameters)
    last = np.searchsorted(run.times, run.times, side="right") - 1
    first = np.searchsorted(run.times, run.times, side="left")
    for side, row in (("right", last), ("left", first)):
        samples = run.sample(run.times, side)
        assert np.array_equal(np.stack([samples["h"], samples["v"]], axis=1), run.values[row])


@pytest.mark.parametrize("digits", [30, 80])
def test_more_digits_agree_with_fewer(digits):
    context = decimals.context_of(digits)
    fine = hand_made.bouncing_ball(restitution="0.9", convert=context.mpf, digits=digits)
    coarse = hand_made.bouncing_ball(restitution="0.9")
    times = np.linspace(0, float(coarse.times[-1]), 50)[:-1]
    np.testing.assert_allclose(fine.sample(times)["h"].astype(float), coarse.sample(times)["h"], rtol=0, atol=1e-13)
