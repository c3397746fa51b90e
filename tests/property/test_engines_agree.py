"""Engines agree to the last bit on models that nobody wrote: times, values, outputs, transitions, strips, stops."""

from __future__ import annotations

from collections import Counter

import pytest
from engines import assert_engines_agree, needs_compiler
from property.random_models import SETTINGS, random_model

from hsdsl.elaborate import elaborate
from hsdsl.errors import ModelError, UsageError
from hsdsl.execution import Execution
from hsdsl.model import Model
from hsdsl.simulate.compiled import SCHEMES

pytestmark = needs_compiler


def runs_of(seed: int) -> list[Execution]:
    """Every setting's run of one random model, after the engines were found to agree; none where it is refused."""
    try:
        model = Model(elaborate("random.yaml", text=random_model(seed).encode()))
        return [
            assert_engines_agree(model, max_transitions=25, scheme=scheme, **settings)
            for scheme in SCHEMES
            for settings in SETTINGS
        ]
    except (ModelError, UsageError):  # no value anywhere, such as log(-1)
        return []


def check(seeds: range) -> Counter[str]:
    return Counter(run.stop.reason for seed in seeds for run in runs_of(seed))


def test_random_models_run_alike() -> None:
    reasons = check(range(40))
    assert set(reasons) >= {"until", "transition_limit", "not_finite", "left_domain"}, reasons


@pytest.mark.slow
@pytest.mark.parametrize("block", range(6))
def test_many_random_models_run_alike(block: int) -> None:
    assert check(range(1000 + 100 * block, 1100 + 100 * block)).total() > 100
