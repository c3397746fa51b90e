"""What the summary says to do about verdicts that are `unknown`: one remedy for each reason, as the documentation."""

from __future__ import annotations

from pathlib import Path

import pytest

import hsdsl
from hsdsl.analysis.report.summary import summary
from hsdsl.analysis.report.words import remedies_of, remedy_of

ROOT = Path(hsdsl.__file__).parent
CLOSE = """\
hsdsl: 1
parameters: {stop: 0.999999}
modes:
  swing:
    flow: {x: v, v: -x}
    transitions: [{name: hit, when: x >= stop, to: swing, reset: {v: -0.8*v}}]
initial: {mode: swing, x: 0, v: 1}
experiment: {until: 3, tolerance: 1e-6}
"""


def test_the_documentation_has_the_table() -> None:
    assert (ROOT / "analysis/report/remedies.md").read_text() in (ROOT.parent / "docs/how-to/unknown.md").read_text()


@pytest.mark.parametrize("reason", remedy_of())
def test_a_reason_has_its_own_remedy(reason: str) -> None:
    written = reason.replace("...", "something at t = 1.25")
    assert remedies_of([written, written]) == [remedy_of()[reason]]


def test_the_summary_says_what_to_do() -> None:
    run = hsdsl.loads(CLOSE).simulate()
    assert run.verdict.theorem == "unknown"
    text = summary(run)
    assert "remedy    a smaller `--tolerance`" in text
    assert "remedy" not in summary(hsdsl.loads(CLOSE).simulate(tolerance=1e-12))
