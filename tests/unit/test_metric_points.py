"""Distances between points: closed forms, the solver against Clarabel, many pairs against one pair."""

from __future__ import annotations

import numpy as np
import pytest
from shipped import MODELS

import hsdsl
from hsdsl.analysis.metrics.gate_sequence import ConeShape, solve
from hsdsl.analysis.metrics.interval import INFINITE, ZERO
from hsdsl.analysis.metrics.points import SpacePoint, distance, distances
from hsdsl.analysis.metrics.space import make_space
from hsdsl.base.errors import UsageError

QUADRANTS = {"D0": (-1, -1), "D1": (-1, 1), "D2": (1, -1), "D3": (1, 1)}
OSCILLATOR = "oscillator-with-stop-1"


def space_of(name, *parameters):
    system = hsdsl.load(MODELS / f"{name}.yaml").system
    return make_space(system, parameters or [float(p.value) for p in system.parameters])


@pytest.fixture(scope="module")
def oscillator():
    return space_of(OSCILLATOR)


@pytest.fixture(scope="module")
def quadrants():
    return space_of("digital-control")


# In the plane with the line x = 14 glued by v -> -0.9 v: at the stop, the way along the image is shorter by a tenth.
AT_THE_STOP = [
    ((14, 10), (14, 20), 9.0),
    ((14, 10), (14, -20), 11.0),
    ((14, -5), (14, 4.5), 0.95),
    ((14, 7), (14, -6.3), 0.0),
    ((14, 0), (14, 1), 0.9),
    ((14, 0), (14, -1), 1.0),
    ((3, 2), (6, -2), 5.0),
]


@pytest.mark.parametrize(("p", "q", "expected"), AT_THE_STOP)
def test_oscillator_distances_at_the_stop(oscillator, p, q, expected):
    found = distance(oscillator, SpacePoint("free", p), SpacePoint("free", q))
    assert expected in found.interval
    assert found.interval.width <= 1e-9 * max(expected, 1e-3)
    assert found.certified == "certified"


# Three spheres at contact, the first with speed 1: strips 1e-3 deep, and how far their ends are from places at rest.
EXCHANGES = [
    ("first", SpacePoint("row", (0, 1, 1, 0, 2, 0, 3, 0)), 1e-3),
    ("first", SpacePoint("row", (0, 0, 1, 1, 2, 0, 3, 0)), 0.0),
    ("second", SpacePoint("row", (0, 1, 1, 0, 2, 0, 3, 0)), 0.0),
    ("second", SpacePoint("row", (0, 0, 1, 1, 2, 0, 3, 0)), 1e-3),
    ("third", SpacePoint("row", (0, 1, 1, 0, 2, 0, 3, 0), "third", 5e-4), 5e-4),
]


@pytest.mark.parametrize("hops", [0, 1, None])
@pytest.mark.parametrize(("edge", "q", "expected"), EXCHANGES)
def test_the_end_of_a_strip_costs_what_is_left_of_it(edge, q, expected, hops):
    p = SpacePoint("row", (0, 1, 1, 0, 2, 0, 3, 0), edge, 1e-3)
    found = distance(space_of("gallery/cascade"), p, q, relaxation=1e-3, hops=hops).interval
    assert found.lower <= expected * (1 + 1e-9) and (
        found.upper == pytest.approx(expected, abs=2e-12) or hops in (0, 1)
    )


@pytest.mark.parametrize(("p", "q", "expected"), AT_THE_STOP)
def test_passages_of_the_relaxed_space_cost_the_relaxation(oscillator, p, q, expected):
    found = distance(oscillator, SpacePoint("free", p), SpacePoint("free", q), relaxation=1e-3)
    passages = sum(piece.edge is not None for piece in found.path)
    assert expected + 1e-3 * passages in found.interval


def test_path_is_a_path_of_the_length_it_claims(oscillator):
    found = distance(oscillator, SpacePoint("free", (13, 5)), SpacePoint("free", (13, -4)))
    first, second = found.path
    assert first.edge == "impact" and first.end[0] == pytest.approx(14)
    assert second.start == pytest.approx((14, -0.9 * first.end[1]))
    length = sum(np.hypot(*np.subtract(piece.start, piece.end)) for piece in found.path)
    assert length == pytest.approx(found.interval.upper, rel=1e-12)


def test_digital_control_is_the_plane(quadrants):
    rng = np.random.default_rng(7)
    for mode, signs in QUADRANTS.items():
        for other, other_signs in QUADRANTS.items():
            p, q = np.abs(rng.normal(size=2)) * signs, np.abs(rng.normal(size=2)) * other_signs
            found = distance(quadrants, SpacePoint(mode, tuple(p)), SpacePoint(other, tuple(q)))
            assert np.hypot(*(p - q)) in found.interval
            assert found.interval.width < 1e-8
            assert found.certified == "certified"


