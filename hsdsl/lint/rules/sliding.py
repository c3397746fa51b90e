"""Two flows that push against one surface from both sides.

## What it does

Finds pairs of transitions, from A to B and back, on one surface, where the flow of A pushes through it and the flow
of B pushes back: sliding.

## Why it is bad

The run switches back and forth without end, at one place. The relaxed scheme makes a transition each `relaxation`,
and follows the sliding motion only on average; the theory says nothing about such runs. What is meant is mostly a
third mode that moves along the surface, or a switch with hysteresis.

## Example

```yaml
modes:
  left:
    flow: {x: 1}
    transitions: [{when: x >= 0, to: right}]
  right:
    flow: {x: -1}
    transitions: [{when: x <= 0, to: left}]
initial: {mode: left, x: -1}
```

## Use instead

```yaml
parameters: {width: 0.1}
modes:
  left:
    flow: {x: 1}
    transitions: [{when: x >= width, to: right}]
  right:
    flow: {x: -1}
    transitions: [{when: x <= -width, to: left}]
initial: {mode: left, x: -1}
```

## How it is decided

A point where both flows push against the surface is looked for symbolically, or by search, among pairs whose second
surface is met on landing and whose second reset leads back. Both transitions are then followed with numbers from that
point: the second must be the one that a run makes next, and lead back to it.

## How to fix it

Give the two surfaces a distance (hysteresis), or add a mode whose flow is the sliding motion.
"""

from __future__ import annotations

from collections.abc import Iterator

from hsdsl.lint.analysis.landing import landings
from hsdsl.lint.analysis.mode_point import ModePoint, Unsure
from hsdsl.lint.analysis.question import positive
from hsdsl.lint.analysis.repeats import Repeats
from hsdsl.lint.analysis.wording import at
from hsdsl.lint.analysis.zero_time_cycle import same
from hsdsl.lint.finding import Finding
from hsdsl.lint.subject import Subject
from hsdsl.system import Edge


def check(subject: Subject) -> Iterator[Finding]:
    """Find pairs of surfaces that attract."""
    dynamics = subject.dynamics
    found = Repeats("pair", "with these rates")
    told: set[tuple[str, str, str, str]] = set()
    for part in subject.modes:
        for edge in part.edges:
            residual = dynamics.residual(edge.edge.surface)
            rate = dynamics.rate(part.mode, residual)
            for landing in landings(dynamics, edge.edge):
                back = landing.edge
                if rate is None or landing.rate is None or back is None or not landing.returns:
                    continue
                if (back.source, back.name, edge.edge.source, edge.edge.name) in told or found.again(
                    (rate, landing.rate)
                ):
                    continue
                answer = dynamics.ask_any(part.mode, landing.guard, positive(rate), positive(landing.rate))
                if not answer.somewhere or not _returns(ModePoint(dynamics, part.mode, answer.point), edge.edge, back):
                    continue
                told.add((edge.edge.source, edge.edge.name, back.source, back.name))
                where = at(dynamics, part.mode, answer, [residual, rate, landing.rate])
                names = f"'{edge.edge.name}' and '{back.name}'"
                message = f"{names} push against one surface from both sides (sliding): {where}"
                hint = "give the two surfaces a distance, or add a mode that moves along the surface"
                decided = "sampled" if answer.decided == "sampled" else "symbolic"
                finding = Finding(edge.document.when.place.span, message, hint, decided)
                found.add((rate, landing.rate), finding)
    yield from found


def _returns(here: ModePoint, edge: Edge, back: Edge) -> bool:
    """Whether the second transition is the one that follows the first, and leads back to where that was made."""
    try:
        reached = here.after(edge)
        return reached.next() is back and same(reached.after(back), here)
    except Unsure:
        return False
