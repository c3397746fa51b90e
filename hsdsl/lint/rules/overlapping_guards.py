"""Guards that can be reached together.

## What it does

Finds pairs of transitions of one mode whose guards overlap where the flow goes out through both. A note where the
transitions commute: where it is proved that either order leads to one mode with the same states. Else a warning: the
order matters, or may matter.

## Why it is bad

Of transitions that are reached together, one goes first: that of the higher `priority`, then the first in the file
([M6](../../meaning.md#m6-together)). Where the order matters, runs that pass on both sides of the overlap differ for
good, and round-off decides. Where the transitions commute, either order is right.

## Example

```yaml
modes:
  table:
    flow: {x: 1, y: 1}
    transitions:
      - {when: x >= 1, to: right}
      - {when: y >= 1, to: top}
  right:
    flow: {x: 1, y: 0}
  top:
    flow: {x: 0, y: 1}
initial: {mode: table, x: 0, y: 0}
```

## Use instead

```yaml
modes:
  table:
    flow: {x: 1, y: 0}
    transitions:
      - {when: x >= 1, if: y < 1, to: right}
      - {when: x >= 1, if: y >= 1, to: top}
  right:
    flow: {x: 1, y: 0}
  top:
    flow: {x: 0, y: 1}
initial: {mode: table, x: 0, y: 0}
```

## How it is decided

A point on both guards is looked for, symbolically or by search. From there both orders are followed with numbers,
through the transitions that a run makes at that instant: where they end in different states, the order matters.

That transitions commute is proved for all points of the overlap from which the flow goes out of both surfaces at a
speed (L_f r > 0): both orders are followed through the transitions
that are sure to be next at that instant, at most three, and the states they lead to are compared symbolically. Where a
part of that is proved by interval arithmetic, the message states the bounds.

## How to fix it

Separate the guards with an `if` each, add the transitions that let both orders meet again, or say with `priority`
which goes first and ignore the finding.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations

from hsdsl.lint.analysis.commutation import commute, matters, meeting, speeds, together
from hsdsl.lint.analysis.mode_point import ModePoint
from hsdsl.lint.analysis.repeats import Repeats
from hsdsl.lint.analysis.wording import at, within
from hsdsl.lint.finding import Finding
from hsdsl.lint.subject import EdgePart, ModePart, Subject

MOST_PAIRS = 100  # that are followed: each takes a hundred times as long as to see whether two guards overlap


def check(subject: Subject) -> Iterator[Finding]:
    """Find guards that overlap."""
    found = Repeats("pair")
    left = MOST_PAIRS
    for part in subject.modes:
        for first, second in combinations(part.edges, 2):
            overlaps = together(subject.dynamics, first.edge, second.edge)
            if not any(subject.dynamics.ask(part.mode, overlap).somewhere for overlap in overlaps):
                continue
            if not left:
                message = f"more than {MOST_PAIRS} pairs of guards of this model overlap: from here on none is followed"
                yield from (*found, Finding(second.document.when.place.span, message, severity="note"))
                return
            left -= 1
            _look(subject, part, first, second, found)
    yield from found


def _look(subject: Subject, part: ModePart, first: EdgePart, second: EdgePart, found: Repeats) -> None:
    dynamics, mode = subject.dynamics, part.mode
    overlaps, out = together(dynamics, first.edge, second.edge), speeds(dynamics, first.edge, second.edge)
    answers = (meeting(dynamics, first.edge, second.edge, overlap) for overlap in overlaps)
    answer = next((answer for answer in answers if answer.somewhere), None)
    if answer is None:
        return
    different = matters(ModePoint(dynamics, mode, answer.point), first.edge, second.edge)
    proof = None if different else commute(dynamics, first.edge, second.edge, [(*o, *out) for o in overlaps])
    decided = answer.decided or "sampled"
    if proof is not None:
        where = f"{' where L_f r > 0 on both' if out else ''}{within(proof.searched)}"
        then = f"they commute{where}: either order leads to the same state"
        decided = "interval" if proof.decided == "interval" and decided == "symbolic" else decided
    else:
        then = _unproved(different)
    residuals = [dynamics.residual(edge.edge.surface) for edge in (first, second)]
    where = at(dynamics, mode, answer, residuals)
    message = f"the guards of '{first.edge.name}' and '{second.edge.name}' overlap, {where}; {then}"
    hint = None if proof else "separate them with `if`, or say with `priority` which goes first"
    severity = "note" if proof else "warning"
    kind = (then, *(dynamics.rate(mode, residual) for residual in residuals))
    found.add(kind, Finding(second.document.when.place.span, message, hint, decided, severity=severity))


def _unproved(matters: bool | None) -> str:
    if matters is None:
        return "whether it matters which goes first is not known"
    return (
        "it matters which goes first"
        if matters
        else "either order leads to the same state there, elsewhere perhaps not"
    )
