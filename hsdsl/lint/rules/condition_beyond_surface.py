"""A condition that can become true beyond its surface.

## What it does

Finds transitions with an `if` where a state can pass the surface without firing, because `if` does not hold there, and
where `if` can then become true while the state is still beyond the surface.

## Why it is bad

Nothing fires there: a transition fires where the flow *crosses* its surface and `if` holds at the crossing
([M3](../../meaning.md#m3-crossing)). Who reads `when: x >= 1` with `if: v >= 2` as "as soon as both are true" has
written a model that misses events.

## Example

```yaml
modes:
  run:
    flow: {x: v, v: 1}
    transitions:
      - {when: x >= 1, if: v >= 2, to: run, reset: {x: 0}}
```

## Use instead

The surface of both: it is crossed when the later of the two becomes true.

```yaml
modes:
  run:
    flow: {x: v, v: 1}
    transitions:
      - {when: "min(x - 1, v - 2) >= 0", to: run, reset: {x: 0}}
```

## How it is decided

Two points are looked for, symbolically or by search: one on the surface where the flow passes and no `if` of that
surface holds, and one beyond it, inside all other guards and walls, where a comparison of the `if` turns true along
the flow. The message has the second one. Whether a run gets from the one to the other is not looked at.

## How to fix it

Put both into one surface with `min`, or keep the state from passing with a second transition or a wall.
"""

from __future__ import annotations

from collections.abc import Iterator

from hsdsl.lint.analysis.passing import passes_by
from hsdsl.lint.analysis.proof import strict
from hsdsl.lint.analysis.question import Answer, Constraint, negative, positive, zero
from hsdsl.lint.analysis.wording import at
from hsdsl.lint.finding import Finding
from hsdsl.lint.subject import EdgePart, ModePart, Subject


def check(subject: Subject) -> Iterator[Finding]:
    """Find conditions that can become true where nothing fires."""
    for part in subject.modes:
        for edge in part.edges:
            if edge.edge.condition is None or edge.document.condition is None:
                continue
            answer = _turns_true(subject, part, edge)
            if answer is None or not passes_by(subject.dynamics, edge.edge).somewhere:
                continue
            about = [subject.dynamics.residual(edge.edge.surface), subject.dynamics.placed(edge.edge.condition)]
            where = at(subject.dynamics, part.mode, answer, about)
            name = edge.edge.name
            message = f"the `if` of '{name}' can become true beyond its surface, {where}, and nothing fires there"
            hint = "to fire when both hold, put both into `when` with min(..., ...) >= 0"
            decided = answer.decided or "sampled"
            yield Finding(edge.document.condition.place.span, message, hint, decided)


def _turns_true(subject: Subject, part: ModePart, edge: EdgePart) -> Answer | None:
    dynamics, mode = subject.dynamics, part.mode
    beyond = (positive(dynamics.residual(edge.edge.surface)), *strict(dynamics.domain(mode, without=edge.edge)))
    for clause in dynamics.condition(edge.edge) or ():
        for comparison in clause:
            rate = dynamics.rate(mode, comparison.expr)
            if comparison.relation == "= 0" or rate is None:
                continue
            others: list[Constraint] = [c for c in clause if c is not comparison]
            answer = dynamics.ask(mode, (*beyond, zero(comparison.expr), negative(rate), *others))
            if answer.somewhere:
                return answer
    return None
