"""Two transitions of one mode that are the same.

## What it does

Finds transitions with the surface, the condition, the target and the reset of another one of their mode.

## Why it is bad

One of them does nothing. Most often a copy was made and not changed.

## Example

```yaml
modes:
  m:
    flow: {x: 1, y: 1}
    transitions:
      - {when: x >= 1, to: m, reset: {x: 0}}
      - {when: x >= 1, to: m, reset: {x: 0}}
```

## Use instead

```yaml
modes:
  m:
    flow: {x: 1, y: 1}
    transitions:
      - {when: x >= 1, to: m, reset: {x: 0}}
      - {when: y >= 1, to: m, reset: {y: 0}}
```

## How it is decided

Symbolically: the expressions are equal once `let` names are replaced.

## How to fix it

Remove one, or change it.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from hsdsl.lint.finding import Finding
from hsdsl.lint.subject import Subject


def check(subject: Subject) -> Iterator[Finding]:
    """Find transitions that repeat another one."""
    for part in subject.modes:
        first: dict[Any, int] = {}
        for item in part.edges:
            edge = item.edge
            line = item.document.when.place.span.line
            earlier = first.setdefault((edge.surface.residual, edge.condition, edge.target, edge.reset), line)
            if earlier is not line:
                message = f"this transition is the same as the one of line {earlier}"
                yield Finding(item.document.when.place.span, message, "remove it, or change it")
