"""A run that starts on a guard and leaves through it.

## What it does

Finds initial states on the surface of a guard or a wall, with the flow pointing out of the domain.

## Why it is bad

The first transition happens at the start itself, or, at a wall, the run stops there. With a reset that leaves the
state where it is, that is a Zeno point at time 0, to which the convergence theorem does not apply. Oscillator 2 of
the paper starts so, on purpose: it is held by its stop.

## Example

```yaml
modes:
  fall:
    flow: {h: v, v: -9.81}
    transitions: [{when: h <= 0, to: fall, reset: {v: -v}}]
initial: {mode: fall, h: 0, v: 0}
```

## Use instead

```yaml
modes:
  fall:
    flow: {h: v, v: -9.81}
    transitions: [{when: h <= 0, to: fall, reset: {v: -v}}]
initial: {mode: fall, h: 0, v: 1}
```

## How it is decided

By the first derivative of the surface function along the flow that is not 0, up to the fourth, at the initial state
and the time 0, with the parameters of the file.

## How to fix it

Start inside, or with the flow pointing in. If the start is on the guard on purpose, say so in an ignore comment.
"""

from __future__ import annotations

from collections.abc import Iterator

from hsdsl.lint.finding import Finding
from hsdsl.lint.numbers import holds
from hsdsl.lint.start import ON, leaves, side
from hsdsl.lint.subject import Subject


def check(subject: Subject) -> Iterator[Finding]:
    """Find starts on a guard with outward flow."""
    part, start = subject.mode(subject.system.initial.mode), subject.start
    place = subject.document.initial.mode.place
    for wall in part.mode.walls:
        if side(wall, start) == ON and leaves(part.mode, wall, start):
            message = f"the run starts on the wall `{wall.text}` with the flow pointing out, and stops at once"
            yield Finding(place.span, message, "start inside")
    for edge in part.mode.edges:
        if side(edge.surface, start) == ON and holds(edge.condition, start) and leaves(part.mode, edge.surface, start):
            message = f"the run starts on the guard of '{edge.name}' with the flow pointing out, so it fires at once"
            yield Finding(place.span, message, "start inside, or with the flow pointing in")
