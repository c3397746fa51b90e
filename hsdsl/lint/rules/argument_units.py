"""A function of something with a unit.

## What it does

Finds arguments of `sin`, `exp`, `log` and the like, and exponents, that are no plain numbers. Radians are plain
numbers, degrees are not.

## Why it is bad

The value depends on what the argument is measured in: the sine of five seconds means nothing.

## Example

```yaml
inputs: {u: sin(2*t)}
modes:
  m: {flow: {x: v, v: u - x}}
units: {x: m, v: m/s}
```

## Use instead

```yaml
parameters: {omega: 2}
inputs: {u: sin(omega*t)}
modes:
  m: {flow: {x: v, v: u - x}}
units: {x: m, v: m/s, omega: rad/s}
```

## How it is decided

Symbolically, from the units of the names.

## How to fix it

Divide by a parameter that has the same unit, or give the factor a name and its unit.
"""

from __future__ import annotations

from collections.abc import Iterator

from hsdsl.lint.finding import Finding
from hsdsl.lint.subject import Subject


def check(subject: Subject) -> Iterator[Finding]:
    """Find arguments that are no plain numbers."""
    for checked in subject.units.checked:
        for misfit in checked.misfits:
            if misfit.kind == "argument":
                hint = "divide by something in the same unit, or give the factor a name and its unit"
                yield Finding(checked.written.span(misfit.node), misfit.message, hint)
