"""A reference to a time that the run does not reach.

## What it does

Finds transitions and states in `reference` before 0 or after the end of the run they are about.

## Why it is bad

They can never be compared with anything: the check that they promise does not take place.

## Example

```yaml
modes:
  m:
    flow: {x: 1}
experiment: {until: 1}
reference:
  states: [{time: 2, x: 2}]
```

## Use instead

```yaml
modes:
  m:
    flow: {x: 1}
experiment: {until: 2}
reference:
  states: [{time: 2, x: 2}]
```

## How it is decided

By the times and by `until`, with the parameters and settings of the reference. A run that ends early in a final mode
is not followed.

## How to fix it

Let the experiment, or `set: {experiment.until: ..}` of the reference, reach so far.
"""

from __future__ import annotations

from collections.abc import Iterator

from hsdsl.lint.finding import Finding
from hsdsl.lint.subject import Subject
from hsdsl.source import Scalar

_TIE = 1e-9


def check(subject: Subject) -> Iterator[Finding]:
    """Find references to times outside the run."""
    for reference in subject.document.reference:
        settings = reference.settings
        if any(key in subject.document.parameters for key in settings):
            continue  # its parameters are others
        given = next((scalar for key, scalar in settings.items() if key == "experiment.until"), None)
        until = subject.setting("until") if given is None else subject.read(given)
        events = [event if isinstance(event, Scalar) else event.time for event in reference.transitions]
        for scalar in (*events, *(state.time for state in reference.states)):
            time = subject.read(scalar)
            if time < 0 or time > until + _TIE * abs(until):
                yield Finding(scalar.place.span, "the run this is about does not reach this time", "let it run longer")
