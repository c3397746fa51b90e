"""The point metric on random models: as the metric that Theorems 13, 20 and 21 say it is."""

from __future__ import annotations

import functools

import numpy as np
from affine_scenes import REACH, STRETCHES, BruteForce, glued_boxes, text_of
from hypothesis import given, settings
from hypothesis import strategies as st

import hsdsl
from hsdsl.analysis.metrics.points import SpacePoint, distance
from hsdsl.analysis.metrics.space import make_space


@functools.cache
def scene(seed, stretch):
    drawn = glued_boxes(np.random.default_rng(seed), 3, stretch)
    return drawn, make_space(hsdsl.loads(text_of(drawn)).system, [])


def between(drawn, p, q, toll=None):
    return distance(drawn[1], p, q, toll)


inside = st.floats(-REACH, REACH, allow_subnormal=False)
points = st.builds(SpacePoint, st.sampled_from(["m0", "m1", "m2"]), st.tuples(inside, inside))
scenes = st.builds(scene, st.integers(0, 5), st.sampled_from(sorted(STRETCHES)))
tolls = st.sampled_from([None, 1e-3, 0.3])


@settings(max_examples=40, deadline=None)
@given(scenes, points, points, tolls)
def test_symmetric_and_zero_at_one_point(drawn, p, q, toll):
    there, back = (between(drawn, a, b, toll).interval for a, b in ((p, q), (q, p)))
    assert there.lower <= back.upper and back.lower <= there.upper
    assert between(drawn, p, p, toll).interval.upper == 0


@settings(max_examples=30, deadline=None)
@given(scenes, points, points, points, tolls)
def test_triangle(drawn, p, q, r, toll):
    direct = between(drawn, p, r, toll).interval
    first, second = (between(drawn, a, b, toll).interval for a, b in ((p, q), (q, r)))
    assert direct.lower <= first.upper + second.upper


@settings(max_examples=40, deadline=None)
@given(scenes, st.integers(0, 2), st.floats(0, 1), points, tolls)
def test_related_points_are_one_point(drawn, which, share, other, toll):
    ends = (BruteForce(drawn[0]).side(which, image, np.array([share])) for image in (False, True))
    guard, image = (SpacePoint(f"m{mode}", tuple(x[0].tolist())) for mode, x in ends)
    apart = between(drawn, guard, image, toll).interval
    assert apart.lower <= (toll or 0.0)
    assert apart.upper <= (toll or 0.0) + 1e-12
    if toll is None:
        one, two = (between(drawn, other, x).interval for x in (guard, image))
        assert one.lower <= two.upper + 1e-12 and two.lower <= one.upper + 1e-12


@settings(max_examples=40, deadline=None)
@given(scenes, points, points, st.sampled_from([1e-6, 1e-3, 0.3]))
def test_relaxed_distance_exceeds_by_at_most_a_relaxation_for_each_passage(drawn, p, q, toll):
    plain, relaxed = between(drawn, p, q), between(drawn, p, q, toll)
    if plain.interval.lower == np.inf:
        assert relaxed.interval.lower == np.inf
        return
    passages = sum(piece.edge is not None for piece in plain.path)
    assert plain.interval.lower <= relaxed.interval.upper
    assert relaxed.interval.lower <= plain.interval.upper + passages * toll
