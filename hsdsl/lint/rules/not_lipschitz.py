"""A flow that is not Lipschitz.

## What it does

Finds flows with a root, a fractional power, `asin`, `acos` or `acosh` whose slope is infinite at a point of the
domain.

## Why it is bad

Through such a point more than one solution can go: a tank with `h' = -sqrt(h)` may have run empty at any time before.
The theory asks for Lipschitz flows, and error bounds do not hold near the point.

## Example

```yaml
modes:
  drain:
    flow: {h: -sqrt(h)}
    domain: [h >= 0]
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

A point of the domain where the slope is infinite, and where the argument does change with a state, is looked for:
symbolically, or by search. So the length of a vector, `sqrt(x**2 + y**2)`, is not reported.

## How to fix it

End the domain before, with a guard or a wall (`domain`), or smooth the expression.
"""

from __future__ import annotations

from collections.abc import Iterator

from hsdsl.expression.scope import symbol
from hsdsl.lint.analysis.places import evaluated
from hsdsl.lint.analysis.question import positive
from hsdsl.lint.analysis.repeats import Repeats
from hsdsl.lint.analysis.singularities import steep
from hsdsl.lint.analysis.wording import at
from hsdsl.lint.finding import Finding
from hsdsl.lint.subject import Subject


def check(subject: Subject) -> Iterator[Finding]:
    """Find infinite slopes."""
    dynamics = subject.dynamics
    found = Repeats("expression", "with this argument")
    for part in subject.modes:
        states = list(map(symbol, part.mode.states))
        for expression in evaluated(subject, part, ("flow",)):
            for argument in steep(expression.expr):
                if found.again(argument.expr):
                    continue
                changes = positive(sum(argument.expr.diff(s) ** 2 for s in states))
                places = [(*where, *more, changes) for where in expression.where for more in argument.alternatives]
                answer = dynamics.ask_any(part.mode, places)
                if answer.somewhere:
                    where = at(dynamics, part.mode, answer, [argument.expr])
                    message = (
                        f"the flow of '{expression.written.name}' is not Lipschitz {where}: "
                        f"{argument.said} has an infinite slope"
                    )
                    hint = "end the domain before, with a guard or a wall"
                    finding = Finding(expression.written.span(), message, hint, answer.decided or "sampled")
                    found.add(argument.expr, finding)
    yield from found
