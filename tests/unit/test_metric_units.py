"""Distances on affine models in any units: no end is ever false, whatever the rows, lengths and origins are."""

from __future__ import annotations

import numpy as np
import pytest
from affine_scenes import UNITS, BruteForce, path_fault, random_point, random_scene, text_of

import hsdsl
from hsdsl.analysis.metrics import search as passage_bounds
from hsdsl.analysis.metrics.gate_sequence import solve
from hsdsl.analysis.metrics.interval import Budget, EndsCross, Interval, weakest
from hsdsl.analysis.metrics.points import SpacePoint, distance, distances
from hsdsl.analysis.metrics.search import followers, hops_of
from hsdsl.analysis.metrics.space import make_space
from hsdsl.base.errors import UsageError

HEAD = "hsdsl: 1\ninputs: {u: sin(t)}\nmodes:\n"
TAIL = "initial: {mode: a, x: 0, y: 0}\nexperiment: {until: 1}\n"


def space_of(text):
    return make_space(hsdsl.loads(text).system, [])


def measured(space, scene, mode, x, units):
    return SpacePoint(f"m{mode}", tuple(float(v) for v in units.point(scene, mode, x)))


def faults(seeds, pairs, tolls=(None, 0.05)):
    """What is false in the distances of random scenes, each in all units; and how many were measured."""
    found, count = [], 0
    for seed in seeds:
        rng = np.random.default_rng(seed)
        scene = random_scene(rng)
        brute = BruteForce(scene)
        ends = [(random_point(rng, scene), random_point(rng, scene)) for _ in range(pairs)]
        toll = tolls[seed % len(tolls)]
        exact = [brute.distance(p, q, toll or 0.0) for p, q in ends]
        for number, units in enumerate(UNITS):
            written = units.write(scene)
            space = space_of(text_of(written))
            unit = float(units.length)
            for (p, q), expected in zip(ends, exact, strict=True):
                a, b = measured(space, scene, *p, units), measured(space, scene, *q, units)
                answer = distance(space, a, b, None if toll is None else toll * unit)
                if fault := _fault(answer, written, (p[0], a.x), (q[0], b.x), expected * unit, (toll or 0.0) * unit):
                    found.append((seed, number, fault))
                count += 1
    return found, count


def _fault(answer, scene, p, q, expected, toll):
    """A lower end above a path's length, or an upper end that no path has; the ends' own rounding is allowed for."""
    lower, upper = answer.interval.lower, answer.interval.upper
    size = sum(map(abs, (*p[1], *q[1])))
    if lower > expected * (1 + 1e-9) + 4e-16 * size:
        return f"lower end {lower}, and a path of {expected}"
    return path_fault(scene, p, q, answer.path, upper, toll) if 0 < upper < np.inf else None


def test_no_false_end_in_eight_units():
    found, count = faults(range(8), 2)
    assert found == [] and count == 128


@pytest.mark.campaign
@pytest.mark.parametrize("block", range(10))
def test_two_thousand_distances_in_eight_units(block):
    found, count = faults(range(40 * block, 40 * block + 40), 5)
    assert found == [] and count == 1600


@pytest.mark.parametrize("seed", range(6))
def test_ends_in_more_dimensions_agree_in_all_units(seed):
    """No brute force there: intervals of one distance, each divided by its unit, have to meet."""
    rng = np.random.default_rng(100 + seed)
    scene = random_scene(rng, dimensions=(3, 4), modes=2, edges=2)
    p, q = random_point(rng, scene), random_point(rng, scene)
    lower, upper = 0.0, np.inf
    for units in UNITS:
        written = units.write(scene)
        space = space_of(text_of(written))
        a, b = measured(space, scene, *p, units), measured(space, scene, *q, units)
        answer = distance(space, a, b, hops=3)
        if 0 < answer.interval.upper < np.inf:
            assert path_fault(written, (p[0], a.x), (q[0], b.x), answer.path, answer.interval.upper) is None
        off = 4e-16 * sum(map(abs, (*a.x, *b.x))) / float(units.length)
        lower = max(lower, answer.interval.lower / float(units.length) - off)
        upper = min(upper, answer.interval.upper / float(units.length) + off)
    assert lower <= upper


# A guard, the reset, two points that it makes one, and the walls: every numbers' size where a test against 1 misleads.
ONE_POINT = {
    "oblique, coefficients of 1e5": ("100000*x + 70000*y >= 300000", "x: -x, y: y", (3, 0), (-3, 0)),
    "coefficients below 1e-12": ("1e-13*x + 1e-13*y >= 1e-13", "x: x - 10, y: y", (1, 0), (-9, 0)),
    "constants of 2e6": ("x >= 2000001", "x: x - 2000000, y: y", (2000001, 3), (1, 3)),
    "lengths of 1e-9": ("x >= 1e-9", "x: -x, y: y/2", (1e-9, 2e-10), (-1e-9, 1e-10)),
    "lengths of 1e-20": ("1e20*x >= 1", "x: 0, y: y", (1e-20, 3e-20), (0, 3e-20)),
}


