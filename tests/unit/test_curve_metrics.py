"""Distances between executions written down by hand, where the answer is known exactly."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import hand_made
import numpy as np
import pytest
from curve_spaces import Apart, Bent, Line, Plane

from hsdsl.analysis.metrics.curves import rho
from hsdsl.analysis.metrics.labelled import profiles, rho_hat, skorokhod, sup_norm, tau_epsilon
from hsdsl.analysis.metrics.table import CURVE_METRICS, between
from hsdsl.analysis.store import load
from hsdsl.base.errors import UsageError
from hsdsl.base.numbers import decimals
from hsdsl.base.numbers.bernstein import bernstein, largest_norm, length, restrict

NAN = float("nan")


def ramp(*corners, mode="m", cuts=(), degree=0):
    """A state x along straight lines between (t, x) corners, with further rows at ``cuts``."""
    draft = hand_made.Draft((), degree=degree)
    times = sorted({*cuts, *(t for t, _ in corners)})
    values = np.interp(times, *zip(*corners, strict=True)).tolist()
    ends = [*values[1:], values[-1]]
    powers = [[[b - a]] + [[0.0]] * (degree - 1) if degree else [] for a, b in zip(values, ends, strict=True)]
    draft.arc(mode, ("x",), 0, [(t, [x], [], 0.0, p) for t, x, p in zip(times, values, powers, strict=True)])
    return draft.make()


def two_modes(switch, until=2.0, gone=("a", "b"), instant=None):
    """Follow x = t in one mode up to ``switch`` and in another after it; ``instant`` is a mode of no length between."""
    draft = hand_made.Draft()
    line = lambda t: (t, [t], [], 0.0, [])  # noqa: E731
    draft.arc(gone[0], ("x",), 0, [line(0.0), line(switch)])
    middle = [instant] if instant else []
    for j, mode in enumerate(middle, 1):
        draft.arc(mode, ("x",), j, [line(switch)])
    draft.arc(gone[1], ("x",), 1 + len(middle), [line(switch), line(until)])
    return draft.make()


def strip(wait, depth, until=2.0):
    """Follow x = t to 1, ``wait`` in a strip to its depth, then x = 1 + (t - 1 - wait)."""
    draft = hand_made.Draft()
    draft.arc("a", ("x",), 0, [(0.0, [0.0], [], 0.0, []), (1.0, [1.0], [], 0.0, [])])
    draft.arc("a", ("x",), 0, [(1.0, [1.0], [], 0.0, []), (1.0 + wait, [1.0], [], depth, [])], "strip")
    draft.transition(1.0, 1.0 + wait, "go", "a", "b", {"x": 1.0}, {"x": 1.0})
    draft.arc("b", ("x",), 1, [(1.0 + wait, [1.0], [], 0.0, []), (until, [until - wait], [], 0.0, [])])
    return draft.make()


# two runs, exact rho in the plane, where it is attained
PAIRS = {
    "straight lines": (ramp((0, 0), (2, 2)), ramp((0, 0), (2, 1)), 1.0, 2.0),
    "other breakpoints": (ramp((0, 0), (2, 2), cuts=(0.3, 1.1)), ramp((0, 0.5), (1, 0), (2, 2), cuts=(0.7,)), 1.0, 1.0),
    "other degrees": (ramp((0, 0), (2, 2), degree=4), ramp((0, 3), (2, 2)), 3.0, 0.0),
    "other lengths": (ramp((0, 0), (4, 4)), ramp((0, 0), (2, 1)), 1.0, 2.0),
    "a strip and none": (strip(0.25, 0.25), ramp((0, 0), (2, 2)), 0.25, None),
}


@pytest.mark.parametrize("space", [Plane(), Bent()], ids=["convex", "points only"])
@pytest.mark.parametrize("name", PAIRS)
def test_exact_distances_in_the_plane(name, space):
    a, b, expected, time = PAIRS[name]
    found = rho(a, b, space, gap=1e-3)
    assert found.lower <= expected + 1e-15
    assert found.upper >= expected
    assert found.upper - found.lower <= 1.1e-3 * expected + 1e-13
    if time is not None and isinstance(space, Plane) and not isinstance(space, Bent):
        assert found.time == pytest.approx(time, abs=1e-3)


ROUNDING = 1e-13  # what the ends are widened by, for states of about 1


@pytest.mark.parametrize("space", [Plane(), Bent()], ids=["convex", "points only"])
def test_curves_that_coincide_in_different_modes(space):
    """The distance is 0, and what can be certified falls with the number of points looked at, no faster."""
    found = rho(two_modes(1.0), two_modes(1.5), space)
    assert found.lower <= 2e-16
    assert found.upper < 1e-3
    assert "the search stopped after" in found.note


def test_of_several_transitions_at_one_instant_only_the_last_value_counts():
    found = rho(two_modes(1.0, instant="c"), two_modes(1.0), Plane())
    assert found.lower == 0.0 and found.upper < ROUNDING


class Counting(Bent):
    """Counts how many point distances it computes."""

    given = 0

    def between(self, p, q, enough=0.0):
        self.given += len(p.t)
        return super().between(p, q)


def test_few_point_distances_decide_many_samples():
    """Where no domain is known to be convex, stretches of samples are bounded together."""
    cuts = np.linspace(0, 2, 20_001)[1:-1]
    a, b = ramp((0, 0), (2, 2), cuts=cuts), ramp((0, 5), (2, 2.5), cuts=cuts[::3])
    space = Counting()
    found = rho(a, b, space)
    assert 5.0 - ROUNDING < found.lower <= 5.0 <= found.upper <= 5.0 * (1 + 2e-6)
    assert space.given < 200


class Clock(Bent):
    """The plane with time as a coordinate."""

    timed = True


def test_time_as_a_coordinate_counts_as_way():
    found = rho(ramp((0, 0), (2, 2)), ramp((0, 0.5), (2, 2.5)), Clock())
    assert found.lower == pytest.approx(0.5, abs=ROUNDING)
    assert 0.5 <= found.upper <= 0.5 * 1.002


def test_a_parabola_against_its_chord_is_bounded_between_samples():
    """On one piece x = t^2 against x = t: the difference is 1/4 at 1/2, and 0 at both samples."""
    draft = hand_made.Draft(degree=3)
    draft.arc("m", ("x",), 0, [(0.0, [0.0], [], 0.0, [[0.0], [1.0], [0.0]]), (1.0, [1.0], [], 0.0, [])])
    found = rho(draft.make(), ramp((0, 0), (1, 1)), Plane(), gap=1e-4)
    assert found.lower <= 0.25 <= found.upper <= 0.25 * (1 + 2e-4)
    assert found.time == pytest.approx(0.5, abs=0.01)


def test_values_are_compared_with_values_and_left_limits_with_left_limits():
    """Both jump from 1 to 5 at t = 1: comparing a left limit with a value would give 4."""
    draft = hand_made.Draft()
    draft.arc("m", ("x",), 0, [(0.0, [0.0], [], 0.0, []), (1.0, [1.0], [], 0.0, [])])
    draft.transition(1.0, 1.0, "go", "m", "m", {"x": 1.0}, {"x": 5.0})
    draft.arc("m", ("x",), 1, [(1.0, [5.0], [], 0.0, []), (2.0, [6.0], [], 0.0, [])])
    a = draft.make()
    b = replace(a, values=a.values + 0.25)
    assert rho(a, b, Plane()).lower == pytest.approx(0.25, abs=ROUNDING)
    assert sup_norm(a, b).lower == pytest.approx(0.25, abs=ROUNDING)
    assert rho_hat(a, b).lower == pytest.approx(0.25, abs=ROUNDING)


def test_the_value_at_the_very_end_counts():
    draft = hand_made.Draft()
    draft.arc("m", ("x",), 0, [(0.0, [0.0], [], 0.0, []), (1.0, [1.0], [], 0.0, [])])
    draft.transition(1.0, 1.0, "go", "m", "m", {"x": 1.0}, {"x": 5.0})
    draft.arc("m", ("x",), 1, [(1.0, [5.0], [], 0.0, [])])
    a, b = draft.make(), ramp((0, 0), (1, 1))
    assert rho(a, b, Plane()).lower == pytest.approx(4.0, abs=ROUNDING)
    assert skorokhod(a, b).lower > 3.9


def test_a_bounce_a_little_later_is_a_little_far_in_the_quotient_only():
    """Two balls, one dropped from a bit higher: at a bounce the states differ by 3, the balls do not."""
    a, b = hand_made.bouncing_ball(bounces=2), hand_made.bouncing_ball(bounces=2, height=2.002)
    space = Line(0.5, np.linspace(-2.2, 0, 2201))
    found = rho(a, b, space)
    assert found.upper < 0.02
    assert sup_norm(a, b).lower > 2.9


def test_a_strip_counts_by_its_depth_only_on_the_relaxed_space():
    a, b = strip(0.25, 0.25), strip(0.25, 0.125)
    assert rho(a, b, Plane()).upper < ROUNDING
    relaxed = rho(a, b, Plane(), relaxation=0.25)
    assert relaxed.lower == pytest.approx(0.125, abs=ROUNDING)
    assert relaxed.upper <= 0.125 * (1 + 2e-6)


def test_a_strip_deeper_than_the_space_is_refused():
    with pytest.raises(UsageError, match=r"0\.25 deep.*only 0\.1"):
        rho(strip(0.25, 0.25), strip(0.1, 0.1), Plane(), relaxation=0.1)


def test_infinite_where_there_is_no_path():
    found = rho(two_modes(1.0), two_modes(1.5), Apart())
    assert (found.lower, found.upper) == (math.inf, math.inf)
    assert 1.0 <= found.time <= 1.5


def test_no_common_time_is_refused():
    late = ramp((5, 0), (6, 1))
    for distance in (rho_hat, sup_norm, skorokhod, lambda a, b: rho(a, b, Plane())):
        with pytest.raises(UsageError, match="no time in common: one goes from 0 to 2, the other from 5 to 6"):
            distance(ramp((0, 0), (2, 2)), late)


def test_an_instant_in_common_is_enough():
    assert rho(ramp((0, 0), (2, 2)), ramp((2, 5), (3, 6)), Plane()).lower == pytest.approx(3.0, abs=ROUNDING)


def test_a_run_that_is_not_finite_is_refused():
    with pytest.raises(UsageError, match="not finite at t = 1"):
        sup_norm(hand_made.blow_up(), hand_made.blow_up())


def test_other_lengths_are_said():
    found = rho(ramp((0, 0), (4, 4)), ramp((0, 0), (2, 1)), Plane())
    assert found.span == (0.0, 2.0)
    assert found.note == "Compared from t = 0 to 2, which both cover."


RUNS = {
    "ball": lambda: hand_made.bouncing_ball(wait=0.125),
    "states that come and go": hand_made.modes_of_different_size,
    "jumping input": hand_made.jumping_input,
    "ends in a strip": hand_made.ends_in_strip,
    "thermostat": lambda: hand_made.thermostat(3),
}


@pytest.mark.parametrize("metric", ["rho", "sup", "rho-hat", "skorokhod"])
@pytest.mark.parametrize("run", RUNS)
def test_zero_against_itself_and_against_the_saved_run(run, metric, tmp_path):
    a = RUNS[run]()
    a.save(tmp_path / "run.npz")
    request = a, load(tmp_path / "run.npz"), lambda depth: Plane()
    if metric == "rho-hat" and run == "states that come and go":
        with pytest.raises(UsageError, match="these runs have none"):
            between(metric, *request)
        return
    found = between(metric, *request)
    assert found.lower == 0.0
    assert found.upper == 0.0


@pytest.mark.parametrize("run", RUNS)
def test_closeness_of_a_run_to_itself_is_within_the_resolution(run):
    found = tau_epsilon(RUNS[run](), RUNS[run]())
    assert found.lower == 0.0
    assert found.upper < 0.05


def test_rho_hat_takes_the_first_runs_times_and_the_coordinates_asked_for():
    a, b = hand_made.bouncing_ball(pieces=4), hand_made.bouncing_ball(pieces=4, height=2.25)
    both = rho_hat(a, b).lower
    heights = rho_hat(a, b, ("h",))
    samples = np.unique(a.times[a.times <= b.times[-1]])
    by_hand = max(
        float(np.max(np.abs(a.sample(samples, side)["h"] - b.sample(samples, side)["h"]))) for side in ("left", "right")
    )
    assert heights.lower == pytest.approx(by_hand, rel=1e-14)
    assert heights.lower < both
    with pytest.raises(UsageError, match="no state 'w'"):
        rho_hat(a, b, ("w",))
    with pytest.raises(UsageError, match="no coordinates are given"):
        rho_hat(a, b, ())
    with pytest.raises(UsageError, match="not every mode visited has the state 'z'"):
        rho_hat(hand_made.modes_of_different_size(), hand_made.modes_of_different_size(), ("z",))


def test_modes_that_differ_are_one_apart():
    a, b = two_modes(1.0), two_modes(1.5)
    found = sup_norm(a, b)
    assert 1.0 - ROUNDING < found.lower <= 1.0 <= found.upper < 1.0 + ROUNDING
    assert sup_norm(a, two_modes(1.0, gone=("a", "c"))).lower == pytest.approx(1.0, abs=ROUNDING)
    shared = skorokhod(a, b)
    assert shared.lower <= 0.5 <= shared.upper <= 0.51  # the switch is retimed by 1/2, and x = t with it
    assert shared.lower == 0.5  # no retiming moves the switch by less
    other = skorokhod(a, two_modes(1.0, gone=("a", "c")))
    assert other.lower == 1.0


def test_a_state_that_a_mode_lacks_counts_as_zero():
    run = hand_made.modes_of_different_size()
    without = replace(run, arcs=run.arcs[:-1], **{
        name: getattr(run, name)[:-1] for name in ("times", "values", "outputs", "depth", "coefficients")
    })  # fmt: skip
    # at the end the one has (x, y) = (9, 6) in mode a, the other (y, w) = (6, -1) in mode end
    assert sup_norm(run, without).lower == pytest.approx(1 + math.hypot(9, 1), rel=1e-15)


def test_skorokhod_retimes_a_delay():
    """A ramp from 0 to 1 during [1, 1.5], and the same later by 1/4: at the same time they differ by 1/2."""
    a = ramp((0, 0), (1, 0), (1.5, 1), (3, 1))
    b = ramp((0, 0), (1.25, 0), (1.75, 1), (3, 1))
    found = skorokhod(a, b, resolution=2000)
    # moving half the delay in time leaves half of it, at slope 2, in state: min over r of max(r, 2 (1/4 - r)) = 1/6
    assert found.lower <= 1 / 6 <= found.upper
    assert found.upper - found.lower < 0.0065


def test_skorokhod_moves_jumps_together():
    """A step of height 4 at t = 1, and at t = 1.125: retiming costs 1/8, not retiming 4."""

    def step(at):
        draft = hand_made.Draft()
        draft.arc("m", ("x",), 0, [(0.0, [0.0], [], 0.0, []), (at, [0.0], [], 0.0, [])])
        draft.transition(at, at, "go", "m", "m", {"x": 0.0}, {"x": 4.0})
        draft.arc("m", ("x",), 1, [(at, [4.0], [], 0.0, []), (2.0, [4.0], [], 0.0, [])])
        return draft.make()

    found = skorokhod(step(1.0), step(1.125))
    assert found.lower <= 0.125 <= found.upper < 0.13


def test_closeness_counts_jumps():
    a, b = hand_made.thermostat(3), hand_made.thermostat(4)
    assert tau_epsilon(a, b, tau=4.5).upper < 0.01
    assert tau_epsilon(a, b).lower < 0.01  # b's last jump is at t + j = 4 + 3 = 7, beyond which neither counts
    late = replace(a, times=a.times * 1.125)
    found = tau_epsilon(a, late, tau=7.0)
    # the longest way is from the beginning (3, 3) of a's last arc to that of the other's, (3.375, 3)
    assert found.lower <= 0.375 <= found.upper < 0.38
    # a makes its jump 3 at (3, 3); a run of two jumps never does
    assert tau_epsilon(a, hand_made.thermostat(2), tau=6.5).lower == math.inf


def test_closeness_sees_an_instant_in_another_mode():
    a, b = two_modes(1.0, instant="c"), two_modes(1.0, instant="d")
    assert tau_epsilon(a, b).lower == 1.0
    assert skorokhod(a, b).upper < ROUNDING  # right-continuous curves do not


def test_runs_of_different_models_are_refused():
    other = replace(hand_made.jumping_input(), digest="1" * 64)
    for metric in CURVE_METRICS:
        with pytest.raises(UsageError, match="runs are of different models"):
            between(metric, hand_made.jumping_input(), other, lambda depth: Plane())


def test_an_unknown_metric_is_refused_with_the_nearest():
    run = hand_made.jumping_input()
    with pytest.raises(UsageError, match="no distance 'skorohod' between runs") as caught:
        between("skorohod", run, run, lambda depth: Plane())
    assert caught.value.hint is not None and "skorokhod" in caught.value.hint


def test_multiprecision_runs_are_compared_with_floats():
    a = hand_made.bouncing_ball(convert=decimals.context_of(50).mpf, digits=50)
    assert rho(a, hand_made.bouncing_ball(), Plane()).upper <= 1e-14


RNG = np.random.default_rng(1)


@pytest.mark.parametrize("degree", range(1, 5))
def test_bernstein_bounds_hold_and_are_attained_by_lines(degree):
    powers = RNG.normal(size=(50, degree + 1, 3))
    begin = RNG.uniform(0, 0.5, 50)
    end = begin + RNG.uniform(0, 0.5, 50)
    part = restrict(powers, begin, end)
    u = np.linspace(0, 1, 201)
    s = begin[:, None] + u * (end - begin)[:, None]
    whole = sum(powers[:, k, None, :] * s[:, :, None] ** k for k in range(degree + 1))
    same = sum(part[:, k, None, :] * u[None, :, None] ** k for k in range(degree + 1))
    assert np.allclose(whole, same, rtol=0, atol=1e-13)
    norms = np.sqrt(np.sum(whole**2, axis=2)).max(axis=1)
    ways = np.sqrt(np.sum(np.diff(whole, axis=1) ** 2, axis=2)).sum(axis=1)
    assert (largest_norm(part) >= norms - 1e-12).all()
    assert (length(part) >= ways - 1e-12).all()
    assert np.allclose(bernstein(part)[:, 0], whole[:, 0])
    assert np.allclose(bernstein(part)[:, -1], whole[:, -1])
    if degree == 1:
        assert np.allclose(largest_norm(part), norms)
        assert np.allclose(length(part), ways)


@pytest.mark.parametrize("metric", CURVE_METRICS)
def test_every_metric_is_documented_and_answers_to_its_name(metric):
    theory = (Path(__file__).parents[2] / "docs" / "theory.md").read_text(encoding="utf-8")
    assert f"`{metric}`" in theory
    a, b = ramp((0, 0), (2, 2)), ramp((0, 0), (2, 1))
    found = between(metric, a, b, lambda depth: Plane())
    assert found.metric == metric
    assert found.lower <= 1.0 <= found.upper + 1e-12


def test_the_profile_holds_both_sides_of_a_transition():
    found = profiles(two_modes(1.0), two_modes(1.5), Plane())
    assert found["rho"].upper.max() < ROUNDING
    labels = found["sup"]
    assert labels.times.tolist() == [0.0, 1.0, 1.0, 1.5, 1.5, 2.0, 2.0, 2.0]
    assert labels.lower.tolist() == pytest.approx([0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0, 0.0], abs=ROUNDING)
