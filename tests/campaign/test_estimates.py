"""Twice an estimate bounds the true error of a run in 95 of 100 runs: adaptive, with fixed steps, and relaxed."""

from __future__ import annotations

import random
from typing import Any

import numpy as np
import pytest

from campaign.families import FAMILIES
from campaign.test_campaign import NOT_FOR_RELAXED
from hsdsl import Execution, loads
from hsdsl.interface.model.estimate import Estimate

FIXED = ("euler", "midpoint", "heun", "ralston", "rk4", "dopri5", "dop853")
MANY = 40  # runs of each family
BOUNDED = 0.95
REST = 1e-11  # of a state's largest size: the error of the reference


def adaptive(r: random.Random, until: float) -> dict[str, Any]:
    return {"method": r.choice(("taylor", "dopri5", "dop853", "radau")), "tolerance": 10 ** r.uniform(-9, -4)}


def fixed(r: random.Random, until: float) -> dict[str, Any]:
    return {"method": r.choice(FIXED), "step": until / 10 ** r.uniform(2, 3.5), "tolerance": None}


def relaxed(r: random.Random, until: float) -> dict[str, Any]:
    return adaptive(r, until) | {"scheme": "relaxed", "relaxation": 10 ** r.uniform(-7, -4) * until}


def bounds(run: Execution, estimate: Estimate, right: Execution) -> bool:
    """Whether twice the estimate bounds the error of every state at the end."""
    assert estimate.final is not None
    if [t.edge for t in run.transitions] != [t.edge for t in right.transitions] or run.final.mode != right.final.mode:
        return False
    for name, difference in estimate.final.items():
        error = abs(float(run.final.state[name]) - float(right.final.state[name]))
        size = float(np.nanmax(np.abs(right.sample(right.times)[name])))
        if error > 2 * float(difference) + REST * size:
            return False
    return True


@pytest.mark.campaign
@pytest.mark.parametrize("kind", (adaptive, fixed, relaxed), ids=lambda kind: kind.__name__)
def test_twice_an_estimate_bounds_the_error(kind):
    counted = {True: 0, False: 0, None: 0}
    for name, family in FAMILIES.items():
        if not family.ordinary or (kind is relaxed and name in NOT_FOR_RELAXED):
            continue
        model, r = loads(family.text), random.Random(f"{name} {kind.__name__}")
        for _ in range(MANY):
            values = family.draw(r)
            right = model.simulate(parameters=values, scheme="located", method="dop853", tolerance=1e-13)
            given = kind(r, float(right.settings["until"]))
            run = model.simulate(parameters=values, **{"scheme": "located"} | given)
            estimate = model.estimate(run)
            counted[None if estimate.final is None else bounds(run, estimate, right)] += 1
    print(kind.__name__, counted)
    assert counted[True] >= BOUNDED * (counted[True] + counted[False])
    assert counted[None] <= counted[True]
