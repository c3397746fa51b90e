"""A flow that is not in the unit of its state per time.

## What it does

Finds flows whose unit is not that of the state divided by that of `t`. The unit of `t` is given like any other
(`units: {t: min}`); left out, it is the second where some unit of the model has time in it, and unknown elsewhere.

## Why it is bad

The state would not be measured in what the file says. Often a factor is missing, or a term has been forgotten.

## Example

```yaml
parameters: {g: 9.81}
modes:
  fall: {flow: {h: v, v: -g*h}}
units: {h: m, v: m/s, g: m/s**2}
```

## Use instead

```yaml
parameters: {g: 9.81}
modes:
  fall: {flow: {h: v, v: -g}}
units: {h: m, v: m/s, g: m/s**2}
```

## How it is decided

Symbolically, from the units of the names. A flow that is a number takes the unit that is wanted.

## How to fix it

Correct the flow, or the unit of a name.
"""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction

from hsdsl.lint.finding import Finding
from hsdsl.lint.subject import Subject
from hsdsl.lint.units.unit import Unit


def check(subject: Subject) -> Iterator[Finding]:
    """Find flows with a wrong unit."""
    units = subject.units
    time = units.of("t")
    for checked in units.checked:
        state = units.of(str(checked.written.name))
        if checked.written.role != "flow" or not isinstance(checked.measure, Unit) or state is None or time is None:
            continue
        wanted = state.times(time.to(Fraction(-1)))
        if not wanted.same(checked.measure):
            found = checked.measure.beside(wanted)
            message = f"the flow of '{checked.written.name}' is in {found}, and should be in {wanted}"
            yield Finding(checked.written.span(), message)
