"""A reset that lands beyond a guard or a wall of the next mode.

## What it does

Finds transitions whose reset can land beyond a surface of the mode it leads to: outside that mode's domain. A warning
where it always does, a note where it can.

## Why it is bad

Beyond a guard, the next transition fires at once ([M5](../../meaning.md#m5-on-entry)); beyond a wall, the run stops.
The theory has no such case: its resets land inside the next domain.

## Example

```yaml
modes:
  up:
    flow: {x: 1}
    transitions: [{when: x >= 2, to: down, reset: {x: 0}}]
  down:
    flow: {x: -1}
    transitions: [{when: x <= 1, to: up}]
```

## Use instead

```yaml
modes:
  up:
    flow: {x: 1}
    transitions: [{when: x >= 2, to: down}]
  down:
    flow: {x: -1}
    transitions: [{when: x <= 1, to: up}]
```

## How it is decided

The surfaces of the next mode are put behind the reset, and a point of the guard is looked for where one of them is
positive: symbolically, or by search. What a run does there is followed with numbers. That it is positive everywhere
is proved symbolically, or by intervals within bounds that the message states.

## How to fix it

Correct the reset, let the transition lead to the mode that follows, or bound the states of the mode it leaves with
`domain` where the point is one that no run comes to.
"""

from __future__ import annotations

from collections.abc import Iterator

from hsdsl.lint.analysis.landing import surfaces_of
from hsdsl.lint.analysis.mode_point import ModePoint, Unsure
from hsdsl.lint.analysis.passing import fires
from hsdsl.lint.analysis.proof import Proof
from hsdsl.lint.analysis.question import at_most_zero, positive
from hsdsl.lint.analysis.repeats import Repeats
from hsdsl.lint.analysis.wording import at, within
from hsdsl.lint.finding import Finding
from hsdsl.lint.subject import EdgePart, ModePart, Subject


def check(subject: Subject) -> Iterator[Finding]:
    """Find resets that land outside the next domain."""
    found = Repeats("reset")
    for part in subject.modes:
        for edge in part.edges:
            _look(subject, part, edge, found)
    yield from found


def _look(subject: Subject, part: ModePart, edge: EdgePart, found: Repeats) -> None:
    dynamics, target = subject.dynamics, subject.dynamics.modes[edge.edge.target]
    for surface, after in surfaces_of(target):
        carried = dynamics.carried(dynamics.residual(surface), edge.edge)
        answer = fires(dynamics, edge.edge, positive(carried))
        if not answer.somewhere:
            continue
        proof, guard = Proof(dynamics, part.mode), dynamics.guard(edge.edge)
        always = guard is not None and proof.never(guard, at_most_zero(carried))
        residual = dynamics.residual(edge.edge.surface)
        others = (dynamics.carried(dynamics.residual(other), edge.edge) for other, _ in surfaces_of(target))
        about = [residual, carried, *([] if always else [dynamics.rate(part.mode, residual), *others])]
        where = at(dynamics, part.mode, answer, about)
        beyond = f"the guard of '{after.name}'" if after else f"the wall '{surface.text}' of '{target.name}'"
        lands = f"lands{within(proof.searched)}" if always else "can land"
        then = _then(ModePoint(dynamics, part.mode, answer.point), edge)
        message = f"the reset of '{edge.edge.name}' {lands} beyond {beyond}: {where}{then}"
        decided = proof.decided if always else answer.decided or "sampled"
        severity = "warning" if always else "note"
        kind = (carried, edge.edge.surface.residual)
        found.add(kind, Finding(edge.document.to.place.span, message, None, decided, severity=severity))


def _then(here: ModePoint, edge: EdgePart) -> str:
    """Say what a run does there."""
    try:
        following = here.after(edge.edge).next()
    except Unsure:
        return ""
    return f", where '{following.name}' fires at once" if following else ", where the run stops"