@pytest.mark.parametrize("name", ONE_POINT)
def test_a_point_and_its_image_are_one_in_any_units(name):
    when, reset, guard, image = ONE_POINT[name]
    space = space_of(
        f"{HEAD}  a:\n    flow: {{x: u, y: u}}\n    transitions: [{{when: {when}, to: a, reset: {{{reset}}}}}]\n{TAIL}"
    )
    found = distance(space, SpacePoint("a", guard), SpacePoint("a", image)).interval
    assert found.lower == 0
    assert found.upper <= 1e-13 * sum(map(abs, (*guard, *image)))


@pytest.mark.parametrize("unit", ["1e-12", "1e-6", "1", "1e9"])
def test_a_domain_and_its_guard_may_be_tiny_or_huge(unit):
    """From the middle of a square through its right side, glued to its left one: as far as the way round."""
    size = float(unit)
    space = space_of(
        f"{HEAD}  a:\n    flow: {{x: u, y: u}}\n    domain: [x >= -{unit}, y >= -{unit}, y <= {unit}]\n"
        f"    transitions: [{{when: x >= {unit}, to: a, reset: {{x: -{unit}, y: y}}}}]\n{TAIL}"
    )
    found = distance(space, SpacePoint("a", (0.75 * size, 0)), SpacePoint("a", (-0.5 * size, 0)))
    assert found.status == "certified"
    assert found.interval.lower == pytest.approx(0.75 * size, rel=1e-9)
    assert found.interval.upper == pytest.approx(0.75 * size, rel=1e-9)


def test_a_guard_is_empty_only_if_it_is():
    """A strip one part in 1e12 wide is a guard, and one that is a part in 1e30 too narrow is none."""
    text = (
        f"{HEAD}  a:\n    flow: {{x: u, y: u}}\n"
        "    transitions: [{when: x >= 0, if: 'y >= 1 and y <= LEVEL', to: b}]\n"
        f"  b: {{flow: {{x: u, y: u}}}}\n{TAIL}"
    )
    for level, connected in (("1 + 1e-12", True), ("1", True), ("1 - 1e-30", False)):
        space = space_of(text.replace("LEVEL", level))
        found = distance(space, SpacePoint("a", (-1, 1)), SpacePoint("b", (1, 1))).interval
        assert (2 in found) == connected == (found.upper < 3)


def chain_of_modes(tmp_path, modes):
    """Lines glued end to end: x runs from 0 to 1 in each."""
    lines = [f"  m{k}: {{flow: {{x: 1}}, transitions: [{{when: x >= 1, to: m{k + 1}, reset: {{x: 0}}}}]}}"
             for k in range(modes - 1)]  # fmt: skip
    path = tmp_path / "chain.yaml"
    path.write_text(
        "hsdsl: 1\nmodes:\n" + "\n".join(lines) + f"\n  m{modes - 1}: {{flow: {{x: 1}}}}\n"
        f"initial: {{mode: m0, x: 0}}\nexperiment: {{until: {modes - 1}.5}}\n"
    )
    return path


@pytest.mark.parametrize("modes", [3, 10, 25])
def test_a_chain_of_modes_is_as_long_as_it_is(tmp_path, modes):
    space = make_space(hsdsl.load(chain_of_modes(tmp_path, modes)).system, [])
    found = distance(space, SpacePoint("m0", (0.5,)), SpacePoint(f"m{modes - 1}", (0.25,)))
    assert found.interval.lower == pytest.approx(modes - 1 - 0.25) == found.interval.upper
    assert found.status == "certified"


def test_a_cap_on_hops_is_said_and_the_lower_end_holds_without_it(tmp_path):
    model = hsdsl.load(chain_of_modes(tmp_path, 10))
    capped = hsdsl.distance(model, "m0 x=0.5", "m9 x=0.25", hops=3)
    assert (capped.upper, capped.status) == (np.inf, "up to 3 hops")
    assert capped.lower <= 8.75
    run, other = model.simulate(until=9.25), model.simulate(until=9.25, initial={"x": -9})
    whole = hsdsl.distance(run, other, model=model)
    assert whole.status == "certified"
    assert whole.lower == pytest.approx(9) and 9 <= whole.upper < 9.1
    few = hsdsl.distance(run, other, model=model, hops=2, seconds=2)
    assert few.status == "up to 2 hops" and few.lower <= 9 <= few.upper
    with pytest.raises(UsageError, match="has no paths"):
        hsdsl.distance(run, other, model=model, metric="sup", hops=2)
    assert hsdsl.distance(run, other, model=model, metric="rho-hat").status == "sampled"


