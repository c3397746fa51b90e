"""A mode that no run enters.

## What it does

Finds modes to which no sequence of transitions leads from the initial mode, nor from an initial mode that a
`reference` sets.

## Why it is bad

The mode is left over, or the transition that should lead to it is missing or leads elsewhere.

## Example

```yaml
modes:
  heating:
    flow: {T: 30 - T}
    transitions:
      - {when: T >= 22, to: heating, reset: {T: 18}}
  idle:
    flow: {T: 10 - T}
    transitions:
      - {when: T <= 18, to: heating}
```

## Use instead

```yaml
modes:
  heating:
    flow: {T: 30 - T}
    transitions:
      - {when: T >= 22, to: idle}
  idle:
    flow: {T: 10 - T}
    transitions:
      - {when: T <= 18, to: heating}
```

## How it is decided

Symbolically, from the transitions alone: every one of them is taken to be possible.

## How to fix it

Let a transition lead to the mode, or remove it.
"""

from __future__ import annotations

from collections.abc import Iterator

from hsdsl.lint.finding import Finding
from hsdsl.lint.subject import Subject


def check(subject: Subject) -> Iterator[Finding]:
    """Find modes that cannot be reached."""
    for part in subject.modes:
        if part.mode.name not in subject.reachable:
            message = f"no transition leads from the initial mode to the mode '{part.key}'"
            yield Finding(part.key.place.span, message, "let a transition lead to it, or remove it")
