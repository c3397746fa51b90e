"""The best coupling of two sequences of points, against the textbook recurrence over the whole table."""

from __future__ import annotations

import numpy as np
import pytest

from hsdsl.analysis.metrics.labelled import coupling
from hsdsl.analysis.metrics.trace import Polyline


def walk(rng, size, modes, step):
    """A random walk with switches and jumps."""
    times = np.sort(rng.uniform(0, 5, size))
    times[0], times[-1] = 0, 5
    label = np.cumsum(rng.random(size) < 0.1) % modes
    jump = np.cumsum(np.append(0, (label[1:] != label[:-1]) | (rng.random(size - 1) < 0.05)))
    states = np.cumsum(rng.normal(scale=step, size=(size, 2)), axis=0)
    return Polyline(times, states, label, jump, np.diff(jump) > 0, float(rng.uniform(0.01, 0.3)))


def shaken(rng, p, step):
    """The same visits of modes, at other times and places."""
    times = np.sort(np.clip(p.times + rng.normal(scale=0.02, size=len(p)), 0, 5))
    states = p.states + rng.normal(scale=step, size=p.states.shape)
    return Polyline(times, states, p.label, p.jump, p.jumps, p.reach)


def whole_table(p, q):
    best = np.full((len(p), len(q)), np.inf)
    for i in range(len(p)):
        for j in range(len(q)):
            apart = np.linalg.norm(p.states[i] - q.states[j]) + (p.label[i] != q.label[j])
            ways = [0.0] if i == j == 0 else []
            ways += [best[i - 1, j]] * (i > 0) + [best[i, j - 1]] * (j > 0)
            if i and j and p.jumps[i - 1] == q.jumps[j - 1]:
                ways.append(best[i - 1, j - 1])
            best[i, j] = max(abs(p.times[i] - q.times[j]), apart, min(ways))
    return best[-1, -1]


@pytest.mark.parametrize(("apart", "size"), [(0.0, 1), (1e-3, 1), (4.0, 2)])
def test_curves_of_no_length_are_as_far_apart_as_their_points(apart, size):
    at_once = np.zeros(size), np.zeros((size, 2)), np.zeros(size, dtype=int)
    p = Polyline(*at_once, np.arange(size), np.ones(size - 1, dtype=bool), 0.0)
    q = Polyline(p.times, p.states + np.array([apart, 0.0]), p.label, p.jump, p.jumps, 0.0)
    assert coupling(p, q) == apart


@pytest.mark.parametrize("seed", range(60))
def test_coupling_is_the_one_of_the_whole_table(seed):
    rng = np.random.default_rng(seed)
    modes, step = int(rng.integers(1, 4)), 10 ** rng.uniform(-3, 0)
    p = walk(rng, int(rng.integers(1, 30)), modes, step)
    q = shaken(rng, p, step / 5) if seed % 2 else walk(rng, int(rng.integers(1, 30)), modes, step)
    assert coupling(p, q) == pytest.approx(whole_table(p, q), rel=1e-14)
