"""A guard that is left or entered depending on time.

## What it does

Finds guards where the direction of the flow through the surface depends on time or on an input: at one and the same
state it points out at some times and back into the domain at others.

## Why it is bad

The theory's guards are sets of states that the flow leaves through, once and for all. Here a state on the surface can
leave or stay, depending on when it gets there, and the distances of the theory treat the surface as if it could
always be passed. A moving stop or a switching threshold is of this kind.

## Example

```yaml
modes:
  follow:
    flow: {x: 1}
    transitions:
      - {when: x >= 2*sin(t) + 1, to: follow, reset: {x: 0}}
experiment: {until: 10}
```

## Use instead

```yaml
modes:
  follow:
    flow: {x: 1}
    transitions:
      - {when: x >= 1 + sin(t)/2, to: follow, reset: {x: 0}}
experiment: {until: 10}
```

## How it is decided

The rate of the surface function, L_f r, is computed symbolically. Where it contains time or an input, two points of
the surface are looked for, one with each sign.

## How to fix it

Nothing has to be done for a simulation, which looks at the direction when it gets there. For distances, let time or
the input enter the surface slowly enough, or make what moves a state.
"""

from __future__ import annotations

from collections.abc import Iterator

from hsdsl.expression.scope import symbol
from hsdsl.lint.analysis.question import negative, positive
from hsdsl.lint.analysis.words import at
from hsdsl.lint.finding import Finding
from hsdsl.lint.subject import Subject
from hsdsl.system import TIME


def check(subject: Subject) -> Iterator[Finding]:
    """Find guards whose direction changes with time."""
    dynamics = subject.dynamics
    moving = {TIME, *(symbol(given.name) for given in subject.system.inputs)}
    for part in subject.modes:
        for edge in part.edges:
            residual = dynamics.residual(edge.edge.surface)
            rate = dynamics.rate(part.mode, residual)
            if rate is None or not rate.free_symbols & moving:
                continue
            surface = dynamics.guard(edge.edge, pointing_out=False)
            inward = dynamics.ask_any(part.mode, surface, negative(rate))
            if not inward.somewhere or not dynamics.ask_any(part.mode, surface, positive(rate)).somewhere:
                continue
            where = at(dynamics, part.mode, inward, [residual, rate])
            message = (
                f"whether the flow leaves through the guard of '{edge.edge.name}' depends on time: "
                f"{where} it points back into the domain"
            )
            yield Finding(edge.document.when.place.span, message, None, inward.decided or "sampled")
