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

The rate of the surface function, L_f r, is computed symbolically. Where it contains time or an input, one state of the
surface is looked for, and two times (and values of the inputs) at which the rate has either sign there: symbolically,
or by search.

## How to fix it

Nothing has to be done for a simulation, which looks at the direction when it gets there. For distances, let time or
the input enter the surface slowly enough, or make what moves a state.
"""

from __future__ import annotations

from collections.abc import Iterator

from hsdsl.lint.analysis.question import negative, positive
from hsdsl.lint.analysis.twice import twice
from hsdsl.lint.analysis.wording import at, number
from hsdsl.lint.finding import Finding
from hsdsl.lint.subject import Subject
from hsdsl.system import TIME


def check(subject: Subject) -> Iterator[Finding]:
    """Find guards whose direction changes with time."""
    dynamics = subject.dynamics
    moving = {TIME, *dynamics.inputs}
    for part in subject.modes:
        for edge in part.edges:
            residual = dynamics.residual(edge.edge.surface)
            rate = dynamics.rate(part.mode, residual)
            if rate is None or not rate.free_symbols & moving:
                continue
            surface = dynamics.guard(edge.edge, pointing_out=False) or []
            answer, later = twice(dynamics, part.mode, surface, negative(rate), positive(rate))
            if not answer.somewhere:
                continue
            about = [residual, rate]
            where = at(dynamics, part.mode, answer, about)
            changed = {s for expr in about for s in expr.free_symbols & moving}
            then = ", ".join(f"{s.name} = {number(later[s])}" for s in later if s in changed)
            message = (
                f"whether the flow leaves through the guard of '{edge.edge.name}' depends on time: "
                f"{where} it points back into the domain, and out of it with {then}"
            )
            yield Finding(edge.document.when.place.span, message, None, answer.decided or "sampled")
