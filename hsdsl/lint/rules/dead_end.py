"""A mode that is entered and never left.

## What it does

Finds modes to which a transition leads and from which none does, and that are not `final`.

## Why it is bad

The run goes on there to its end without anything happening. Where the model is over at that point, `final: true` says
so and ends the run; where it is not, a transition is missing.

## Example

```yaml
modes:
  drive:
    flow: {x: 1}
    transitions: [{when: x >= 1, to: crash}]
  crash:
    flow: {x: 0}
```

## Use instead

```yaml
modes:
  drive:
    flow: {x: 1}
    transitions: [{when: x >= 1, to: crash}]
  crash:
    final: true
```

## How it is decided

Symbolically, from the transitions alone.

## How to fix it

Write `final: true`, or the transition that leads out. If the run is meant to go on there, say so in an ignore comment.
"""

from __future__ import annotations

from collections.abc import Iterator

from hsdsl.lint.finding import Finding
from hsdsl.lint.subject import Subject


def check(subject: Subject) -> Iterator[Finding]:
    """Find modes that nothing leaves."""
    entered = {edge.target for mode in subject.system.modes for edge in mode.edges}
    for part in subject.modes:
        if part.mode.name in entered and not part.mode.edges and not part.mode.final:
            message = f"the mode '{part.key}' is entered and never left"
            yield Finding(part.key.place.span, message, "write `final: true`, or the transition that leads out")
