"""Findings about a run that the screen leaves undecided: those of one hypothesis after another."""

from __future__ import annotations

from hsdsl.engine.simulate.verdict.commutation import choices
from hsdsl.engine.simulate.verdict.crossings import crossings
from hsdsl.engine.simulate.verdict.entries import entries
from hsdsl.engine.simulate.verdict.finding import Finding
from hsdsl.engine.simulate.verdict.flows import flows
from hsdsl.engine.simulate.verdict.landings import landings
from hsdsl.engine.simulate.verdict.misses import misses
from hsdsl.engine.simulate.verdict.reliability import reliability
from hsdsl.engine.simulate.verdict.run_view import RunView


def findings_of(run: RunView) -> tuple[list[Finding], list[str]]:
    """Return what is found, and the margins of what holds."""
    found, margins = list(reliability(run)), list[str]()
    for hypothesis in (crossings, choices, entries, landings, misses, flows):
        findings, reasons = hypothesis(run)
        found += findings
        margins += reasons
    return found, margins
