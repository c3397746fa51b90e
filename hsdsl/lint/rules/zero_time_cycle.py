"""Transitions that follow each other at one instant without end.

## What it does

Finds states from which transitions fire at once, one after the other, until they come back to a state they have been
in.

## Why it is bad

Time does not go on. A run that gets there stops with `zeno`, or makes a transition each `relaxation`.

## Example

```yaml
modes:
  a:
    flow: {x: 1}
    transitions: [{when: x >= 1, to: b}]
  b:
    flow: {x: 1}
    transitions: [{when: x >= 0, to: a}]
initial: {mode: a, x: 0}
```

## Use instead

```yaml
modes:
  a:
    flow: {x: 1}
    transitions: [{when: x >= 1, to: b}]
  b:
    flow: {x: -1}
    transitions: [{when: x <= 0, to: a}]
initial: {mode: a, x: 0}
```

## How it is decided

Points of guards are looked for, symbolically or by search, from which the reset lands beyond or on a guard with the
flow pointing out. From each of them the transitions are followed with numbers, in the order in which a run makes them;
states that agree to eight digits count as one. Where round-off or a kink decides what comes next, nothing is said. Two
flows that push against one surface have [a rule of their own](#hs509-sliding).

## How to fix it

Let the transitions be triggered by different levels, or leave one of them out; let a reset lead inside the domain of
the mode that follows.
"""

from __future__ import annotations

from collections.abc import Iterator

from hsdsl.expression.scope import symbol
from hsdsl.lint.analysis.landing import landings, surfaces_of
from hsdsl.lint.analysis.mode_point import ModePoint
from hsdsl.lint.analysis.passing import fires
from hsdsl.lint.analysis.question import Answer, positive
from hsdsl.lint.analysis.wording import at
from hsdsl.lint.analysis.zero_time_cycle import Cycle, cycle
from hsdsl.lint.finding import Finding
from hsdsl.lint.subject import EdgePart, ModePart, Subject


def check(subject: Subject) -> Iterator[Finding]:
    """Find cycles that take no time."""
    told: set[frozenset[str]] = set()
    for part in subject.modes:
        for edge in part.edges:
            for answer in _chained(subject, part, edge):
                if not answer.somewhere:
                    continue
                found = cycle(ModePoint(subject.dynamics, part.mode, answer.point), edge.edge)
                if found is None or frozenset(found.edges) in told:
                    continue
                told.add(frozenset(found.edges))
                yield _finding(subject, part, edge, answer, found)


def _finding(subject: Subject, part: ModePart, edge: EdgePart, answer: Answer, found: Cycle) -> Finding:
    about = [*map(symbol, part.mode.states), subject.dynamics.residual(edge.edge.surface)]
    where = at(subject.dynamics, part.mode, answer, about)
    names = ", ".join(f"'{name}'" for name in found.edges)
    follow = "follow each other" if len(found.edges) > 1 else "follows itself"
    message = f"once '{edge.edge.name}' has fired {where}, {names} {follow} at one instant without end"
    hint = "give them different levels" if len(found.edges) > 1 else "let its reset lead inside the domain"
    return Finding(edge.document.to.place.span, message, hint, "sampled")


def _chained(subject: Subject, part: ModePart, edge: EdgePart) -> Iterator[Answer]:
    """Points of a guard from which another transition fires at once."""
    dynamics = subject.dynamics
    for surface, after in surfaces_of(dynamics.modes[edge.edge.target]):
        if after is not None:
            carried = dynamics.carried(dynamics.residual(surface), edge.edge)
            yield fires(dynamics, edge.edge, positive(carried))
    for landing in landings(dynamics, edge.edge):
        if landing.rate is not None and landing.edge is not None and not landing.returns:
            yield dynamics.ask_any(part.mode, landing.guard, positive(landing.rate))
