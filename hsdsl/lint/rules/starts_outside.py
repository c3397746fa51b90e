"""An initial state outside its domain.

## What it does

Finds initial states beyond a wall, or beyond the guard of a transition without `if`.

## Why it is bad

Beyond a wall the run stops before it begins. Beyond a guard the transition fires at once, where the theory has no
transition at all: its executions start inside.

## Example

```yaml
modes:
  fall:
    flow: {h: v, v: -9.81}
    transitions: [{when: h <= 0, to: fall, reset: {v: -v}}]
initial: {mode: fall, h: -1, v: 0}
```

## Use instead

```yaml
modes:
  fall:
    flow: {h: v, v: -9.81}
    transitions: [{when: h <= 0, to: fall, reset: {v: -v}}]
initial: {mode: fall, h: 1, v: 0}
```

## How it is decided

By the values of the surface functions at the initial state and the time 0, with the parameters of the file, compared
with their round-off.

## How to fix it

Start inside, or turn the inequality round.
"""

from __future__ import annotations

from collections.abc import Iterator

from hsdsl.lint.analysis.mode_point import ranked
from hsdsl.lint.finding import Finding
from hsdsl.lint.start import BEYOND, side
from hsdsl.lint.subject import Subject


def check(subject: Subject) -> Iterator[Finding]:
    """Find initial states outside their domain."""
    part = subject.mode(subject.system.initial.mode)
    place, hint = subject.document.initial.mode.place, "start inside, or turn the inequality round"
    if part.mode.final:
        return
    edges = [edge for edge in part.mode.edges if edge.condition is None and side(edge.surface, subject.start) == BEYOND]
    first = ranked(edges)[0] if edges else None
    for wall in part.mode.walls:
        if side(wall, subject.start) == BEYOND:
            then = f"'{first.name}' fires at once" if first else "stops at once"
            yield Finding(place.span, f"the run starts beyond the wall `{wall.text}` and {then}", hint)
    for edge in edges:
        message = f"the run starts beyond the guard `{edge.surface.text}`, so '{first and first.name}' fires at once"
        yield Finding(place.span, message, hint)
