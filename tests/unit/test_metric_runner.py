"""Distances on the runner, whose guards, resets and domains are curved: against a fine graph, and by other means."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

import hsdsl
from hsdsl.analysis.metrics import guard_clearance
from hsdsl.analysis.metrics.guard_clearance import CERTAIN, OUTSIDE, UNDECIDED, segments_inside, to_passages
from hsdsl.analysis.metrics.points import SpacePoint, distance
from hsdsl.analysis.metrics.space import make_space
from hsdsl.interface.model.distances import distance_of_runs as between_runs

MODEL = Path(__file__).parents[2] / "models" / "pronking-runner.yaml"
PSI = np.pi / 5
TOUCHDOWN = np.cos(PSI)  # height of the body where both feet touch the ground, upright


@pytest.fixture(scope="module")
def space():
    return make_space(hsdsl.load(MODEL).system, (1, 1, 30, 1, 1, 9.81, float(PSI)))


@pytest.fixture(scope="module")
def model():
    return hsdsl.load(MODEL)


def slice_graph(p, q, samples):
    """The shortest way in the slice x = 0, th = w = 0 from a state in the air to one on the left leg.

    Coordinates are z, vx, vz and the foot's pl. In the slice both feet touch down at z = TOUCHDOWN, at any vx and
    vz <= 0, the left one at pl = 1/2 + sin(PSI). Nodes are points of the guard and their images.
    """
    vx, vz = np.meshgrid(np.linspace(-1, 1, samples), np.linspace(-2, 0, samples))
    guard = np.column_stack([np.full(vx.size, TOUCHDOWN), vx.ravel(), vz.ravel()])
    image = np.column_stack([guard, np.full(len(guard), 0.5 + np.sin(PSI))])
    first = np.linalg.norm(guard - p, axis=1)
    last = np.linalg.norm(image - q, axis=1)
    count = len(guard)
    # Nodes: 0 is p, 1 is q, then the guard points, then their images; a passage costs next to nothing.
    rows = np.concatenate([np.zeros(count), 2 + np.arange(count), 2 + count + np.arange(count)]).astype(int)
    columns = np.concatenate([2 + np.arange(count), 2 + count + np.arange(count), np.ones(count)]).astype(int)
    lengths = np.concatenate([first, np.full(count, 1e-12), last])
    graph = csr_array((lengths, (rows, columns)), shape=(2 + 2 * count, 2 + 2 * count))
    return float(dijkstra(graph, indices=0)[1])


SLICE = [((1.0, 0.0, -1.0), (0.85, 0.0, -1.0, 0.1)), ((0.9, 0.3, -0.5), (0.84, -0.2, -0.8, 0.05))]
SLICE += [((0.82, -0.5, -0.1), (0.9, 0.5, -0.4, 0.2))]


def in_slice(p, q):
    foot = 0.5 + np.sin(PSI) - q[3]
    start = SpacePoint("aerial", (0, p[0], 0, p[1], p[2], 0))
    return start, SpacePoint("left", (0, q[0], 0, q[1], q[2], 0, foot)), (*q[:3], foot)


@pytest.mark.parametrize(("p", "q"), SLICE)
def test_runner_is_no_farther_than_a_fine_graph_in_a_slice(space, p, q):
    """The slice's shortest way is one way of the whole space, so an upper bound, up to the graph's resolution."""
    start, end, corner = in_slice(p, q)
    found = distance(space, start, end)
    graph = slice_graph(np.array(p), np.array(corner), 120)
    assert found.interval.lower <= graph
    assert found.interval.upper <= graph * (1 + 1e-9)


@pytest.mark.slow
@pytest.mark.parametrize(("p", "q"), SLICE)
def test_runner_in_the_slice_is_the_fine_graph(space, p, q):
    """Held to the slice by hand, the solver's own problem has the graph's answer, to the graph's resolution."""
    from scipy.optimize import minimize

    start, end, corner = in_slice(p, q)
    samples = 800
    graph = slice_graph(np.array(p), np.array(corner), samples)
    ahead = 0.5 + np.sin(PSI)

    def length(s):
        guard = np.array([TOUCHDOWN, s[0], s[1]])
        return np.linalg.norm(guard - p) + np.linalg.norm([*(guard - corner[:3]), ahead - corner[3]])

    best = minimize(length, (0, -0.5), bounds=[(-1, 1), (-2, 0)], tol=1e-14).fun
    # The best grid point is half a spacing off both ways; a leg's second derivative is at most 1/height.
    offset, heights = 1 / (samples - 1), (p[0] - TOUCHDOWN, abs(q[0] - TOUCHDOWN))
    assert best - 1e-9 <= graph <= best + offset**2 * sum(1 / height for height in heights)
    assert distance(space, start, end).interval.upper <= best * (1 + 1e-9)


def random_states(rng, count):
    """States in the air, high enough to be inside."""
    low, high = (-1, 0.9, -0.2, -1, -2, -1), (1, 1.4, 0.2, 1, 0, 1)
    return rng.uniform(low, high, size=(count, 6))


def foot_heights(x):
    z, th = x[:, 1], x[:, 2]
    return np.column_stack([z + s * 0.5 * np.sin(th) - np.cos(PSI + th) for s in (1, -1)])


