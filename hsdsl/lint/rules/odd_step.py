"""A step or a tolerance that the run cannot use.

## What it does

Finds a `step` that is longer than a tenth of the run, a `tolerance` above 0.01 or below 1e-15, and an `until` of 0.

## Why it is bad

A handful of steps shows nothing of a flow, nor does a tolerance of several percent. Below 1e-15 the round-off of
float64 is larger than what is asked for; below 2.2e-16 a run is refused.

## Example

```yaml
modes:
  m:
    flow: {x: -x}
experiment: {until: 1, method: rk4, step: 0.5}
```

## Use instead

```yaml
modes:
  m:
    flow: {x: -x}
experiment: {until: 1, method: rk4, step: 0.01}
```

## How it is decided

By the values of the settings, with the parameters of the file.

## How to fix it

Choose a shorter step, or a tolerance between the two. More digits than float64 has take `--precision`.
"""

from __future__ import annotations

from collections.abc import Iterator

from hsdsl.lint.finding import Finding
from hsdsl.lint.subject import Subject

_LOOSE, _TIGHT = 0.01, 1e-15


def check(subject: Subject) -> Iterator[Finding]:
    """Find steps and tolerances that cannot serve."""
    document = subject.document.experiment
    until, step, tolerance = (subject.setting(key) for key in ("until", "step", "tolerance"))
    if until == 0:
        yield Finding(document.until.place.span, "the run ends where it starts", "end later than 0")
    elif document.step is not None and step is not None and 10 * step > until:
        yield Finding(document.step.place.span, "the run is shorter than ten steps", "take a shorter step")
    if document.tolerance is not None and tolerance is not None:
        if tolerance > _LOOSE:
            message = "a tolerance above 0.01 leaves errors of several percent in every step"
            yield Finding(document.tolerance.place.span, message, "take a smaller one, such as 1e-6")
        elif tolerance < _TIGHT:
            message = "a tolerance below 1e-15 is below the round-off of float64"
            yield Finding(document.tolerance.place.span, message, "take a larger one, or --precision")
