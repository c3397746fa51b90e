"""A state that never changes.

## What it does

Finds states whose flow is 0 in every mode and that every reset leaves as they are.

## Why it is bad

It is a parameter in disguise: it makes every step and every distance larger, and hides that its value is fixed.

## Example

```yaml
modes:
  fall:
    flow: {h: v, v: -g, g: 0}
    transitions: [{when: h <= 0, to: fall, reset: {v: -v}}]
initial: {mode: fall, h: 1, v: 0, g: 9.81}
```

## Use instead

```yaml
parameters: {g: 9.81}
modes:
  fall:
    flow: {h: v, v: -g}
    transitions: [{when: h <= 0, to: fall, reset: {v: -v}}]
initial: {mode: fall, h: 1, v: 0}
```

## How it is decided

Symbolically: the flows are 0 and the resets the identity once `let` names are replaced.

## How to fix it

Make it a parameter. A place to remember something in, which a reset sets, is no such state.
"""

from __future__ import annotations

from collections.abc import Iterator

from hsdsl.expression.scope import symbol
from hsdsl.lint.dependence import first_places
from hsdsl.lint.finding import Finding
from hsdsl.lint.subject import Subject


def check(subject: Subject) -> Iterator[Finding]:
    """Find states that never change."""
    changing: set[str] = set()
    for mode in subject.system.modes:
        changing.update(name for name, rate in zip(mode.states, mode.flow, strict=True) if rate != 0)
        for edge in mode.edges:
            new = zip(edge.target_states, edge.reset, strict=True)
            changing.update(name for name, value in new if value != symbol(name))
    for name, key in first_places(subject).items():
        if name not in changing:
            yield Finding(key.place.span, f"the state '{name}' never changes", "make it a parameter")
