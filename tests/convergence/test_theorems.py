"""Theorems 26 and 27 and Corollary 28 in rho, against exact executions; and what is left across a Zeno point."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from convergence.scene import slope
from convergence.theorem_scenes import BEFORE_ZENO, LONG, OTHER, SCENES, known

from hsdsl.engine.integrators import INTEGRATORS
from hsdsl.interface.model.distances import distance_of_runs as distance

FIXED = [name for name, table in INTEGRATORS.items() if table.embedded is None]
ALL = {**SCENES, **LONG, **BEFORE_ZENO}
NONE = "1e-14"  # a relaxation far below all errors looked at


def also_slow(scenes, slow, campaign=()):
    """Parameters: the first fast, the others slow, the last of a campaign."""
    marked = [(name, pytest.mark.slow) for name in slow] + [(name, pytest.mark.campaign) for name in campaign]
    return [*scenes, *(pytest.param(name, marks=mark) for name, mark in marked)]


@pytest.mark.parametrize("name", ALL)
def test_theorem_26_relaxed_executions_are_within_a_multiple_of_the_relaxation(name):
    """rho(x, x^eps) = O(eps), both in closed form: slope 1 with nothing to scatter."""
    scene, relaxations = ALL[name], [1e-3, 1e-4, 1e-5, 1e-6, 1e-7]
    found = [scene.rho(scene.truth, scene.limit(eps)) for eps in relaxations]
    assert abs(slope(relaxations, found) - 1) <= 0.01, found


SPEEDS = {"thermostat": 0.8, "one state to three": 0.5, "pendulum": 4.1625}  # at crossings, the farthest from 1
LIMITS = [("thermostat", method) for method in FIXED] + [
    pytest.param(name, method, marks=pytest.mark.slow)
    for name, method in (("one state to three", "euler"), ("one state to three", "rk4"), ("pendulum", "rk4"))
]


@pytest.mark.parametrize(("name", "method"), LIMITS)
def test_theorem_27_discrete_approximations_tend_to_the_relaxed_execution(name, method):
    """rho(x^eps, z) -> 0 as h -> 0 with eps fixed, in proportion to h whatever the method.

    A step overshoots by up to s h, s the speed at the crossing, and that changes the delay by up to |1 - s| h. So with
    A = rho(x, x^eps)/eps, what a delay costs, it is at most A |1 - s| h, and the method's own error.
    """
    scene, eps, order, speed = ALL[name], 1e-2, INTEGRATORS[method].order, SPEEDS[name]
    limit = scene.limit(eps)
    delayed = scene.rho(scene.truth, limit) / eps
    coarsest = scene.coarsest[order]
    alone = scene.rho(scene.truth, scene.run(method=method, step=coarsest, relaxation=NONE)) / coarsest**order
    for h in eps / max(1, speed) * np.array([0.71, 0.37, 0.093, 0.0271, 0.0057]):
        found = scene.rho(limit, scene.run(method=method, step=h, relaxation=eps))
        assert found <= delayed * abs(1 - speed) * h + 1.25 * alone * h**order, (h, found)


@pytest.mark.parametrize("method", FIXED)
@pytest.mark.parametrize("name", also_slow(SCENES, LONG))
def test_corollary_28_order_in_the_step(name, method):
    """rho(x, z) = O(h^omega) with eps far below: the order of the method, through transitions and between samples."""
    scene, order = ALL[name], INTEGRATORS[method].order
    steps = [scene.coarsest[order] * 2.0**-k for k in range(4)]
    found = [scene.rho(scene.truth, scene.run(method=method, step=h, relaxation=NONE)) for h in steps]
    assert abs(slope(steps, found) - order) <= 0.05, found


@pytest.mark.parametrize(
    "name",
    also_slow(
        ["thermostat"], ["one state to three", "pendulum"], ["oscillator 1, 2 impacts", "oscillator 1, 4 impacts"]
    ),
)
def test_corollary_28_order_in_the_relaxation(name):
    """rho(x, z) = O(eps) with h^omega far below: how far a step overshoots scatters, the median over steps does not."""
    scene, relaxations = ALL[name], np.logspace(-3, -7, 5)
    steps = np.linspace(0.1, 0.2, 11) * scene.coarsest[4]
    medians = [
        np.median([scene.rho(scene.truth, scene.run(method="rk4", step=h, relaxation=eps)) for h in steps])
        for eps in relaxations
    ]
    assert abs(slope(relaxations, medians) - 1) <= 0.05, medians


SLOWEST = {"thermostat": 0.8, "one state to three": 0.5, "pendulum": 1.25, "oscillator 1, 2 impacts": 9.5}  # crossing


@pytest.mark.parametrize("method", FIXED)
@pytest.mark.parametrize(
    "name", also_slow(["thermostat"], ["one state to three", "pendulum"], ["oscillator 1, 2 impacts"])
)
def test_corollary_28_bounds_the_error_by_the_sum(name, method):
    """rho(x, z) <= A eps + B h^omega for a table of (h, eps), B from its coarsest step alone.

    A is rho(x, x^eps)/eps, and a delay of eps can be one of eps/s in a run, s the speed at a crossing.
    """
    scene, order = ALL[name], INTEGRATORS[method].order
    coarsest = scene.coarsest[order]
    alone = scene.rho(scene.truth, scene.run(method=method, step=coarsest, relaxation=NONE)) / coarsest**order
    delayed = scene.rho(scene.truth, scene.limit(1e-4)) / 1e-4 / min(1, SLOWEST[name])
    for h in (coarsest, coarsest / 3, coarsest / 9):
        for eps in (1e-3, 1e-5, 1e-7, 1e-9):
            found = scene.rho(scene.truth, scene.run(method=method, step=h, relaxation=eps))
            assert found <= 1.25 * (delayed * eps + alone * h**order), (h, eps, found)


ZENO = {"past the first point": (5.5, np.logspace(-4, -6, 3)), "past both": (12.5, np.logspace(-4, -8, 5))}


@pytest.mark.parametrize("case", also_slow(["past the first point"], ["past both"]))
def test_across_a_zeno_point_rho_falls_and_no_rate_holds(case):
    """Oscillator 2: at rest, released, Zeno, at rest. rho falls in every decade, more slowly than eps."""
    until, relaxations = ZENO[case]
    scene = known(OTHER, until, 0)
    found = []
    for eps in relaxations:
        run = scene.model.simulate(method="midpoint", step=1e-3, relaxation=eps, until=until)
        found.append(distance(scene.truth, run, model=scene.model))
    print(
        f"{case}: {[f'{d.lower:.3g} to {d.upper:.3g}' for d in found]}, {slope(relaxations, [d.middle for d in found])}"
    )
    assert all(fine.upper < 0.7 * coarse.lower for coarse, fine in pairwise(found))
    assert found[-1].lower > found[0].upper * relaxations[-1] / relaxations[0]


CASES = [(name, seed) for name in SCENES for seed in range(3)]


@pytest.mark.parametrize(("name", "seed"), CASES)
def test_rho_agrees_with_states_compared_one_by_one(name, seed):
    """Where both are in one mode and nearer to each other than to any jump, the states' distance is a lower bound.

    "Nearer" is by time: three tenths of the time to the nearest transition of either, less than both move in it.
    """
    rng, scene = np.random.default_rng(seed), SCENES[name]
    method = str(rng.choice(FIXED))
    step = float(scene.coarsest[INTEGRATORS[method].order] * rng.uniform(0.1, 1))
    run = scene.run(method=method, step=step, relaxation=float(10 ** rng.uniform(-8, -3)))
    found = distance(scene.truth, run, model=scene.model)
    jumps = np.array(
        [t for other in (run, scene.truth) for each in other.transitions for t in (each.time, each.resumed)]
    )

    def apart(times):
        one, other = scene.truth.sample(times), run.sample(times)
        square = np.zeros(len(times))
        for state in one.states:
            if state in other.states:
                square += np.nan_to_num(one[state] - other[state]) ** 2
        alike = (one.mode == other.mode) & (other.kind == "flow") & (one.kind == "flow")
        near = np.min(np.abs(times[:, None] - jumps), axis=1)
        return np.where(alike & (np.sqrt(square) <= 0.3 * near), np.sqrt(square), 0)

    seen = np.max(apart(np.linspace(0, scene.until, 20_001)))
    assert 0 < seen <= found.upper
    there = apart(np.array([found.time]))[0]
    assert there == 0 or abs(there - found.lower) <= 1e-9 * found.lower + 1e-13
    assert seen >= 0.2 * found.lower  # most of the supremum shows away from jumps
