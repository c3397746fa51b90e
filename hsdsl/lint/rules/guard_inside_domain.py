"""A guard that lies inside its domain.

## What it does

Finds transitions with an `if` whose surface can be passed where no `if` of that surface holds.

## Why it is bad

It may be meant. But the theory asks for guards on the boundary of the domain, so that a run cannot go round a guard:
two runs on both sides of the edge of such a guard, one that fires and one that passes, are close before and far apart
afterwards, and the simulation's error has no bound there.

## Example

```yaml
modes:
  flight:
    flow: {x: v, h: w, v: 0, w: -9.81}
    transitions:
      - {when: x >= 5, if: h <= 2, to: flight, reset: {v: -v}}
```

## Use instead

Say what happens in the rest of the surface too.

```yaml
modes:
  flight:
    flow: {x: v, h: w, v: 0, w: -9.81}
    transitions:
      - {when: x >= 5, if: h <= 2, to: flight, reset: {v: -v}}
      - {when: x >= 5, if: h > 2, to: beyond}
  beyond:
    flow: {x: v, h: w, v: 0, w: -9.81}
```

## How it is decided

A point of the surface is looked for, in the domain and with the flow going out, where no transition with the same
surface has an `if` that holds: symbolically, or by search.

## How to fix it

Add a transition for the rest of the surface, or ignore the finding where passing is meant.
"""

from __future__ import annotations

from collections.abc import Iterator

from hsdsl.lint.analysis.passing import passes_by
from hsdsl.lint.analysis.wording import at
from hsdsl.lint.finding import Finding
from hsdsl.lint.subject import Subject


def check(subject: Subject) -> Iterator[Finding]:
    """Find surfaces that can be passed beside their guards."""
    dynamics = subject.dynamics
    for part in subject.modes:
        told: set[object] = set()
        for edge in part.edges:
            if edge.edge.condition is None or edge.document.condition is None:
                continue
            residual = dynamics.residual(edge.edge.surface)
            answer = passes_by(dynamics, edge.edge)
            if not answer.somewhere or residual in told:
                continue
            told.add(residual)
            inside = [constraint.expr for constraint in dynamics.domain(part.mode, without=edge.edge)]
            about = [residual, dynamics.placed(edge.edge.condition), dynamics.rate(part.mode, residual), *inside]
            where = at(dynamics, part.mode, answer, about)
            message = (
                f"the guard of '{edge.edge.name}' lies inside its domain: {where} the flow passes its surface,"
                " and nothing fires"
            )
            hint = "add a transition for the rest of the surface, unless passing is meant"
            yield Finding(edge.document.condition.place.span, message, hint, answer.decided or "sampled")
