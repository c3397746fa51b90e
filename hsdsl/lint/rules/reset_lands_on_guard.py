"""A reset that lands on a guard or a wall of the next mode.

## What it does

Finds transitions whose reset lands exactly on a surface of the mode it leads to, wherever they fire, with the flow
there pointing out, or along the surface where the transition leads back to itself.

## Why it is bad

Nothing fires on a surface by itself ([M4](../../meaning.md#m4-on-the-surface)), so most such resets are harmless: a
bounce lands on the floor and flies off. But with the flow pointing out the next transition follows at once, and where
the flow does not lead away from its own guard transitions can pile up in finite time (Zeno).

## Example

A ball: at rest on the floor nothing leads away from it.

```yaml
modes:
  fly:
    flow: {h: v, v: -9.81}
    transitions:
      - {when: h <= 0, to: fly, reset: {v: -0.8*v}}
initial: {mode: fly, h: 1, v: 0}
```

## Use instead

Let the ball come to rest in a mode of its own.

```yaml
modes:
  fly:
    flow: {h: v, v: -9.81}
    transitions:
      - {when: h <= 0, if: v < -0.01, to: fly, reset: {v: -0.8*v}}
      - {when: h <= 0, if: v >= -0.01, to: rest}
  rest:
    flow: {h: 0, v: 0}
initial: {mode: fly, h: 1, v: 0}
```

## How it is decided

The next mode's surface function and its rate are put behind the reset. That the first vanishes on the whole guard is
decided symbolically, or at sampled points; a point where the second has the wrong sign is looked for symbolically, or
by search, and the first derivative that is not 0 there is looked at with numbers, up to order 6.

## How to fix it

Nothing has to be done where runs keep away from the point. Else give the states near it a mode of their own.
"""

from __future__ import annotations

from collections.abc import Iterator

from hsdsl.lint.analysis.landing import Landing, landings
from hsdsl.lint.analysis.mode_point import ModePoint, Unsure
from hsdsl.lint.analysis.question import at_most_zero, positive, zero
from hsdsl.lint.analysis.repeats import Repeats
from hsdsl.lint.analysis.wording import at
from hsdsl.lint.finding import Finding
from hsdsl.lint.subject import EdgePart, ModePart, Subject


def check(subject: Subject) -> Iterator[Finding]:
    """Find resets that land on surfaces and do not lead away from them."""
    found = Repeats("reset", "with these rates")
    for part in subject.modes:
        for edge in part.edges:
            for landing in landings(subject.dynamics, edge.edge):
                _look(subject, part, edge, landing, found)
    yield from found


def _look(subject: Subject, part: ModePart, edge: EdgePart, landing: Landing, found: Repeats) -> None:
    dynamics = subject.dynamics
    if landing.rate is None or landing.returns:
        return
    kind = (landing.rate, landing.edge is None, dynamics.rate(part.mode, dynamics.residual(edge.edge.surface)))
    if found.again(kind):
        return
    name = edge.edge.name
    own = landing.edge is not None and landing.edge.name == name and landing.edge.source == edge.edge.source
    answer, order = dynamics.ask_any(part.mode, landing.guard, positive(landing.rate)), 1
    then = "the flow can cross it at once" if landing.edge else "the flow can leave the domain there"
    if not answer.somewhere and own and landing.bend is not None:
        answer = dynamics.ask_any(part.mode, landing.guard, zero(landing.rate), at_most_zero(-landing.bend))
        then, order = "the flow does not lead away from it (Zeno is possible)", 2
    if not answer.somewhere or not _stays(ModePoint(dynamics, part.mode, answer.point), edge, landing, order):
        return
    on = f"the guard of '{landing.edge.name}'" if landing.edge else f"the wall '{landing.surface.text}'"
    on = "its own guard" if own else on
    on = on if landing.decided == "symbolic" else f"{on} at every point that was tried"
    about = [dynamics.residual(edge.edge.surface), landing.rate, landing.bend if own else None]
    message = f"the reset of '{name}' lands on {on}, and {at(dynamics, part.mode, answer, about)} {then}"
    decided = "sampled" if "sampled" in (landing.decided, answer.decided) else "symbolic"
    found.add(kind, Finding(edge.document.to.place.span, message, None, decided))


def _stays(here: ModePoint, edge: EdgePart, landing: Landing, order: int) -> bool:
    """Whether the flow goes out of the surface after landing, or from the second order on does not go in."""
    try:
        reached = here.after(edge.edge)
        residual = reached.dynamics.residual(landing.surface)
        first, sign = reached.first(residual)
        return reached.sign(residual) == 0 and (sign > 0 if first < order or order == 1 else sign >= 0)
    except Unsure:
        return False
