"""Guards that can be reached together.

## What it does

Finds pairs of transitions of one mode whose guards overlap. A warning where the order matters: where the two orders
are not known to lead to one mode with the same states. A note where they do: the transitions commute.

## Why it is bad

Of transitions that are reached together, one goes first: that of the higher `priority`, then the first in the file
([M6](../../meaning.md#m6-together)). Where the order matters, runs that pass on both sides of the overlap differ for
good, and round-off decides. Where the transitions commute, either order is right.

## Example

```yaml
modes:
  table:
    flow: {x: 1, y: 1}
    transitions:
      - {when: x >= 1, to: right}
      - {when: y >= 1, to: top}
  right:
    flow: {x: 1, y: 0}
  top:
    flow: {x: 0, y: 1}
initial: {mode: table, x: 0, y: 0}
```

## Use instead

```yaml
modes:
  table:
    flow: {x: 1, y: 0}
    transitions:
      - {when: x >= 1, if: y < 1, to: right}
      - {when: x >= 1, if: y >= 1, to: top}
  right:
    flow: {x: 1, y: 0}
  top:
    flow: {x: 0, y: 1}
initial: {mode: table, x: 0, y: 0}
```

## How it is decided

A point on both guards is looked for, symbolically or by search. Then both orders are followed through the transitions
that are sure to fire at that instant, at most three, and the states they lead to are compared symbolically, or at
sampled points.

## How to fix it

Separate the guards with an `if` each, add the transitions that let both orders meet again, or say with `priority`
which goes first and ignore the finding.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations

from hsdsl.lint.analysis.orders import commute, together
from hsdsl.lint.analysis.repeats import Repeats
from hsdsl.lint.analysis.words import at
from hsdsl.lint.finding import Finding
from hsdsl.lint.subject import EdgePart, ModePart, Subject


def check(subject: Subject) -> Iterator[Finding]:
    """Find guards that overlap."""
    found = Repeats("pair")
    for part in subject.modes:
        for first, second in combinations(part.edges, 2):
            _look(subject, part, first, second, found)
    yield from found


def _look(subject: Subject, part: ModePart, first: EdgePart, second: EdgePart, found: Repeats) -> None:
    dynamics, mode = subject.dynamics, part.mode
    for overlap in together(dynamics, first.edge, second.edge) or ():
        answer = dynamics.ask(mode, overlap)
        if not answer.somewhere:
            continue
        same = commute(dynamics, first.edge, second.edge, overlap, answer.point)
        residuals = [dynamics.residual(edge.edge.surface) for edge in (first, second)]
        where = at(dynamics, mode, answer, residuals)
        then = "they commute: either order leads to the same state" if same else "it matters which goes first"
        message = f"the guards of '{first.edge.name}' and '{second.edge.name}' overlap, {where}; {then}"
        hint = None if same else "separate them with `if`, or say with `priority` which goes first"
        span = second.document.when.place.span
        severity = "note" if same else "warning"
        kind = (same, *(dynamics.rate(mode, residual) for residual in residuals))
        found.add(kind, Finding(span, message, hint, answer.decided or "sampled", severity=severity))
        return
