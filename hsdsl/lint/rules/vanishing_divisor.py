"""A division by something that can be zero.

## What it does

Finds divisors (and cosines under a `tan`) that vanish at a point of the mode's domain, or, in a reset, of its guard.
A warning where the divisor passes through zero, a note where it is zero only at a point that runs miss, such as the
length of a vector.

## Why it is bad

The expression has no value there, and a run that comes near stops with `not_finite` or creeps.

## Example

```yaml
modes:
  fall:
    flow: {r: v, v: -1/r**2}
initial: {mode: fall, r: 1, v: 0}
```

## Use instead

```yaml
parameters: {surface: 0.1}
modes:
  fall:
    flow: {r: v, v: -1/r**2}
    transitions: [{when: r <= surface, to: landed}]
  landed:
    final: true
initial: {mode: fall, r: 1, v: 0}
```

## How it is decided

A zero of the divisor is looked for in the domain, symbolically or by search, and one where its gradient does not
vanish.

## How to fix it

End the domain before, with a guard or a wall (`domain`).
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from hsdsl.lint.analysis.dynamics import Clause
from hsdsl.lint.analysis.places import evaluated
from hsdsl.lint.analysis.question import Answer, positive, zero
from hsdsl.lint.analysis.repeats import Repeats
from hsdsl.lint.analysis.singularities import divisors
from hsdsl.lint.analysis.wording import at
from hsdsl.lint.finding import Finding
from hsdsl.lint.subject import ModePart, Subject


def check(subject: Subject) -> Iterator[Finding]:
    """Find divisors that vanish."""
    found = Repeats("expression", "with this divisor")
    for part in subject.modes:
        for expression in evaluated(subject, part, ("flow", "when", "domain", "reset")):
            for divisor in divisors(expression.expr):
                if found.again(divisor):
                    continue
                answer, through = _vanishes(subject, part, divisor, expression.where)
                if answer.somewhere:
                    where = at(subject.dynamics, part.mode, answer, [divisor])
                    message = f"what is divided by here is zero {where}, in the domain of the mode '{part.mode.name}'"
                    hint = "end the domain before, with a guard or a wall"
                    decided, severity = answer.decided or "sampled", "warning" if through else "note"
                    span = expression.written.span()
                    found.add(divisor, Finding(span, message, hint, decided, severity=severity))
    yield from found


def _vanishes(subject: Subject, part: ModePart, divisor: Any, where: tuple[Clause, ...]) -> tuple[Answer, bool]:
    dynamics = subject.dynamics
    slopes = dynamics.gradient(part.mode, divisor)
    if slopes is not None:
        steep = positive(sum(slope**2 for slope in slopes))
        answer = dynamics.ask_any(part.mode, where, zero(divisor), steep)
        if answer.somewhere:
            return answer, True
    return dynamics.ask_any(part.mode, where, zero(divisor)), False
