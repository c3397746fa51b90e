"""A transition to its own mode that changes nothing.

## What it does

Finds transitions that lead back to their mode and give every state the value it has.

## Why it is bad

The state is on the surface before and after, with the same flow out of it: the transition fires again at once,
without end. Most often the `reset` is missing.

## Example

```yaml
modes:
  fall:
    flow: {h: v, v: -9.81}
    transitions: [{when: h <= 0, to: fall}]
```

## Use instead

```yaml
modes:
  fall:
    flow: {h: v, v: -9.81}
    transitions: [{when: h <= 0, to: fall, reset: {v: -v}}]
```

## How it is decided

Symbolically: the target is the mode itself, and every new value is the state itself.

## How to fix it

Write the `reset`, lead elsewhere, or remove the transition.
"""

from __future__ import annotations

from collections.abc import Iterator

from hsdsl.expression.scope import symbol
from hsdsl.lint.finding import Finding
from hsdsl.lint.subject import Subject


def check(subject: Subject) -> Iterator[Finding]:
    """Find transitions that change nothing."""
    for part in subject.modes:
        same = tuple(symbol(name) for name in part.mode.states)
        for edge in part.edges:
            if edge.edge.target == part.mode.name and edge.edge.reset == same:
                message = f"this transition leads back to '{part.key}' and changes nothing, so it fires again at once"
                yield Finding(edge.document.to.place.span, message, "write what it does under `reset`")