@pytest.mark.parametrize("d", [1e-1, 1e-3, 1e-6])
def test_distances_of_the_digital_control_runs_at_their_end(quadrants, d):
    y, z = SpacePoint("D3", (1 - d, 1 - 0.2 * d)), SpacePoint("D3", (1 - 0.3 * d, 1 - d))
    expected = np.hypot(0.7, 0.8)  # 1.063015 d
    assert distance(quadrants, y, z).interval.middle / d == pytest.approx(expected, rel=1e-6 if d > 1e-6 else 1e-5)


def strip(v, depth):
    return SpacePoint("free", (14, v), "impact", depth)


STRIPS = [
    (strip(5, 2e-4), strip(5, 7e-4), 5e-4),  # inside the strip
    (strip(5, 2e-4), strip(6, 7e-4), 0.9 + 11e-4),  # on to the image, where the way is shorter, and back
    (strip(0.001, 2e-4), strip(0.002, 2e-4), 1e-3),  # inside: two more strips' ends would cost more than they save
    (strip(5, 3e-4), SpacePoint("free", (13, 5)), 1 + 3e-4),  # back out
    (strip(5, 3e-4), SpacePoint("free", (14, -4.5)), 7e-4),  # on
    (
        strip(5, 3e-4),
        SpacePoint("free", (14, 6)),
        0.9 + 7e-4 + 1e-3,
    ),  # on, along the image, and back through a whole strip
]


@pytest.mark.parametrize(("p", "q", "expected"), STRIPS)
def test_points_of_strips(oscillator, p, q, expected):
    for found in (distance(oscillator, p, q, relaxation=1e-3), distance(oscillator, q, p, relaxation=1e-3)):
        assert expected in found.interval
        assert found.interval.width < 1e-9


def test_on_the_quotient_a_point_of_a_strip_counts_as_its_guard_point(oscillator):
    found = distance(oscillator, strip(5, 3e-4), SpacePoint("free", (14, -4.5)))
    assert 0.0 in found.interval and found.interval.upper < 1e-12


def test_same_point_and_no_path(oscillator):
    assert distance(oscillator, SpacePoint("free", (1, 2)), SpacePoint("free", (1, 2))).interval == ZERO
    text = (
        "hsdsl: 1\nmodes:\n  a: {flow: {x: 1}}\n  b: {flow: {x: 1}}\ninitial: {mode: a, x: 0}\nexperiment: {until: 1}\n"
    )
    space = make_space(hsdsl.loads(text).system, [])
    assert distance(space, SpacePoint("a", (0,)), SpacePoint("b", (0,))).interval == INFINITE
    lower, upper, _ = distances(space, "a", np.zeros((3, 1)), "b", np.zeros((3, 1)))
    assert np.all(lower == np.inf) and np.all(upper == np.inf)


def test_no_path_has_more_passages_than_asked_for():
    """Each passage halves v, so that n of them leave 16 / 2**n - 1 to go from 16 to 1."""
    text = (
        "hsdsl: 1\nmodes:\n  a:\n    flow: {x: 1, v: 0}\n"
        "    transitions: [{when: x >= 0, to: a, reset: {v: v/2}}]\n"
        "initial: {mode: a, x: -1, v: 1}\nexperiment: {until: 1}\n"
    )
    space = make_space(hsdsl.loads(text).system, [])
    for hops, expected in enumerate((15, 7, 3, 1, 0)):
        found = distance(space, SpacePoint("a", (0, 16)), SpacePoint("a", (0, 1)), hops=hops)
        assert found.interval.lower == 0  # for any cap: four passages lead there
        assert expected <= found.interval.upper < expected + 1e-9
        assert len(found.path) - 1 == hops
        assert found.status == f"up to {hops} hops" or expected == 0


@pytest.mark.parametrize("hops", [-1, 1.5, float("nan")])
def test_hops_are_counted(hops):
    model = hsdsl.load(MODELS / "oscillator-with-stop-1.yaml")
    with pytest.raises(UsageError, match="whole number"):
        model.distance("free x=1 v=2", "free x=1 v=3", hops=hops)


def test_guard_on_time_makes_time_a_coordinate():
    text = (
        "hsdsl: 1\nmodes:\n  a:\n    flow: {x: 1}\n    transitions: [{when: t >= 2, to: b}]\n"
        "  b: {flow: {x: -1}}\ninitial: {mode: a, x: 0}\nexperiment: {until: 3}\n"
    )
    space = make_space(hsdsl.loads(text).system, [])
    assert space.timed
    found = distance(space, SpacePoint("a", (0,), t=1.0), SpacePoint("b", (3,), t=5.0))
    assert 5.0 in found.interval and found.interval.width < 1e-9
    with pytest.raises(ValueError, match="time is a coordinate"):
        distance(space, SpacePoint("a", (0,)), SpacePoint("b", (3,), t=5.0))


