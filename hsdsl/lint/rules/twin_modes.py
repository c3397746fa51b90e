"""Two modes that do the same.

## What it does

Finds modes with the states, flow, walls, transitions and outputs of another one. Final modes are left alone: their
names say how a run ended.

## Why it is bad

One of them is enough. Often a copy was made and not changed.

## Example

```yaml
modes:
  a:
    flow: {x: 1}
    transitions: [{when: x >= 1, to: b, reset: {x: 0}}]
  b:
    flow: {x: 2}
    transitions: [{when: x >= 2, to: c, reset: {x: 0}}]
  c:
    flow: {x: 1}
    transitions: [{when: x >= 1, to: b, reset: {x: 0}}]
```

## Use instead

```yaml
modes:
  a:
    flow: {x: 1}
    transitions: [{when: x >= 1, to: b, reset: {x: 0}}]
  b:
    flow: {x: 2}
    transitions: [{when: x >= 2, to: a, reset: {x: 0}}]
```

## How it is decided

Symbolically: the expressions are equal once `let` names are replaced, and the transitions lead to the same modes, or
each back to its own.

## How to fix it

Remove one of them, and let its transitions lead to the other.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from hsdsl.lint.finding import Finding
from hsdsl.lint.subject import Subject
from hsdsl.system import Mode


def check(subject: Subject) -> Iterator[Finding]:
    """Find modes that do what another one does."""
    first: dict[Any, str] = {}
    for part in subject.modes:
        if not part.mode.final and part.mode.states:
            twin = first.setdefault(_behaviour(part.mode), part.mode.name)
            if twin != part.mode.name:
                message = f"the mode '{part.key}' does the same as '{twin}'"
                yield Finding(part.key.place.span, message, f"let its transitions lead to '{twin}', and remove it")


def _behaviour(mode: Mode) -> Any:
    edges = tuple(
        (e.surface.residual, e.condition, None if e.target == mode.name else e.target, e.reset, e.priority)
        for e in mode.edges
    )
    return (mode.states, mode.flow, tuple(wall.residual for wall in mode.walls), edges, mode.outputs)
