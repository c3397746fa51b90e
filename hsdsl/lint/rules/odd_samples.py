"""Sample times that make no sense.

## What it does

Finds lists of `samples` that do not increase, or leave the time of the run, and numbers of samples above a million.

## Why it is bad

A run has no values outside its time, and a table whose times go back and forth is read wrongly by most programs.

## Example

```yaml
modes:
  m:
    flow: {x: 1}
experiment: {until: 1, samples: [0, 1, 1/2, 2]}
```

## Use instead

```yaml
modes:
  m:
    flow: {x: 1}
experiment: {until: 1, samples: [0, 1/2, 1]}
```

## How it is decided

By the values of the settings, with the parameters of the file.

## How to fix it

Put the times in order, between 0 and `until`.
"""

from __future__ import annotations

from collections.abc import Iterator

from hsdsl.lint.finding import Finding
from hsdsl.lint.subject import Subject

_MANY = 10**6


def check(subject: Subject) -> Iterator[Finding]:
    """Find samples that make no sense."""
    samples, until = subject.document.experiment.samples, subject.setting("until")
    if samples is None:
        return
    if not isinstance(samples, list):
        if subject.read(samples) > _MANY:
            yield Finding(samples.place.span, "this is more than a million samples", "take fewer")
        return
    last = None
    for scalar in samples:
        time = subject.read(scalar)
        if time < 0 or time > until:
            yield Finding(scalar.place.span, "this time is outside the run", "sample between 0 and `until`")
        elif last is not None and time <= last:
            yield Finding(scalar.place.span, "this time does not come after the one before", "put the times in order")
        last = time
