"""A domain without bounds.

## What it does

Finds states that neither a guard nor a wall bounds in their mode. They are told once for the model, and only
where the rule is selected: nearly every model has some.

## Why it is bad

The theory asks for compact domains: its constants are those of a bounded set. A simulation does not need that. But a
run that diverges goes on to `not_finite`, and checks that look at a whole domain look too far.

## Example

```yaml
modes:
  free:
    flow: {x: v, v: -x}
    domain: [x >= -20, x <= 20]
```

## Use instead

```yaml
modes:
  free:
    flow: {x: v, v: -x}
    domain: [x >= -20, x <= 20, v >= -60, v <= 60]
```

## How it is decided

From bounds that surfaces without `if` give for single states, symbolically; for other surfaces it is asked whether a
point with a state beyond a million times its usual size can satisfy them all.

## How to fix it

Write what the model is valid for as walls (`domain`), or ignore the finding with the reason why runs stay bounded.
"""

from __future__ import annotations

from collections.abc import Iterator

from hsdsl.expression.scope import symbol
from hsdsl.lint.analysis.question import positive
from hsdsl.lint.finding import Finding
from hsdsl.lint.subject import ModePart, Subject

_FAR = 1_000_000


def check(subject: Subject) -> Iterator[Finding]:
    """Find states without bounds, and tell of all of them at the first."""
    loose = {part.mode.name: _loose(subject, part) for part in subject.modes}
    modes = [part for part in subject.modes if loose[part.mode.name]]
    if not modes:
        return
    first = modes[0]
    names = ", ".join(f"'{name}'" for name in loose[first.mode.name])
    more = f"; {len(modes) - 1:,} more modes like it" if len(modes) > 2 else "; one more mode like it"
    message = f"nothing bounds {names} in the mode '{first.key}'{more if len(modes) > 1 else ''}"
    yield Finding(first.key.place.span, message, "write what the model is valid for as walls (`domain`)")


def _loose(subject: Subject, part: ModePart) -> list[str]:
    dynamics, mode = subject.dynamics, part.mode
    domain = dynamics.domain(mode)
    bounds = dynamics.bounds(mode)
    shaping = {s for constraint in domain for s in constraint.expr.free_symbols}
    found: list[str] = []
    for name in mode.states:
        state = symbol(name)
        if None not in bounds.get(state, (None, None)):
            continue
        far = _FAR * int(dynamics.ranges(mode)[state].search[1])
        ends = [dynamics.ask(mode, (*domain, positive(s * state - far))) for s in (1, -1) if state in shaping]
        if state not in shaping or any(answer.somewhere for answer in ends):
            found.append(name)
    return found
