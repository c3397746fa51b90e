"""A state that influences nothing to be seen.

## What it does

Finds states that other expressions use, and that still cannot change any guard, condition, wall or output, in whatever
way: only states that are idle themselves depend on them.

## Why it is bad

The scene needs less: every step computes them, the distance between two runs counts them, and the relaxation and the
tolerance hold for them too. Models without transitions, walls and outputs are left alone.

## Example

```yaml
modes:
  run:
    flow: {x: 1, heat: 1, wear: heat}
    transitions: [{when: x >= 1, to: run, reset: {x: 0}}]
```

## Use instead

```yaml
modes:
  run:
    flow: {x: 1, heat: 1, wear: heat}
    transitions: [{when: x >= 1, to: run, reset: {x: 0}}]
outputs: {worn: wear}
```

## How it is decided

Symbolically: from guards, conditions, walls and outputs backwards through flows and resets. Every transition is taken
to be possible.

## How to fix it

Remove the states, or name under `outputs` what they are for.
"""

from __future__ import annotations

from collections.abc import Iterator

from hsdsl.lint.dependence import first_places
from hsdsl.lint.finding import Finding
from hsdsl.lint.subject import Subject


def check(subject: Subject) -> Iterator[Finding]:
    """Find states that influence nothing."""
    influence = subject.influence
    if not influence.roots:
        return
    for name, key in first_places(subject).items():
        if name in influence.read and name not in influence.needed:
            message = f"the state '{name}' influences no guard, condition, wall or output"
            yield Finding(key.place.span, message, "remove it, or give it a purpose under `outputs`")
