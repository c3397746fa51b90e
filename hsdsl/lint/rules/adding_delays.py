"""A relaxation whose delays add up.

## What it does

Finds a `relaxation` of a relaxed run that is above a thousandth of the likely time between two transitions, and one
that, times the likely number of transitions, is above a hundredth of that time.

## Why it is bad

Every transition of a relaxed run is late by about the relaxation, divided by the speed with which its guard is
crossed, and the delays add up. Where modes last microseconds in a run of seconds, the default of 1e-6 is not small: it
is compared with times in the model's own unit of time.

## Example

```yaml
parameters: {period: 2e-5}
modes:
  on:
    flow: {i: 100, c: 1}
    transitions: [{when: c >= period/2, to: off}]
  off:
    flow: {i: -100, c: 1}
    transitions: [{when: c >= period, to: on, reset: {c: 0}}]
experiment: {until: 1e-3, scheme: relaxed, relaxation: 1e-6}
```

## Use instead

```yaml
parameters: {period: 2e-5}
modes:
  on:
    flow: {i: 100, c: 1}
    transitions: [{when: c >= period/2, to: off}]
  off:
    flow: {i: -100, c: 1}
    transitions: [{when: c >= period, to: on, reset: {c: 0}}]
experiment: {until: 1e-3, scheme: relaxed, relaxation: 1e-11}
```

## How it is decided

By the times of the `reference`, where there is one. Else by an estimate where the resets of the first 50 transitions
land: the distance to the next surface divided by the speed towards it, with initial values for what the guard leaves
open.

## How to fix it

Choose a relaxation that is small beside the shortest time between transitions divided by their number, or
`scheme: located`, where transitions cost no time.
"""

from __future__ import annotations

from collections.abc import Iterator

from hsdsl.lint.dwell import pace
from hsdsl.lint.finding import Finding
from hsdsl.lint.subject import Subject

_ONE, _ALL = 1000, 100  # how much smaller the delay of one transition, and of all, should be than the time between two


def check(subject: Subject) -> Iterator[Finding]:
    """Find relaxations that are large beside the times of the scene."""
    experiment = subject.document.experiment
    if not subject.relaxed:
        return
    relaxation = subject.relaxation
    found = pace(subject)
    if found is None or (relaxation >= found.shortest and found.known):  # that is large-relaxation's
        return
    late = relaxation * max(found.count, 1)
    if relaxation * _ONE < found.shortest and late * _ALL < found.shortest:
        return
    message = (
        f"about {_plain(found.count)} transitions, each late by about {_plain(relaxation)}, are late by "
        f"{_plain(late)} in the end; the shortest time between two is about {_plain(found.shortest)}"
    )
    better = float(found.shortest) / max(float(found.count), 10) / _ALL
    hint = f"choose a relaxation of at most {better:.0e}, or `scheme: located`"
    place = (experiment.relaxation or experiment.until).place
    yield Finding(place.span, message, hint, "sampled")


def _plain(value: object) -> str:
    return f"{float(value):.2g}"  # type: ignore[arg-type]
