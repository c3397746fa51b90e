"""Engines agree to the last bit on models that nobody wrote: times, values, outputs, transitions, strips, stops."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable

import pytest
from engines import assert_engines_agree, needs_compiler
from property.random_models import SETTINGS, SMOOTH_SETTINGS, random_model, smooth_model

from hsdsl.base.errors import ModelError, UsageError
from hsdsl.engine.execution import Execution
from hsdsl.engine.runtime.structures import COMPILED_SCHEMES
from hsdsl.interface.model import Model
from hsdsl.language.elaborate import elaborate

pytestmark = needs_compiler
STOPPING = (1, 4, 5, 6, 8, 11, 14, 17, 19)  # in every way, and none refused


def runs_of(text: str, every: tuple[dict, ...], schemes: list[str]) -> list[Execution]:
    """Every setting's run of one random model, after the engines were found to agree; none where it is refused."""
    try:
        model = Model(elaborate("random.yaml", text=text.encode()))
        return [
            assert_engines_agree(model, max_transitions=25, scheme=scheme, **settings)
            for scheme in schemes
            for settings in every
        ]
    except (ModelError, UsageError):  # no value anywhere, such as log(-1)
        return []


def check(seeds: Iterable[int]) -> Counter[str]:
    return Counter(
        run.stop.reason for seed in seeds for run in runs_of(random_model(seed), SETTINGS, list(COMPILED_SCHEMES))
    )


def check_smooth(seeds: Iterable[int]) -> Counter[str]:
    schemes = list(COMPILED_SCHEMES)
    texts = map(smooth_model, seeds)
    return Counter(run.stop.reason for text in texts for run in runs_of(text, SMOOTH_SETTINGS, schemes))


def test_random_models_run_alike() -> None:
    reasons = check(STOPPING)
    assert set(reasons) >= {"until", "transition_limit", "not_finite", "left_domain", "zeno"}, reasons


def test_smooth_random_models_run_alike_by_taylor_series() -> None:
    reasons = check_smooth(STOPPING)
    assert set(reasons) >= {"until", "transition_limit", "not_finite", "left_domain", "zeno"}, reasons


@pytest.mark.parametrize(
    "block", [pytest.param(k, marks=pytest.mark.campaign if k else pytest.mark.slow) for k in range(6)]
)
def test_many_random_models_run_alike(block: int) -> None:
    seeds = range(1000 + 10 * block, 1010 + 10 * block)
    assert check(seeds).total() > 30
    assert check_smooth(seeds).total() > 10