@pytest.mark.parametrize(
    ("condition", "expected"),
    [("y >= 1", np.hypot(1, 2) * 2 - 0), ("y >= -1 and y <= 1", 2.0), ("y >= 2 or y <= -1", 2 * np.hypot(1, 1))],
)
def test_condition_says_which_part_of_the_surface_is_the_guard(condition, expected):
    if condition == "y >= 1":
        expected = 2 * np.hypot(1, 1)
    text = (
        "hsdsl: 1\nmodes:\n  a:\n    flow: {x: 1, y: 0}\n"
        f"    transitions: [{{when: x >= 0, if: {condition}, to: b}}]\n"
        "  b: {flow: {x: 1, y: 0}}\ninitial: {mode: a, x: -1, y: 0}\nexperiment: {until: 3}\n"
    )
    space = make_space(hsdsl.loads(text).system, [])
    found = distance(space, SpacePoint("a", (-1, 0)), SpacePoint("b", (1, 0)))
    assert expected in found.interval and found.interval.width < 1e-9


@pytest.mark.parametrize("relaxation", [None, 1e-3])
@pytest.mark.parametrize(("name", "modes"), [(OSCILLATOR, ("free", "free")), ("digital-control", ("D0", "D3"))])
def test_many_pairs_at_once_are_the_pairs_one_by_one(name, modes, relaxation):
    space, rng = space_of(name), np.random.default_rng(11)
    p, q = rng.normal(size=(40, 2)), rng.normal(size=(40, 2))
    if name == OSCILLATOR:
        p, q = (np.column_stack([14 - np.abs(x[:, 0]), 6 * x[:, 1]]) for x in (p, q))
    else:
        p, q = -np.abs(p), np.abs(q)
    lower, upper, status = distances(space, modes[0], p, modes[1], q, relaxation)
    assert status == "certified"
    assert np.all(upper - lower <= 1e-8 * upper)
    for k in range(len(p)):
        alone = distance(
            space, SpacePoint(modes[0], tuple(p[k])), SpacePoint(modes[1], tuple(q[k])), relaxation
        ).interval
        assert alone.lower <= upper[k] and lower[k] <= alone.upper


@pytest.mark.parametrize("seed", range(12))
def test_problems_solved_together_have_the_minima_of_each(seed):
    rng = np.random.default_rng(seed)
    unknowns, legs, count = int(rng.integers(2, 6)), int(rng.integers(3, 6)), 8
    matrices = [rng.normal(size=(2, unknowns)) for _ in range(legs)]
    offsets = [rng.normal(size=(count, 2)) * 10 ** rng.uniform(-3, 2) for _ in range(legs)]
    normals = rng.normal(size=(int(rng.integers(1, 5)), unknowns))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    inner, room = rng.normal(size=unknowns), 10 ** rng.uniform(-3, 0, size=len(normals))
    levels = normals @ inner + room
    shape = ConeShape(tuple(matrices), normals, levels, inner, room)
    numbers = np.array([sum(np.linalg.norm(o[k]) for o in offsets) for k in range(count)])
    together = np.hstack(offsets)
    lower, upper, s = solve(shape, together, numbers)
    assert np.all(s @ normals.T <= levels)
    for k in range(count):
        (below,), (above,), _ = solve(shape, together[k : k + 1], numbers[k : k + 1])
        assert above - below <= 1e-9 * above + 1e-13 * np.abs(together).max()
        assert lower[k] <= above * (1 + 1e-12) and below <= upper[k] * (1 + 1e-12)
        assert upper[k] - lower[k] <= 1e-9 * upper[k] + 1e-13 * np.abs(together).max()


def test_runner_through_a_curved_guard_in_a_slice():
    # In the slice x = 0, th = w = 0 both legs touch down together, at z = cos(pi/5).
    space = space_of("pronking-runner", 1, 1, 30, 1, 1, 9.81, float(np.pi / 5))
    ahead = 0.5 + np.sin(np.pi / 5)
    p, q = SpacePoint("aerial", (0, 1, 0, 0, -1, 0)), SpacePoint("left", (0, 0.85, 0, 0, -1, 0, ahead - 0.1))
    found = distance(space, p, q)
    touchdown = np.cos(np.pi / 5)
    direct = (1 - touchdown) + np.hypot(0.85 - touchdown, 0.1)  # through the guard's point of the slice
    # Below: what no passage changes; above: the direct way.
    assert 0.15 * (1 - 1e-9) <= found.interval.lower <= found.interval.upper <= direct * (1 + 1e-9)
    assert "lower end certified" in found.certified


