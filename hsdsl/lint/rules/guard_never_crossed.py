"""A guard that no flow crosses.

## What it does

Finds transitions that cannot fire by the flow: their surface does not meet the domain where `if` holds, or the flow
points back into the domain or runs along the surface wherever it does. Surfaces that a state can be beyond when it
enters the mode are left out, as their transitions fire then.

## Why it is bad

The transition is as good as not written. Mostly the inequality is the wrong way round, or another guard or wall ends
the domain before.

## Example

```yaml
modes:
  falling:
    flow: {h: v, v: -9.81}
    domain: [h >= 0]
    transitions:
      - {when: h <= -1, to: falling, reset: {v: -v}}
initial: {mode: falling, h: 1, v: 0}
```

## Use instead

```yaml
modes:
  falling:
    flow: {h: v, v: -9.81}
    transitions:
      - {when: h <= 0, to: falling, reset: {v: -v}}
initial: {mode: falling, h: 1, v: 0}
```

## How it is decided

The first derivative of the surface function r along the flow that is not 0 decides whether a state on the surface goes
out. That it is negative everywhere on the surface, or that r falls or stays wherever it is positive, is proved:
symbolically where that is possible, and then it holds everywhere; else by interval arithmetic. The message states the
bounds within which it is proved, and the end of the run where time plays a part. Kinks (`abs`, `min`, `max`, `sign`)
are looked at from each side. Where `floor`, `sign` or a divisor can make r jump, and where nothing is proved, nothing
is said.

It is proved of exact flows, with the parameters of the file. Along a surface that attracts, a computed run may cross
by its error.

## How to fix it

Turn the inequality round, correct its level, or remove the transition.
"""

from __future__ import annotations

from collections.abc import Iterator

from hsdsl.lint.analysis.crossing import uncrossed
from hsdsl.lint.analysis.landing import entered_beyond
from hsdsl.lint.analysis.wording import within
from hsdsl.lint.finding import Finding
from hsdsl.lint.subject import Subject


def check(subject: Subject) -> Iterator[Finding]:
    """Find guards that no flow crosses."""
    for part in subject.modes:
        for edge in part.edges:
            found = uncrossed(subject.dynamics, edge.edge)
            if found is None or entered_beyond(subject.dynamics, edge.edge):
                continue
            where = within(found.searched)
            crosses = (
                f"does not cross the guard of '{edge.edge.name}'{where}"
                if where
                else (f"never crosses the guard of '{edge.edge.name}'")
            )
            hint = "turn the inequality round, correct its level, or remove the transition"
            yield Finding(edge.document.when.place.span, f"the flow {crosses}: {found.why}", hint, found.decided)