def test_the_way_to_the_nearest_guard_is_never_more_than_to_any_of_its_points(space):
    rng = np.random.default_rng(1)
    x = random_states(rng, 20)
    least = to_passages(space, 0, x)
    assert np.all(least > 0)
    th = rng.uniform(-0.5, 0.5, 4000)
    side = rng.choice((-1, 1), 4000)
    z = np.cos(PSI + th) - side * 0.5 * np.sin(th)
    for k in range(len(x)):  # guard points that differ from x in z and th alone are the nearest ones
        nearest = np.min(np.hypot(z - x[k, 1], th - x[k, 2]))
        assert 0.5 * nearest <= least[k] <= nearest


def test_straight_pieces_are_judged_as_many_points_say(space):
    rng = np.random.default_rng(2)
    low, high = (-1, 0.5, -1, -1, -2, -1), (1, 1.2, 1, 1, 0, 1)
    a, b = rng.uniform(low, high, size=(300, 6)), rng.uniform(low, high, size=(300, 6))
    verdicts = segments_inside(space, 0, a, b)
    shares = np.linspace(0, 1, 1001)[:, None]
    seen = np.array([foot_heights(p + shares * (q - p)).min() for p, q in zip(a, b, strict=True)])
    assert np.all(verdicts[seen < -1e-6] == OUTSIDE)
    assert np.all(verdicts[seen > 1e-6] == CERTAIN)
    assert {OUTSIDE, CERTAIN} <= set(verdicts.tolist())


def test_a_straight_line_far_from_every_guard_is_certified(space):
    p, q = (0, 1.3, 0, 0, -1, 0), (0.05, 1.32, 0.01, 0, -1.05, 0)
    found = distance(space, SpacePoint("aerial", p), SpacePoint("aerial", q))
    assert np.linalg.norm(np.subtract(p, q)) in found.interval
    assert found.interval.width < 1e-12
    assert found.certified == "certified"


def test_a_path_bends_around_a_corner_of_its_domain(space):
    """On the ground, both points at the right foot's height 0 and the straight line below it."""
    left = [0.8281199055613102, TOUCHDOWN, 0.0, 3.4, -2.3893694922224857, 0.0, 1.9159051578537833]
    th, x = -0.096, 0.8276
    right = [x, np.cos(PSI + th) + 0.5 * np.sin(th), th, 3.36, -2.31, -0.36, 1.7129]
    found = distance(space, SpacePoint("left", tuple(left)), SpacePoint("left", tuple(right)))
    straight = float(np.linalg.norm(np.subtract(left, right)))
    assert straight < found.interval.upper < straight * 1.05
    assert len(found.path) >= 2


def test_rho_of_two_runs_of_the_runner(model):
    a, b = model.simulate(), model.simulate(initial={"w": -0.4})
    found = between_runs(a, b, model=model)
    assert found.time == pytest.approx(0.66839, abs=1e-4)
    # At the end the difference of the six states that no passage changes is what the distance is at least.
    names = ("x", "z", "th", "vx", "vz", "w")
    at = [run.sample([found.time]) for run in (a, b)]
    least = np.linalg.norm([at[0][n][0] - at[1][n][0] for n in names])
    assert found.lower == pytest.approx(least, rel=1e-6)
    assert found.upper <= found.lower * 1.011


def test_a_distance_keeps_to_its_seconds_and_says_so(model):
    a, b = model.simulate(), model.simulate(initial={"w": -0.4})
    found = between_runs(a, b, model=model, seconds=1e-3)
    assert "the 0.001 seconds it was given were over" in found.note
    assert 0 < found.lower <= 2.882014 <= found.upper
    with pytest.raises(hsdsl.UsageError, match="positive number of seconds"):
        between_runs(a, b, model=model, seconds=0)


def test_formulas_take_no_boxes(space):
    none = np.zeros((0, 6))
    for formula in space.domains[0].curved:
        m, n = formula.jacobian(np.ones(6)).shape
        assert all(end.shape == (0, m) for end in formula.ranges(none, none))
        assert all(end.shape == (0, m, n) for end in formula.slopes(none, none))


def test_pieces_that_may_not_be_cut_are_judged_by_points(space, monkeypatch):
    monkeypatch.setattr(guard_clearance, "MOST_PARTS", 0)  # nothing is left to cut in halves
    rng = np.random.default_rng(2)
    low, high = (-1, 0.5, -1, -1, -2, -1), (1, 1.2, 1, 1, 0, 1)
    a, b = rng.uniform(low, high, size=(100, 6)), rng.uniform(low, high, size=(100, 6))
    verdicts = segments_inside(space, 0, a, b)
    seen = np.array([foot_heights(np.vstack([p, q])).min() for p, q in zip(a, b, strict=True)])
    assert np.all(verdicts[seen < -1e-6] == OUTSIDE)
    assert UNDECIDED in verdicts


@pytest.mark.filterwarnings("error")
def test_slopes_without_bounds_prove_nothing():
    """Where x and z stay at zero, roots of both have no bounded slopes, and pieces are outside by y alone."""
    text = (
        "hsdsl: 1\nmodes: {m: {flow: {x: 0, y: 1, z: 0}, domain: [sqrt(abs(x)) + sqrt(abs(z)) + 1.3 <= y**2]}}\n"
        "initial: {mode: m, x: 0, y: 2, z: 0}\nexperiment: {until: 1}\n"
    )
    space = make_space(hsdsl.loads(text).system, ())
    a = np.array([[0, -2.5, 0], [0, 1.2, 0], [0, -1.2, 0], [-0.1, 2, -0.1]])
    b = np.array([[0, 1.9, 0], [0, 2.4, 0], [0, -3, 0], [0.1, 2, 0.1]])
    assert segments_inside(space, 0, a, b).tolist() == [OUTSIDE, CERTAIN, CERTAIN, CERTAIN]