@pytest.mark.parametrize(
    ("place", "message"),
    [
        (SpacePoint("fre", (1, 2)), "no mode 'fre'"),
        (SpacePoint("free", (1,)), "coordinates x, v"),
        (SpacePoint("free", (14, 2), "impact", 2.0), "depth"),
        (SpacePoint("free", (14, 2), "bounce", 0.0), "no edge 'bounce'"),
    ],
)
def test_places_that_do_not_fit_are_refused(oscillator, place, message):
    with pytest.raises(ValueError, match=message):
        distance(oscillator, place, SpacePoint("free", (1, 2)), relaxation=1e-3)


@pytest.mark.parametrize(
    ("height", "shift"),
    [
        pytest.param(*place, marks=pytest.mark.campaign if k else pytest.mark.slow)
        for k, place in enumerate([(0.85, 0.1), (0.9, 0.3), (0.83, 0.2)])
    ],
)
def test_runner_against_another_optimiser_from_two_hundred_starts(height, shift):
    from scipy.optimize import minimize

    psi = np.pi / 5
    space = space_of("pronking-runner", 1, 1, 30, 1, 1, 9.81, float(psi))
    foot = 0.5 + np.sin(psi) - shift
    p, q = np.array([0, 1, 0, 0, -1, 0.0]), np.array([0, height, 0, 0, -1, 0, foot])

    def foot_height(x, side):
        return x[1] + side * 0.5 * np.sin(x[2]) - np.cos(psi + x[2])

    def beyond_aerial(x):
        return -min(foot_height(x, 1), foot_height(x, -1))

    def beyond_left(x):
        leg = np.hypot(x[0] + 0.5 * np.cos(x[2]) - x[6], x[1] + 0.5 * np.sin(x[2]))
        return max(leg - 1, -foot_height(x, -1))

    def length(free):
        # z is where the left foot touches down, th <= 0 since the right one does so later.
        x, vx, vz, w = free[:4]
        th = -(free[4] ** 2)
        z = np.cos(psi + th) - 0.5 * np.sin(th)
        hip = x + 0.5 * np.cos(th)
        guard = np.array([x, z, th, vx, vz, w])
        image = np.array([*guard, hip + np.sin(psi + th)])
        rate = vz + w * (0.5 * np.cos(th) + np.sin(psi + th))  # of the left foot's height: not upwards
        pieces = [(p + share * (guard - p), image + share * (q - image)) for share in np.linspace(0, 1, 17)]
        outside = max(max(beyond_aerial(a), beyond_left(b)) for a, b in pieces)
        return np.linalg.norm(guard - p) + np.linalg.norm(image - q) + 1e3 * (max(rate, 0.0) + max(outside, 0.0))

    rng = np.random.default_rng(0)
    starts = rng.normal(size=(200, 5)) * (0.3, 0.3, 0.3, 0.3, 0.5) + (0, 0, -1, 0, 0)
    best = min(minimize(length, start, method="Powell", options={"xtol": 1e-9, "ftol": 1e-12}).fun for start in starts)
    found = distance(space, SpacePoint("aerial", tuple(p)), SpacePoint("left", tuple(q)))
    assert found.interval.upper <= best * (1 + 1e-6)
    assert found.interval.lower <= best


TANKS = """
hsdsl: 1
modes:
  pumping:
    flow: {h1: 0.6 - 0.3*sqrt(h1), h2: 0.6*sqrt(h1) - 0.4*sqrt(h2)}
    domain: [h1 >= 0, h2 >= 0]
    transitions: [{name: full, when: h1 >= 1.5, to: draining}]
  draining:
    flow: {h1: -0.3*sqrt(h1), h2: 0.6*sqrt(h1) - 0.4*sqrt(h2)}
    domain: [h1 >= 0, h2 >= 0]
    transitions: [{name: empty, when: h1 <= 0.5, to: pumping}]
initial: {mode: pumping, h1: 1, h2: 0.5}
experiment: {until: 60}
"""


def test_runs_that_are_near_are_near_through_every_guard():
    """Through the other guard the way is 2 long, and a path by it was all that was known when this guard came."""
    model = hsdsl.loads(TANKS)
    relaxed = model.simulate(scheme="relaxed", method="taylor", tolerance=1e-5, relaxation=1e-7)
    exact = model.simulate(tolerance=1e-13)
    found = hsdsl.distance(relaxed, exact, model=model)
    assert 1e-6 < found.lower <= found.upper <= 1.01 * found.lower
