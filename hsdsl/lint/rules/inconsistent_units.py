"""A sum or a comparison of different units.

## What it does

Finds sums, comparisons, `min`, `max` and `atan2` whose parts are measured in different units, with the first part
that differs.

## Why it is bad

Metres and seconds cannot be added, and metres and millimetres are not converted: the sum would be of numbers that mean
different things.

## Example

```yaml
units: {x: m, v: m/s}
modes:
  free:
    flow: {x: v, v: -9.81}
    transitions: [{when: x + v >= 5, to: free, reset: {v: 0}}]
```

## Use instead

```yaml
units: {x: m, v: m/s, delay: s}
parameters: {delay: 0.5}
modes:
  free:
    flow: {x: v, v: -9.81}
    transitions: [{when: x + delay*v >= 5, to: free, reset: {v: 0}}]
```

## How it is decided

Symbolically, from the units of the names. A number by itself takes the unit that is wanted; what has no unit given is
unknown, and so is what it enters.

## How to fix it

Correct the expression, or the unit of one of its names. Convert with a factor that has a name and a unit, such as
`mm_per_m`.
"""

from __future__ import annotations

from collections.abc import Iterator

from hsdsl.lint.finding import Finding
from hsdsl.lint.subject import Subject


def check(subject: Subject) -> Iterator[Finding]:
    """Find sums of different units."""
    for checked in subject.units.checked:
        for misfit in checked.misfits:
            if misfit.kind == "sum":
                yield Finding(checked.written.span(misfit.node), misfit.message)