def test_ends_that_contradict_each_other_are_an_error_of_ours():
    with pytest.raises(EndsCross, match="internal error"):
        Interval(2.0, 1.0)


def test_what_rests_on_several_promises_no_more_than_each():
    assert weakest("certified", "up to 8 hops") == "up to 8 hops"
    assert weakest("sampled", "up to 8 hops", "searched") == "searched"
    assert (Interval(1, 2) + Interval(1, 1, "sampled")).status == "sampled"


def test_many_pairs_at_once_have_no_false_end_under_any_cap():
    """Bounds of one pair under every cap hold the distance that the highest one certifies."""
    for seed in range(6):
        rng = np.random.default_rng(seed)
        scene = random_scene(rng)
        space = space_of(text_of(scene))
        ends = [(random_point(rng, scene), random_point(rng, scene)) for _ in range(3)]
        brute = BruteForce(scene)
        for (i, x), (j, y) in ends:
            expected = brute.distance((i, x), (j, y))
            for hops in (0, 1, 2, 4, None):
                rows = (np.array([[float(v) for v in end]]) for end in (x, y))
                p, q = rows
                lower, upper, status = distances(space, f"m{i}", p, f"m{j}", q, hops=hops)
                assert lower[0] <= expected * (1 + 1e-9) + 1e-12
                assert hops is not None or upper[0] <= expected * (1 + 1e-6) + 1e-12 or status != "certified"


class Looks(Budget):
    """Time that is over after so many looks at it."""

    def __init__(self, looks):
        super().__init__()
        self.looks = looks

    def spent(self):
        self.looks -= 1
        self.ran_out = self.ran_out or self.looks < 0
        return self.ran_out


@pytest.mark.parametrize("looks", [0, 1, 10, 40])
def test_when_the_time_is_over_little_more_is_solved_and_both_ends_hold(monkeypatch, looks):
    solved = []
    monkeypatch.setattr(passage_bounds, "solve", lambda *given: solved.append(1) or solve(*given))
    for seed in range(4):
        rng = np.random.default_rng(300 + seed)
        scene = random_scene(rng, dimensions=(2,), edges=6)
        p, q = random_point(rng, scene), random_point(rng, scene)
        space = space_of(text_of(scene))
        expected = BruteForce(scene).distance(p, q)
        solved.clear()
        found = distance(space, *(SpacePoint(f"m{m}", tuple(map(float, x))) for m, x in (p, q)), budget=Looks(looks))
        assert found.interval.lower <= expected * (1 + 1e-9) + 1e-12
        assert len(solved) <= 4 * looks + 4
        if 0 < found.interval.upper < np.inf:
            ends = ((m, tuple(map(float, x))) for m, x in (p, q))
            assert path_fault(scene, *ends, found.path, found.interval.upper) is None


def test_runs_back_and_forth_through_one_gate_are_bounded_at_once():
    """A reset that shortens one direction and lengthens the other: no path is left out, and none goes on for ever."""
    space = space_of(
        f"{HEAD}  a:\n    flow: {{x: u, y: u, z: u}}\n    domain: [y <= 1, y >= -1, z <= 1, z >= -1]\n"
        "    transitions: [{when: x >= 0, to: b, reset: {x: 0, y: 2*y, z: z/2}}]\n"
        "  b: {flow: {x: u, y: u, z: u}, domain: [y <= 2, y >= -2, z <= 2, z >= -2]}\n"
        "initial: {mode: a, x: -1, y: 0, z: 0}\nexperiment: {until: 1}\n"
    )
    assert list(followers(space, (0,))) == [1, ~1]
    assert list(followers(space, (0, ~1))) == [0]
    assert list(followers(space, (0, 1))) == [0]
    assert list(followers(space, (0, ~1, 0))) == list(followers(space, (0, 1, 0))) == []
    assert [hops_of(s) for s in ((0,), (0, 1), (0, ~1), (0, ~1, 0))] == [1, 2, 4, 5]
    found = distance(space, SpacePoint("a", (0, -1, -1)), SpacePoint("a", (0, 1, 1)))
    assert found.status == "certified"
    assert found.interval.lower == pytest.approx(found.interval.upper)
    assert found.interval.upper == pytest.approx(6 / 5**0.5)  # steepest linear function of both sides
