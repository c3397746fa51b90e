"""Findings about a run that the screen leaves undecided: those of one hypothesis after another."""

from __future__ import annotations

from hsdsl.simulate.verdict.commutation import choices
from hsdsl.simulate.verdict.crossings import crossings
from hsdsl.simulate.verdict.entries import entries
from hsdsl.simulate.verdict.finding import Finding
from hsdsl.simulate.verdict.flows import flows
from hsdsl.simulate.verdict.landings import landings
from hsdsl.simulate.verdict.misses import misses
from hsdsl.simulate.verdict.reliability import reliability
from hsdsl.simulate.verdict.run_view import RunView


def findings_of(run: RunView) -> tuple[list[Finding], list[str]]:
    """Return what is found, and the margins of what holds."""
    found, margins = list(reliability(run)), list[str]()
    for hypothesis in (crossings, choices, entries, landings, misses, flows):
        findings, reasons = hypothesis(run)
        found += findings
        margins += reasons
    return found, margins
