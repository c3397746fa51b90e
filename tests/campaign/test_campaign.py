"""No run is wrong whose verdict is `holds`, and few ordinary ones have another."""

from __future__ import annotations

import random
from collections import Counter
from collections.abc import Iterator
from typing import NamedTuple

import pytest

import hsdsl
from campaign.families import FAMILIES, Family
from campaign.reference import Outcome
from hsdsl.interface.model.estimate import corrected_times

METHODS = ("auto", "taylor", "dopri5", "dop853", "radau")
MANY, FEW = 450, 6
WITHIN = 1e-5  # of the run's length: times of transitions
MOST_UNKNOWN = 0.03
# The relaxed scheme looks at the ends of steps and delays what follows a transition, by a depth in a model's own units.
NOT_FOR_RELAXED = ("narrow visits", "fast guards", "tangency", "units")


class Run(NamedTuple):
    """One run: its settings, the right outcome and ours, and the verdict."""

    values: dict[str, float]
    given: dict[str, str]
    right: Outcome
    found: Outcome
    until: float
    theorem: str
    reasons: tuple[str, ...]

    @property
    def is_right(self) -> bool:
        """Same transitions at the same times, and the same end."""
        if (self.right.edges, self.right.stop) != (self.found.edges, self.found.stop):
            return False
        return all(abs(a - b) <= WITHIN * self.until for a, b in zip(self.right.times, self.found.times, strict=True))


def runs(family: Family, count: int, seed: str, scheme: str) -> Iterator[Run]:
    """Run so many draws of a family."""
    model, r = hsdsl.loads(family.text), random.Random(seed)
    for _ in range(count):
        values = family.draw(r)
        given = {"scheme": scheme, "method": r.choice(METHODS)}
        run = model.simulate(parameters=values, **given)
        times = tuple(corrected_times(run.transitions))
        found = Outcome(tuple(t.edge for t in run.transitions), times, run.stop.reason)
        until = float(run.settings["until"])
        yield Run(values, given, family.right(values), found, until, run.verdict.theorem, run.verdict.reasons)


def judge(name: str, count: int, scheme: str) -> Counter[str]:
    """Count right and wrong runs by verdict; fail on a wrong run that holds."""
    counted: Counter[str] = Counter()
    for run in runs(FAMILIES[name], count, f"{name} {scheme}", scheme):
        counted[f"{'right' if run.is_right else 'wrong'} {run.theorem}"] += 1
        assert run.is_right or run.theorem != "holds", run
    return counted


@pytest.mark.parametrize("name", FAMILIES)
def test_no_wrong_run_holds(name):
    judge(name, FEW, "located")


@pytest.mark.campaign
@pytest.mark.parametrize("name", FAMILIES)
def test_no_wrong_run_holds_among_many(name):
    counted = judge(name, MANY, "located")
    print(name, dict(counted))
    if FAMILIES[name].ordinary:
        assert counted["right unknown"] <= MOST_UNKNOWN * MANY, counted


@pytest.mark.campaign
@pytest.mark.parametrize("name", [name for name in FAMILIES if name not in NOT_FOR_RELAXED])
def test_no_wrong_relaxed_run_holds_among_many(name):
    print(name, dict(judge(name, FEW * 10, "relaxed")))
