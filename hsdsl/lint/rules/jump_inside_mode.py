"""A flow or a reset that jumps.

## What it does

Finds flows, surfaces and resets with `sign`, `floor` or `atan2` that jump at a point of the domain (a reset: of its
guard).

## Why it is bad

A flow that jumps inside a mode is a switch that the model does not say. No integrator keeps its order across it, the
theory's flows are Lipschitz, and where the flow points to the jump from both sides there may be no solution at all.
A reset that jumps sends neighbouring runs to different places.

## Example

```yaml
parameters: {mu: 0.3}
modes:
  slide:
    flow: {x: v, v: -mu*sign(v)}
initial: {mode: slide, x: 0, v: 1}
```

## Use instead

```yaml
parameters: {mu: 0.3}
modes:
  slide:
    flow: {x: v, v: -mu}
    transitions: [{when: v <= 0, to: rest, reset: {v: 0}}]
  rest:
    flow: {x: 0, v: 0}
initial: {mode: slide, x: 0, v: 1}
```

## How it is decided

A point of the domain where the function jumps, and where what it is multiplied with does not vanish, is looked for:
symbolically, or by search. `floor` is looked at where its argument is -1, 0, 1 or 2.

## How to fix it

Make a mode of each side, with a transition where the function jumps.
"""

from __future__ import annotations

from collections.abc import Iterator

from hsdsl.lint.analysis.places import evaluated
from hsdsl.lint.analysis.repeats import Repeats
from hsdsl.lint.analysis.singularities import jumps
from hsdsl.lint.analysis.wording import at
from hsdsl.lint.finding import Finding
from hsdsl.lint.subject import Subject

_WHAT = {"flow": "the flow of '{}'", "reset": "the reset of '{}'", "when": "this surface", "domain": "this wall"}


def check(subject: Subject) -> Iterator[Finding]:
    """Find jumps."""
    dynamics = subject.dynamics
    found = Repeats("expression")
    for part in subject.modes:
        for expression in evaluated(subject, part, tuple(_WHAT)):
            for jump in jumps(expression.expr):
                inside = [(*where, *more) for where in expression.where for more in jump.alternatives]
                answer = dynamics.ask_any(part.mode, inside)
                if answer.somewhere:
                    what = _WHAT[expression.written.role].format(expression.written.name)
                    where = at(dynamics, part.mode, answer, jump.expr.args)
                    message = f"{what} jumps {where}, where `{jump.said}` does"
                    hint = "make a mode of each side, with a transition where it jumps"
                    finding = Finding(expression.written.span(), message, hint, answer.decided or "sampled")
                    found.add((jump.expr, expression.expr), finding)
                    break
    yield from found
