"""A state that is lost on the way to another mode.

## What it does

Finds transitions to a mode without a state of the source, where neither the reset nor the guard of the transition
uses that state. States whose flow is a number are left alone: clocks, and places to remember something in, come and
go with their mode.

## Why it is bad

Whatever the state stood for ends to exist. Often the target's `flow` lacks an entry.

## Example

```yaml
parameters: {g: 9.81}
modes:
  fall:
    flow: {h: v, v: -g, x: u, u: -u}
    transitions: [{when: h <= 0, to: slide}]
  slide:
    flow: {x: 1}
```

## Use instead

```yaml
parameters: {g: 9.81}
modes:
  fall:
    flow: {h: v, v: -g, x: u, u: -u}
    transitions: [{when: h <= 0, to: slide, reset: {u: u/2 + v/10}}]
  slide:
    flow: {x: u, u: -u}
```

## How it is decided

Symbolically, from the symbols in the reset and in the guard once `let` names are replaced.

## How to fix it

Give the target the state, or let the reset use it. If the state has indeed no meaning there, say so in an ignore
comment.
"""

from __future__ import annotations

from collections.abc import Iterator

from hsdsl.expression.scope import symbol
from hsdsl.lint.finding import Finding
from hsdsl.lint.subject import Subject


def check(subject: Subject) -> Iterator[Finding]:
    """Find states that a transition forgets."""
    for part in subject.modes:
        moving = {name for name, rate in zip(part.mode.states, part.mode.flow, strict=True) if not rate.is_number}
        for item in part.edges:
            edge = item.edge
            used = edge.surface.residual.free_symbols.union(*(value.free_symbols for value in edge.reset))
            for name in part.mode.states:
                if name in moving and name not in edge.target_states and symbol(name) not in used:
                    message = f"the state '{name}' is lost on the way from '{part.key}' to '{edge.target}'"
                    hint = f"give '{edge.target}' the state, or use it in the reset"
                    yield Finding(item.document.to.place.span, message, hint)
