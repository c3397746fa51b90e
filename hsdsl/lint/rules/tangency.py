"""A flow that can touch a guard without crossing it.

## What it does

Finds guards on which L_f r, the rate of the surface function along the flow, can vanish.

## Why it is bad

Where a run touches a guard, a run beside it misses it, and the two go different ways: what comes after depends on how
accurate the simulation is, and the error bounds hold only for runs that keep away from such points. For a stop or a
floor such points (v = 0) cannot be avoided; it is the runs near them that are to be watched.

## Example

```yaml
parameters: {x_max: 14}
modes:
  free:
    flow: {x: v, v: -x}
    transitions:
      - {when: x >= x_max, to: free, reset: {v: -v}}
initial: {mode: free, x: 0, v: 20}
```

## Use instead

A guard that the flow crosses at a speed.

```yaml
parameters: {T_max: 22}
modes:
  heating:
    flow: {T: 30 - T}
    transitions:
      - {when: T >= T_max, to: heating, reset: {T: 18}}
initial: {mode: heating, T: 20}
```

## How it is decided

A point of the guard with L_f r = 0 is looked for, symbolically or by search. Where the second derivative of r along
the flow can be negative there, runs from inside the domain can come to it (they graze); else only a run that rests on
the surface or starts there does.

## How to fix it

Nothing has to be done where runs keep away from the point. Where they do not, look at them with a smaller tolerance,
or change the surface.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from hsdsl.lint.analysis.question import Answer, negative, zero
from hsdsl.lint.analysis.repeats import Repeats
from hsdsl.lint.analysis.words import at
from hsdsl.lint.finding import Finding
from hsdsl.lint.subject import EdgePart, ModePart, Subject


def check(subject: Subject) -> Iterator[Finding]:
    """Find guards that can be touched."""
    found = Repeats("guard")
    for part in subject.modes:
        for edge in part.edges:
            residual = subject.dynamics.residual(edge.edge.surface)
            rate = subject.dynamics.rate(part.mode, residual)
            if rate is None or rate.is_number or found.again(rate):
                continue
            bend = subject.dynamics.rate(part.mode, rate)
            answer, grazing = _touched(subject, part, edge, rate, bend)
            if answer.somewhere:
                where = at(subject.dynamics, part.mode, answer, [residual, rate, bend if grazing else None])
                how = "runs can graze it" if grazing else "runs come there only by resting on it, or by starting there"
                message = f"the flow does not cross the guard of '{edge.edge.name}' {where}, where L_f r = 0: {how}"
                span = edge.document.when.place.span
                found.add(rate, Finding(span, message, None, answer.decided or "sampled"))
    yield from found


def _touched(subject: Subject, part: ModePart, edge: EdgePart, rate: Any, bend: Any) -> tuple[Answer, bool]:
    guard = subject.dynamics.guard(edge.edge)
    if bend is not None:
        answer = subject.dynamics.ask_any(part.mode, guard, zero(rate), negative(bend))
        if answer.somewhere:
            return answer, True
    return subject.dynamics.ask_any(part.mode, guard, zero(rate)), False
