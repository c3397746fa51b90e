"""No run of a map is wrong whose verdict is `holds`: round-off of its resets is in its error. Few are unknown."""

from __future__ import annotations

from collections import Counter
from random import Random
from typing import Any

import pytest

import hsdsl
from campaign.maps import drawn
from hsdsl.engine.simulate.verdict import RunView
from hsdsl.engine.simulate.verdict.errors import Errors

MANY, FEW = 300, 8
TIMES, LEAST = 10, 1e-6  # how far off a state may be: of the error that is known, or of its largest size
CLEAR, DIGITS_LEFT = 1e-6, 1e-9  # of the size: how far from the level a well conditioned run is, and how right
MOST_UNKNOWN = 0.03


def errors_of(run: hsdsl.Execution, found: str) -> Errors:
    """What its verdict has held margins against: a shadow run, or else a finer one."""
    compiled: Any = run.compiled
    view = RunView(compiled.plan.problem, run, by_shadow=found == "holds" and "finer" not in run.__dict__)
    assert view.errors is not None
    return view.errors


def judged(seed: int, method: str) -> str:
    """Whether one run is right, well conditioned, and what its verdict is; fail where it is wrong and holds."""
    each = drawn(Random(seed))
    edges, rows = each.right()
    run = hsdsl.loads(each.text).simulate(method=method, engine="c")
    theorem = run.verdict.theorem
    same = [made.edge for made in run.transitions] == edges
    errors, largest, right = errors_of(run, theorem), 0.0, same
    for k, x in enumerate(each.start):
        size = max(abs(float(row[k])) for row in rows)
        off = [
            abs(float(made.after[x] - row[k]))
            for made, row in zip(run.transitions, rows[1:], strict=True)
            if made.after
        ]
        known = float(errors.by_row[-1, errors.columns[x]])
        right &= max(off) <= max(TIMES * known, LEAST * size)
        largest = max(largest, max(off) / size if size else 0.0)
    assert right or theorem != "holds", (seed, each, run.verdict.reasons)
    level = float(each.level)
    apart = min(abs(float(row[0]) - level) for row in rows[:-1]) / max(abs(float(row[0])) for row in rows)
    return f"{'clear' if same and apart > CLEAR and largest < DIGITS_LEFT else 'poor'} {theorem}"


@pytest.mark.parametrize("method", ["auto", "dop853"])
def test_no_wrong_run_of_a_map_holds(method: str) -> None:
    for seed in range(FEW):
        judged(seed, method)


@pytest.mark.campaign
@pytest.mark.parametrize("method", ["auto", "dopri5", "dop853", "radau"])
def test_no_wrong_run_of_a_map_holds_among_many(method: str) -> None:
    counted = Counter(judged(seed, method) for seed in range(FEW, FEW + MANY))
    print(method, dict(counted))
    assert counted["clear unknown"] <= MOST_UNKNOWN * (counted["clear unknown"] + counted["clear holds"])
