"""A wall that a guard repeats.

## What it does

Finds `domain` inequalities whose boundary is the surface of a transition without `if` of the same mode.

## Why it is bad

A guard bounds the domain by itself. Who changes one of the two will forget the other, and then the run stops at a wall
before the transition fires.

## Example

```yaml
modes:
  fall:
    flow: {h: v, v: -9.81}
    domain: [h >= 0]
    transitions: [{when: h <= 0, to: fall, reset: {v: -v}}]
```

## Use instead

```yaml
modes:
  fall:
    flow: {h: v, v: -9.81}
    transitions: [{when: h <= 0, to: fall, reset: {v: -v}}]
```

## How it is decided

Symbolically: the surface functions are equal once `let` names are replaced.

## How to fix it

Remove the wall; `--fix` does.
"""

from __future__ import annotations

from collections.abc import Iterator

from hsdsl.lint.edits import without_item
from hsdsl.lint.finding import Finding
from hsdsl.lint.subject import Subject


def check(subject: Subject) -> Iterator[Finding]:
    """Find walls that a guard makes unnecessary."""
    for part in subject.modes:
        guards = {edge.surface.residual: edge.name for edge in part.mode.edges if edge.condition is None}
        for index, wall in enumerate(part.mode.walls):
            if wall.residual in guards:
                message = f"the guard of '{guards[wall.residual]}' bounds the domain here already"
                fix = without_item(subject.node("modes", str(part.key), "domain"), index)
                yield Finding(part.document.domain[index].place.span, message, "leave the wall out", fix=fix)
