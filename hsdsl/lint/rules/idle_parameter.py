"""A parameter that influences nothing to be seen.

## What it does

Finds parameters that are used, but only for states that influence no guard, condition, wall or output.

## Why it is bad

Changing it changes nothing that the model shows: it is part of what the scene does not need.

## Example

```yaml
parameters: {rate: 3}
modes:
  roll:
    flow: {x: 1, angle: rate}
    transitions: [{when: x >= 1, to: roll, reset: {x: 0}}]
```

## Use instead

```yaml
parameters: {rate: 3}
modes:
  roll:
    flow: {x: 1, angle: rate}
    transitions: [{when: x >= 1, to: roll, reset: {x: 0}}]
outputs: {turns: angle/(2*pi)}
```

## How it is decided

Symbolically: from guards, conditions, walls, outputs and settings backwards through flows, resets and initial values.

## How to fix it

Remove it together with the states it is for, or name under `outputs` what they are for.
"""

from __future__ import annotations

from collections.abc import Iterator

from hsdsl.lint.finding import Finding
from hsdsl.lint.subject import Subject
from hsdsl.lint.uses import Definition


def check(subject: Subject) -> Iterator[Finding]:
    """Find parameters that influence nothing."""
    influence = subject.influence
    if not influence.roots:
        return
    in_references = {name for e in subject.expressions if e.role == "reference" for name in e.names}
    for name in subject.document.parameters:
        unused = Definition("parameter", None, str(name)) in subject.unused
        if not unused and str(name) not in influence.needed | in_references:
            message = f"the parameter '{name}' influences no guard, condition, wall or output"
            yield Finding(name.place.span, message, "remove it with the states it is for, or show them under `outputs`")
