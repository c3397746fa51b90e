"""A relaxation that is large beside the step or the time between transitions.

## What it does

Finds a `relaxation` of a relaxed run of at least the `step`, of at least a tenth of the run, or of at least the
shortest time between two transitions that the `reference` knows.

## Why it is bad

Every transition of a relaxed run takes a time of the order of the relaxation. The next transition must come after
that, and the error of the run is of that order for each transition.

## Example

```yaml
modes:
  m:
    flow: {x: 1}
    transitions: [{when: x >= 1, to: m, reset: {x: 0}}]
experiment: {until: 5, scheme: relaxed, method: midpoint, step: 1e-3, relaxation: 0.01}
```

## Use instead

```yaml
modes:
  m:
    flow: {x: 1}
    transitions: [{when: x >= 1, to: m, reset: {x: 0}}]
experiment: {until: 5, scheme: relaxed, method: midpoint, step: 1e-3, relaxation: 1e-5}
```

## How it is decided

By the values of the settings with the parameters of the file, and by the times in `reference`.

## How to fix it

Choose a smaller relaxation. The error of a fixed-step method of order p is of the order of step**p: a relaxation of
that order wastes nothing.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

from hsdsl.expression import numeric
from hsdsl.lint.finding import Finding
from hsdsl.lint.numbers import Number
from hsdsl.lint.subject import Subject
from hsdsl.source import Scalar

_HINT = "choose a smaller relaxation"
_TIE = 1e-9


def check(subject: Subject) -> Iterator[Finding]:
    """Find relaxations that are too large."""
    experiment = subject.document.experiment
    if not subject.relaxed or not any(mode.edges for mode in subject.system.modes):
        return
    place, relaxation = (experiment.relaxation or experiment.until).place, subject.relaxation
    step, until, dwell = subject.setting("step"), subject.setting("until"), _shortest_dwell(subject)
    if step is not None and relaxation >= step:
        yield Finding(place.span, "the relaxation is not smaller than the step", _HINT)
    if numeric.finite(until) and until > 0 and relaxation * 10 >= until:
        yield Finding(place.span, "the relaxation is more than a tenth of the run", _HINT)
    if dwell is not None and relaxation >= dwell:
        message = (
            f"the relaxation is not smaller than {float(dwell):.3g}, a time between two transitions of the reference"
        )
        yield Finding(place.span, message, _HINT)


def _shortest_dwell(subject: Subject) -> Number | None:
    """The shortest time between two transitions of a reference that are not simultaneous."""
    gaps: list[Number] = []
    until = subject.setting("until") or 0
    for reference in subject.document.reference:
        events = [event if isinstance(event, Scalar) else event.time for event in reference.transitions]
        times = [time for time in map(subject.read, events) if numeric.finite(time)]
        gaps += [after - before for before, after in pairwise(times) if after - before > _TIE * max(until, abs(after))]
    return min(gaps, default=None)
