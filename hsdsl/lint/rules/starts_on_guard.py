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
and the time 0, with the parameters of the file. At a kink or a jump nothing is said.

## How to fix it

Start inside, or with the flow pointing in. If the start is on the guard on purpose, say so in an ignore comment.
"""

from __future__ import annotations

from collections.abc import Iterator

from hsdsl.lint.analysis.mode_point import ModePoint, Unsure, ranked
from hsdsl.lint.finding import Finding
from hsdsl.lint.numbers import holds
from hsdsl.lint.start import BEYOND, ON, leaves, side
from hsdsl.lint.subject import Subject
from hsdsl.system import Mode, Surface


def check(subject: Subject) -> Iterator[Finding]:
    """Find starts on a guard with outward flow."""
    part, start = subject.mode(subject.system.initial.mode), subject.start
    place = subject.document.initial.mode.place
    beyond = (e for e in part.mode.edges if e.condition is None and side(e.surface, start) == BEYOND)
    if part.mode.final or any(beyond):
        return  # the run ends, or another transition fires at once
    for edge in ranked(part.mode.edges):
        if holds(edge.condition, start) and _leaves(subject, part.mode, edge.surface):
            message = f"the run starts on the guard of '{edge.name}' with the flow pointing out, so it fires at once"
            yield Finding(place.span, message, "start inside, or with the flow pointing in")
            return
    for wall in part.mode.walls:
        if _leaves(subject, part.mode, wall):
            message = f"the run starts on the wall `{wall.text}` with the flow pointing out, and stops at once"
            yield Finding(place.span, message, "start inside")


def _leaves(subject: Subject, mode: Mode, surface: Surface) -> bool:
    """Whether the run starts on a surface, where neither has a kink, and the flow goes out."""
    if side(surface, subject.start) != ON or not leaves(mode, surface, subject.start):
        return False
    dynamics = subject.dynamics
    try:
        ModePoint(dynamics, mode, dynamics.starting_point).piece(dynamics.residual(surface), dynamics.flow(mode))
    except Unsure:
        return False
    return True
