"""A guard that no flow crosses.

## What it does

Finds transitions that cannot fire by the flow: their surface does not meet the domain where `if` holds, or the flow
points back into the domain (or along the surface) wherever it does. Surfaces that a state can be beyond when it enters
the mode are left out, as their transitions fire then.

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

Symbolically where the surface and the domain are linear; else by interval arithmetic over the domain, and the message
says how far was looked in names that nothing bounds. Where neither proves it, nothing is said.

## How to fix it

Turn the inequality round, correct its level, or remove the transition.
"""

from __future__ import annotations

from collections.abc import Iterator

from hsdsl.lint.analysis.landing import entered_beyond
from hsdsl.lint.analysis.question import Answer, positive, zero
from hsdsl.lint.analysis.words import searched
from hsdsl.lint.finding import Finding
from hsdsl.lint.subject import EdgePart, ModePart, Subject


def check(subject: Subject) -> Iterator[Finding]:
    """Find guards that no flow crosses."""
    for part in subject.modes:
        for edge in part.edges:
            found = _never(subject, part, edge)
            if found is None or entered_beyond(subject.dynamics, edge.edge):
                continue
            answer, why = found
            message = f"the flow never crosses the guard of '{edge.edge.name}': {why}{searched(answer)}"
            hint = "turn the inequality round, correct its level, or remove the transition"
            yield Finding(edge.document.when.place.span, message, hint, answer.decided or "symbolic")


def _never(subject: Subject, part: ModePart, edge: EdgePart) -> tuple[Answer, str] | None:
    dynamics, mode = subject.dynamics, part.mode
    surface = dynamics.guard(edge.edge, pointing_out=False)
    residual = dynamics.residual(edge.edge.surface)
    rate = dynamics.rate(mode, residual)
    if rate is None or surface is None:
        return None
    outward = dynamics.ask_any(mode, surface, positive(rate), prove=True)
    if not outward.never:
        return None
    touching = dynamics.ask_any(mode, surface, prove=True)
    if touching.never:
        where = "where `if` holds" if edge.edge.condition is not None else "of the mode"
        return touching, f"its surface does not meet the domain {where}"
    bend = dynamics.rate(mode, rate)
    if bend is None:
        return None
    tangent = dynamics.ask_any(mode, surface, zero(rate), positive(bend), prove=True)
    if not tangent.never:
        return None
    weakest = tangent if tangent.decided == "interval" else outward
    return weakest, "wherever its surface meets the domain, the flow points back inside or along it"
