"""A state that nothing uses.

## What it does

Finds states that stand in no expression but their own flow and their own resets.

## Why it is bad

The run would be the same without it. Either it is left over, or a guard or a flow was meant to depend on it, or it is
what one wants to see; then `outputs` says so. Models without transitions, walls and outputs are left alone: their
states are all there is to see.

## Example

```yaml
modes:
  roll:
    flow: {x: 1, angle: 3}
    transitions: [{when: x >= 1, to: roll, reset: {x: 0}}]
```

## Use instead

```yaml
modes:
  roll:
    flow: {x: 1, angle: 3}
    transitions: [{when: x >= 1, to: roll, reset: {x: 0}}]
outputs: {turns: angle/(2*pi)}
```

## How it is decided

Symbolically, from the symbols in the model's expressions once `let` names are replaced.

## How to fix it

Remove the state, use it, or name under `outputs` what it is for.
"""

from __future__ import annotations

from collections.abc import Iterator

from hsdsl.lint.dependence import first_places
from hsdsl.lint.finding import Finding
from hsdsl.lint.subject import Subject


def check(subject: Subject) -> Iterator[Finding]:
    """Find states that nothing uses."""
    influence = subject.influence
    if not influence.roots:
        return
    for name, key in first_places(subject).items():
        if name not in influence.read:
            message = f"nothing depends on the state '{name}'"
            yield Finding(key.place.span, message, "remove it, use it, or give it a purpose under `outputs`")
