"""A lint rule: flows that are 0."""

from collections.abc import Iterator

from hsdsl.analysis.lint import Finding, Subject
from hsdsl.analysis.lint.rules import Rule

PAGE = """A state that never moves.

## What it does

It finds states whose flow is 0 in a mode.

## Why it is bad

The state is a parameter in disguise, and costs time.

## How to fix it

Make the state a parameter, unless a reset changes it.
"""


def still_state(subject: Subject) -> Iterator[Finding]:
    """Find flows that are 0."""
    for part in subject.modes:
        for state, rate in zip(part.mode.states, part.mode.flow, strict=True):
            if rate == 0:
                scalar = part.document.flow[state]
                yield Finding(scalar.place.span, f"the state '{state}' never moves in the mode '{part.key}'")


STILL_STATE = Rule("still-state", still_state, severity="note", page=PAGE)
