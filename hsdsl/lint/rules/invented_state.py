"""A state that comes from nowhere.

## What it does

Finds resets that give a state, which the source does not have, a value without any state, input or time in it. States
whose flow is a number are left alone: clocks begin at 0. A note where the value is 0, as of a current that begins to
flow.

## Why it is bad

What the target needs to know is not known in the source: a velocity that starts at 0 after every impact, wherever it
came from.

## Example

```yaml
parameters: {g: 9.81}
modes:
  roll:
    flow: {x: 1}
    transitions: [{when: x >= 1, to: fall, reset: {h: 2, v: 0}}]
  fall:
    flow: {x: 1, h: v, v: -g}
```

## Use instead

```yaml
parameters: {g: 9.81}
modes:
  roll:
    flow: {x: 1, h: 0}
    transitions: [{when: x >= 1, to: fall, reset: {v: -h/10}}]
  fall:
    flow: {x: 1, h: v, v: -g}
```

## How it is decided

Symbolically: the reset's expression has parameters alone, and the flow of the state in the target is no number.

## How to fix it

Carry the state through the modes before, or compute it from what is known there. If the value is indeed always the
same, say so in an ignore comment.
"""

from __future__ import annotations

from collections.abc import Iterator

from hsdsl.lint.finding import Finding
from hsdsl.lint.subject import ModePart, Subject


def check(subject: Subject) -> Iterator[Finding]:
    """Find states that a reset makes out of constants."""
    known = set(subject.system.parameter_symbols)
    flows = {m.name: dict(zip(m.states, m.flow, strict=True)) for m in subject.system.modes}
    for part in subject.modes:
        for item in part.edges:
            for name, value in zip(item.edge.target_states, item.edge.reset, strict=True):
                invented = name not in part.mode.states and value.free_symbols <= known
                if invented and not flows[item.edge.target].get(name, value).is_number:
                    place = next(key.place for key in item.document.reset if key == name)
                    message = f"the state '{name}' begins in '{item.edge.target}' with the same value every time"
                    yield Finding(place.span, message, _hint(part, value), severity="note" if value == 0 else None)


def _hint(part: ModePart, value: object) -> str:
    """What to do about it: a current that begins at 0 is often meant so."""
    ignore = "ignore this where it always begins so"
    if not part.mode.states:
        return ignore
    return (
        f"{ignore}, else compute it from the states of '{part.key}'"
        if value == 0
        else (f"compute it from the states of '{part.key}', or {ignore}")
    )
