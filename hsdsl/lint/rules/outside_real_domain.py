"""A square root or a logarithm of something that can be negative.

## What it does

Finds arguments of `sqrt`, fractional powers, `log`, `asin`, `acos`, `acosh` and `atanh` that leave the function's
real domain at a point of the mode's domain, or, in a reset, of its guard.

## Why it is bad

The expression has no real value there, and a run that gets there stops with `not_finite`. A trial step of the
integrator may get there even where the run does not.

## Example

```yaml
modes:
  drain:
    flow: {h: -sqrt(h)}
initial: {mode: drain, h: 1}
```

## Use instead

```yaml
modes:
  drain:
    flow: {h: -sqrt(h)}
    transitions: [{when: h <= 0.001, to: empty}]
  empty:
    final: true
initial: {mode: drain, h: 1}
```

## How it is decided

A point of the domain outside the function's is looked for, symbolically or by search.

## How to fix it

End the domain before, with a guard or a wall (`domain`).
"""

from __future__ import annotations

from collections.abc import Iterator

from hsdsl.lint.analysis.places import evaluated
from hsdsl.lint.analysis.repeats import Repeats
from hsdsl.lint.analysis.singularities import without_value
from hsdsl.lint.analysis.wording import at
from hsdsl.lint.finding import Finding
from hsdsl.lint.subject import Subject


def check(subject: Subject) -> Iterator[Finding]:
    """Find arguments without a real value."""
    dynamics = subject.dynamics
    found = Repeats("expression", "with this argument")
    for part in subject.modes:
        for expression in evaluated(subject, part, ("flow", "when", "domain", "reset")):
            for argument in without_value(expression.expr):
                if found.again((argument.expr, argument.said)):
                    continue
                outside = [(*where, *more) for where in expression.where for more in argument.alternatives]
                answer = dynamics.ask_any(part.mode, outside)
                if answer.somewhere:
                    where = at(dynamics, part.mode, answer, [argument.expr])
                    message = (
                        f"{argument.said} here has no real value {where}, in the domain of the mode '{part.mode.name}'"
                    )
                    hint = "end the domain before, with a guard or a wall"
                    finding = Finding(expression.written.span(), message, hint, answer.decided or "sampled")
                    found.add((argument.expr, argument.said), finding)
    yield from found
