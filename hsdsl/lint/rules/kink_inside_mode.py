"""A flow with a kink.

## What it does

Finds flows with `abs`, `min` or `max` that have a kink at a point of the domain.

## Why it is bad

The flow is continuous, and all of the theory holds. But methods of high order lose their order where a step crosses
the kink, so runs become slower or less accurate than they could be.

## Example

```yaml
modes:
  ramp:
    flow: {x: v, v: "-min(x, 1)"}
```

## Use instead

```yaml
modes:
  ramp:
    flow: {x: v, v: -x}
    transitions: [{when: x >= 1, to: flat}]
  flat:
    flow: {x: v, v: -1}
    transitions: [{when: x <= 1, to: ramp}]
```

## How it is decided

A point of the domain where the two sides are equal, and where what the function is multiplied with does not vanish,
is looked for: symbolically, or by search. So `v*abs(v)`, which is smooth enough, is not reported.

## How to fix it

Nothing has to be done. Where speed matters, make a mode of each side.
"""

from __future__ import annotations

from collections.abc import Iterator

from hsdsl.lint.analysis.places import evaluated
from hsdsl.lint.analysis.repeats import Repeats
from hsdsl.lint.analysis.singularities import kinks
from hsdsl.lint.analysis.wording import at
from hsdsl.lint.finding import Finding
from hsdsl.lint.subject import Subject


def check(subject: Subject) -> Iterator[Finding]:
    """Find kinks."""
    dynamics = subject.dynamics
    found = Repeats("flow")
    for part in subject.modes:
        for expression in evaluated(subject, part, ("flow",)):
            for kink in kinks(expression.expr):
                inside = [(*where, *more) for where in expression.where for more in kink.alternatives]
                answer = dynamics.ask_any(part.mode, inside)
                if answer.somewhere:
                    where = at(dynamics, part.mode, answer, kink.expr.args)
                    message = f"the flow of '{expression.written.name}' has a kink {where}, where `{kink.said}` has one"
                    finding = Finding(expression.written.span(), message, None, answer.decided or "sampled")
                    found.add((kink.expr, expression.expr), finding)
    yield from found
