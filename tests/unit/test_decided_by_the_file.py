"""Verdicts of runs of which the file decides what happens, and of neighbours of which an error does."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
import yaml

import hsdsl
from hsdsl.analysis.report.words import remedies_of

PAIRS: dict[str, Any] = yaml.safe_load((Path(__file__).parent / "decided_by_the_file.yaml").read_text())


def model(text: str) -> hsdsl.Model:
    return hsdsl.loads(f"hsdsl: 1\n{text}experiment: {{until: 7.3}}\n")


@pytest.mark.parametrize("engine", ["c", "python"])
@pytest.mark.parametrize("name", PAIRS)
def test_the_file_decides(name: str, engine: str) -> None:
    run = model(PAIRS[name]["model"]).simulate(engine=engine)
    assert run.verdict.theorem == "holds", run.verdict


@pytest.mark.parametrize("name", PAIRS)
def test_an_error_decides_beside_it(name: str) -> None:
    text = PAIRS[name]["model"]
    for one, other in PAIRS[name]["neighbour"].items():
        assert one in text
        text = text.replace(one, other)
    run = model(text).simulate(method="dopri5", tolerance=1e-6)
    assert run.verdict.theorem == "left" or remedies_of(run.verdict.reasons), run.verdict
