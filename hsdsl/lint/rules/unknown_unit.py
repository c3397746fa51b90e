"""A unit that nobody knows.

## What it does

Finds units that are not written as products, quotients and powers of names that are known: `m`, `kg*m/s**2`, `1/s`,
`rad/s`.

## Why it is bad

Nothing that depends on it can be checked.

## Example

```yaml
units: {x: metrs}
modes:
  m: {flow: {x: 1}}
```

## Use instead

```yaml
units: {x: metres}
modes:
  m: {flow: {x: 1}}
```

## How it is decided

The names are those of the package `pint`, with their prefixes, plurals and abbreviations.

## How to fix it

Correct the name, or write the unit with `*`, `/` and `**`: `m/s**2`, not `m/s^2`.
"""

from __future__ import annotations

from collections.abc import Iterator

from hsdsl.lint.finding import Finding
from hsdsl.lint.subject import Subject
from hsdsl.lint.units.unit import names_like
from hsdsl.names import closest, shown


def check(subject: Subject) -> Iterator[Finding]:
    """Find units that cannot be read."""
    for misread in subject.units.misread:
        scalar = misread.scalar
        message = f"'{shown(misread.names[0] if misread.names else scalar.value)}' is not a unit"
        best = closest(misread.names[0], names_like(misread.names[0])) if misread.names else misread.better
        hint = (
            f"write '{best}'"
            if misread.better
            else f"did you mean '{best}'?"
            if best
            else "write units as m, kg*m/s**2, 1/s or rad"
        )
        yield Finding(scalar.place.span, message, hint)
