"""A transition that another one always forestalls.

## What it does

Finds transitions whose surface is that of another transition of the mode which goes first, by its `priority` or by
standing first in the file, and which has no condition or the same one.

## Why it is bad

It can never fire: of transitions that are reached together only the first goes.

## Example

```yaml
modes:
  m:
    flow: {x: 1, y: 0}
    transitions:
      - {when: x >= 1, to: m, reset: {x: 0}}
      - {when: x >= 1, if: y > 0, to: n}
  n:
    final: true
```

## Use instead

```yaml
modes:
  m:
    flow: {x: 1, y: 0}
    transitions:
      - {when: x >= 1, if: y > 0, to: n}
      - {when: x >= 1, to: m, reset: {x: 0}}
  n:
    final: true
```

## How it is decided

Symbolically: the surface functions are equal once `let` names are replaced.

## How to fix it

Put the one with the stricter condition first, give it a higher `priority`, or give the other one a condition.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from hsdsl.lint.finding import Finding
from hsdsl.lint.subject import EdgePart, Subject


def check(subject: Subject) -> Iterator[Finding]:
    """Find transitions that cannot fire."""
    for part in subject.modes:
        winners: dict[Any, EdgePart] = {}
        for item in sorted(part.edges, key=lambda item: (-item.edge.priority, item.index)):
            residual, condition = item.edge.surface.residual, item.edge.condition
            winner = winners.get((residual, None)) or winners.get((residual, condition))
            if winner is None:
                winners[residual, condition] = item
            elif (winner.edge.target, winner.edge.reset) != (item.edge.target, item.edge.reset):
                message = f"this transition never fires: '{winner.edge.name}' goes first on the same surface"
                hint = "put the stricter one first, or give the other one a condition"
                yield Finding(item.document.when.place.span, message, hint)
