"""Random systems of events against an execution by the words of M13 at 60 digits: no wrong run with `holds`."""

from __future__ import annotations

from typing import Any

import pytest
from engines import ENGINES
from property.event_systems import EventSystem, Reference, Unbounded, execute, random_system

import hsdsl

CLOSE = 1e-6  # of times, which are below 30
BEFORE_A_TAIL = 1e-3  # impacts of a ball, of which each run resolves its own
FEW, MANY = range(8), range(8, 324)
MULTIPLES = 58, 77, 91, 312  # with events as p <= -1.4 and -0.5*p >= 0.7, of different priorities


def made(times: list[tuple[Any, str]], end: float) -> list[tuple[float, str]]:
    return [(float(time), edge) for time, edge in times if time < end]


def agree(system: EventSystem, reference: Reference, run: Any) -> bool:
    """Whether a run makes the reference's events, and ends as it does; behind a tail only states are compared."""
    end = float(reference.tails[0]) - BEFORE_A_TAIL if reference.tails else float("inf")
    names = {event.name for event in system.events}
    found = made([(one.time, one.edge) for one in run.transitions if one.edge in names], end)
    wanted = made(reference.made, end)
    if reference.endless is not None:  # it is cut anywhere
        count = min(len(found), len(wanted))
        found, wanted = found[:count], wanted[:count]
        if run.stop.reason != "zeno" or abs(run.stop.time - float(reference.endless)) > CLOSE:
            return False
    elif run.stop.reason != "until" and not (reference.tails and run.stop.reason == "zeno"):
        return False
    pairs = zip(found, wanted, strict=False)
    if len(found) != len(wanted) or any(a[1] != b[1] or abs(a[0] - b[0]) > CLOSE for a, b in pairs):
        return False
    if run.stop.reason != "until" or reference.endless is not None:
        return True
    states = reference.final.keys() - system.counts
    return all(abs(run.final.state[x] - float(reference.final[x])) <= 1e-4 for x in states)


def check(seed: int) -> str:
    """Run one system; the verdict of its run, and nothing of one that makes too many transitions."""
    system = random_system(seed)
    try:
        reference = execute(system)
    except Unbounded:
        return ""
    run = hsdsl.loads(system.text()).simulate(engine=ENGINES[-1])
    right = agree(system, reference, run)
    assert right or run.verdict.theorem != "holds", f"seed {seed}: wrong, and its verdict is `holds`"
    assert right, f"seed {seed}: {run.stop.message}"
    return run.verdict.theorem


@pytest.mark.parametrize("seed", MULTIPLES)
def test_events_whose_surfaces_are_multiples_have_one_order(seed):
    assert check(seed) == "holds"


@pytest.mark.parametrize("seed", FEW)
def test_events_are_made_as_meant(seed):
    check(seed)


@pytest.mark.campaign
@pytest.mark.parametrize("seed", MANY)
def test_many_events_are_made_as_meant(seed):
    check(seed)
