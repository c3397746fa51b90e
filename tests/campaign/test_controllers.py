"""Controllers in discrete time in hybrid loops: every transition against the same map iterated at sixty digits."""

from __future__ import annotations

import random
from collections import Counter
from itertools import cycle, islice

import pytest
from engines import assert_engines_agree

import hsdsl
from campaign.controllers import FAMILIES, model_text, right, width

WELL_CONDITIONED = 1e4  # what a change at the start may grow by
WITHIN = 1e-9  # seconds, and sizes of states: a round-off that grew by that, and the sums of many samples
OFF = 100 * 2.0**-53  # of its numbers: how far a guard may be when it fires
MOST_UNKNOWN = 0.03
SETTINGS = (
    {"method": "taylor"}, {"method": "dopri5"}, {"method": "rk4", "step": "1/8"}, {"method": "auto"},
    {"method": "radau"},
)  # fmt: skip


def off_guard(transition, numbers):
    """How far the guard of a transition is, as a share of its numbers."""
    values = transition.before
    r = values["c"] - (values["d"] if transition.edge == "width" else 1)
    return abs(r) / max(1, numbers)


def check(name, seed, samples, settings, engines=False):
    """Run one controller; return its verdict, or None for one that is not well conditioned."""
    r = random.Random(seed)
    controller = FAMILIES[name](r)
    d = width(controller, r)
    text, known = model_text(controller, d, f"{samples}.95"), right(controller, d, samples)
    model = hsdsl.loads(text)
    run = assert_engines_agree(model, **settings) if engines else model.simulate(**settings)
    assert run.stop.reason == "until"
    waited, widths, starts = 0.0, [], []
    for made in run.transitions:
        assert off_guard(made, max(map(abs, made.before.values()))) <= OFF, (name, seed, made)
        if not made.edge.startswith("hand"):
            (widths if made.edge == "width" else starts).append(made.time - waited)
        waited += (made.resumed or made.time) - made.time
    well = known.growth <= WELL_CONDITIONED and waited == 0
    times = [n + w for n, w in enumerate(known.widths)]
    is_right = len(widths) == len(times) and len(starts) == samples
    is_right = is_right and all(abs(a - b) <= WITHIN * max(1, b / 1000) for a, b in zip(widths, times, strict=True))
    is_right = is_right and all(abs(a - n) <= WITHIN for n, a in enumerate(starts, 1))
    assert is_right or not well, (name, seed, known.growth)
    assert is_right or run.verdict.theorem != "holds", (name, seed, run.verdict)
    return run.verdict if well else None


def judge(seed, count, samples):
    """Count verdicts of well conditioned controllers of all families, in turn with all methods.

    Fixed steps do not say how wrong they are, so no verdict on them holds.
    """
    counted = Counter()
    for i, (name, settings) in enumerate(islice(zip(cycle(FAMILIES), cycle(SETTINGS), strict=False), count)):
        verdict = check(name, f"{seed} {i}", samples, settings)
        kind = "ill conditioned" if verdict is None else verdict.theorem
        counted[f"{kind}, fixed step" if "step" in settings else kind] += 1
    return counted


@pytest.mark.parametrize("name", FAMILIES)
def test_every_transition_of_a_controller_is_right(name):
    check(name, f"short {name}", 60, {}, engines=True)


@pytest.mark.parametrize("name", ["transversal_filter", "shift_register"])
def test_every_transition_of_a_controller_is_right_by_the_relaxed_scheme(name):
    settings = {"scheme": "relaxed", "method": "rk4", "step": "1/8", "relaxation": "1e-6"}
    check(name, f"relaxed {name}", 40, settings, engines=True)


@pytest.mark.campaign
def test_three_hundred_controllers_of_a_thousand_samples():
    counted = judge("controllers", 300, 1000)
    print(dict(counted))
    assert counted["unknown"] <= MOST_UNKNOWN * (counted["holds"] + counted["unknown"]), counted


@pytest.mark.campaign
@pytest.mark.parametrize("name", ["pid", "biquads", "kalman", "shift_register"])
def test_ten_thousand_samples(name):
    print(name, check(name, f"long {name}", 10_000, {}))
