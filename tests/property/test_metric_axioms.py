"""The point metric on random models: against a fine graph, and as the metric that Theorems 13, 20 and 21 say it is."""

from __future__ import annotations

import functools
import tempfile
from pathlib import Path

import numpy as np
import pytest
from affine_models import REACH, graph_distance, random_glues, text_of
from hypothesis import given, settings
from hypothesis import strategies as st

import hsdsl
from hsdsl.metrics.points import SpacePoint, distance
from hsdsl.metrics.space import make_space

STRETCHES = ("contracting", "isometric", "expanding")


@functools.cache
def scene(seed, modes, stretch):
    glues = random_glues(np.random.default_rng(seed), modes, stretch)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "model.yaml"
        path.write_text(text_of(glues))
        system = hsdsl.load(path).system
    return glues, make_space(system, [])


def random_point(rng, modes):
    x, y = rng.uniform(-REACH, REACH, size=2)
    return int(rng.integers(modes)), float(x), float(y)


def place(point):
    return SpacePoint(f"m{point[0]}", point[1:])


@pytest.mark.parametrize("stretch", STRETCHES)
@pytest.mark.parametrize("modes", [1, 2, 3])
@pytest.mark.parametrize("toll", [None, 0.05])
def test_agrees_with_a_fine_graph(modes, stretch, toll):
    rng = np.random.default_rng(5)
    for seed in range(3):
        glues, space = scene(seed, modes, stretch)
        for _ in range(4):
            p, q = random_point(rng, modes), random_point(rng, modes)
            found = distance(space, place(p), place(q), toll)
            expected, spacing = graph_distance(glues, p, q, toll or 0.0)
            if expected == np.inf:
                assert found.interval.lower == np.inf
                continue
            passages = sum(piece.edge is not None for piece in found.path)
            assert found.interval.lower <= expected + 1e-9
            assert expected <= found.interval.upper + spacing * passages + 1e-9
            if found.status == "certified":
                assert found.interval.width <= 1e-9 * found.interval.upper + 1e-13


points = st.tuples(
    st.integers(0, 2), st.floats(-REACH, REACH, allow_subnormal=False), st.floats(-REACH, REACH, allow_subnormal=False)
)
scenes = st.builds(scene, st.integers(0, 5), st.just(3), st.sampled_from(STRETCHES))
tolls = st.sampled_from([None, 1e-3, 0.3])


@settings(max_examples=40, deadline=None)
@given(scenes, points, points, tolls)
def test_symmetric_and_zero_at_one_point(drawn, p, q, toll):
    _, space = drawn
    there, back = (distance(space, place(a), place(b), toll).interval for a, b in ((p, q), (q, p)))
    assert there.lower <= back.upper and back.lower <= there.upper
    assert distance(space, place(p), place(p), toll).interval.upper == 0


@settings(max_examples=30, deadline=None)
@given(scenes, points, points, points, tolls)
def test_triangle(drawn, p, q, r, toll):
    _, space = drawn
    direct = distance(space, place(p), place(r), toll).interval
    first, second = (distance(space, place(a), place(b), toll).interval for a, b in ((p, q), (q, r)))
    assert direct.lower <= first.upper + second.upper


@settings(max_examples=40, deadline=None)
@given(scenes, st.integers(0, 2), st.floats(0, 1), points, tolls)
def test_related_points_are_one_point(drawn, which, share, other, toll):
    glues, space = drawn
    glue = glues[which]
    y = glue.low + share * (glue.high - glue.low)
    guard = SpacePoint(f"m{glue.source}", (REACH, y))
    image = SpacePoint(f"m{glue.target}", (glue.position, glue.factor * y + glue.shift))
    apart = distance(space, guard, image, toll).interval
    assert apart.lower <= (toll or 0.0)
    assert apart.upper <= (toll or 0.0) + 1e-12
    if toll is None:
        one, two = (distance(space, place(other), x).interval for x in (guard, image))
        assert one.lower <= two.upper + 1e-12 and two.lower <= one.upper + 1e-12


@settings(max_examples=40, deadline=None)
@given(scenes, points, points, st.sampled_from([1e-6, 1e-3, 0.3]))
def test_relaxed_distance_exceeds_by_at_most_a_relaxation_for_each_passage(drawn, p, q, toll):
    _, space = drawn
    plain, relaxed = distance(space, place(p), place(q)), distance(space, place(p), place(q), toll)
    if plain.interval.lower == np.inf:
        assert relaxed.interval.lower == np.inf
        return
    passages = sum(piece.edge is not None for piece in plain.path)
    assert plain.interval.lower <= relaxed.interval.upper
    assert relaxed.interval.lower <= plain.interval.upper + passages * toll
