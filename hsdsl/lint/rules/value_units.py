"""A value in another unit than that of its name.

## What it does

Finds resets, initial values, parameters, inputs and outputs whose expression is in another unit than the name it
gives a value to.

## Why it is bad

The name would not be measured in what the file says.

## Example

```yaml
modes:
  fly:
    flow: {h: v, v: -9.81}
    transitions: [{when: h <= 0, to: fly, reset: {v: -h}}]
units: {h: m, v: m/s}
```

## Use instead

```yaml
modes:
  fly:
    flow: {h: v, v: -9.81}
    transitions: [{when: h <= 0, to: fly, reset: {v: -v}}]
units: {h: m, v: m/s}
```

## How it is decided

Symbolically, from the units of the names. A number takes the unit that is wanted.

## How to fix it

Correct the expression, or the unit of a name.
"""

from __future__ import annotations

from collections.abc import Iterator

from hsdsl.lint.finding import Finding
from hsdsl.lint.subject import Subject
from hsdsl.lint.units.unit import Unit

_WHAT = {
    "reset": "the new value of",
    "initial": "the initial value of",
    "scale": "the scale of",
    "parameter": "the parameter",
    "input": "the input",
    "output": "the output",
}


def check(subject: Subject) -> Iterator[Finding]:
    """Find values with a wrong unit."""
    for checked in subject.units.checked:
        wanted = subject.units.of(str(checked.written.name))
        what = _WHAT.get(checked.written.role)
        if what is None or wanted is None or not isinstance(checked.measure, Unit):
            continue
        if not wanted.same(checked.measure):
            message = (
                f"{what} '{checked.written.name}' is in {checked.measure.beside(wanted)}, and should be in {wanted}"
            )
            yield Finding(checked.written.span(), message)
