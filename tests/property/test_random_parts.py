"""Random systems of parts against their exact executions: none is wrong whose verdict is `holds`, few are `unknown`."""

from __future__ import annotations

from collections import Counter

import pytest
from random_parts import MOST, World, execution, random_system, written

import hsdsl

MANY, FEW = 300, 6
MOST_UNKNOWN = 0.03
WITHIN, OF_STATES = 1e-7, 1e-6  # of times, and of the last state
MEMORY = (" re-arms", " triggers")  # transitions that change what an event remembers, and nothing else


def is_right(run: hsdsl.Execution, right: World) -> bool:
    """Whether a run makes the transitions of the execution, at their times, and ends where that does."""
    made = [(each.edge, float(each.time)) for each in run.transitions if not each.edge.endswith(MEMORY)]
    if [edge for edge, _ in made] != [edge for edge, _ in right.made]:
        return False
    times = zip(made, right.made, strict=True)
    last = run.final.state
    return all(abs(one - float(other)) <= WITHIN for (_, one), (_, other) in times) and all(
        abs(last[name] - float(value)) <= OF_STATES for name, value in right.values.items() if name in last
    )


def judge(seeds: range) -> Counter[str]:
    """Count the verdicts of right runs of well conditioned systems; fail on wrong runs that hold."""
    counted: Counter[str] = Counter()
    for seed in seeds:
        system = random_system(seed)
        right = execution(system)
        if len(right.made) >= MOST:
            continue
        run = hsdsl.loads(written(system)).simulate()
        found = is_right(run, right)
        assert found or run.verdict.theorem != "holds", (seed, right.ill, run.verdict)
        assert not any("order" in why for why in right.ill) or run.verdict.theorem != "holds", (seed, run.verdict)
        if not right.ill:
            assert found, (seed, run.stop, run.verdict)
            assert run.verdict.theorem != "left", (seed, run.verdict)
            counted[run.verdict.theorem] += 1
    return counted


def test_a_few_systems() -> None:
    counted = judge(range(FEW))
    assert counted["holds"] == sum(counted.values()) > 0, counted


@pytest.mark.campaign
def test_systems() -> None:
    counted = judge(range(1000, 1000 + MANY))
    print(counted)
    assert counted["holds"] > MANY / 2
    assert counted["unknown"] <= MOST_UNKNOWN * sum(counted.values()), counted
