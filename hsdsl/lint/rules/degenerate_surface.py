"""A surface whose gradient vanishes on it.

## What it does

Finds guards and walls r = 0 on which the gradient of r vanishes: a warning where r is nowhere positive, as the negative
of a square, or nowhere negative; a note where it is a point of the surface, as where two lines cross.

## Why it is bad

How deep a state is beyond a surface is measured as r/|grad r|, which says nothing where the gradient vanishes: the
relaxed scheme halves its steps to no end. Where r is nowhere positive, the surface is never crossed at all; where it is
nowhere negative, every state is on it or beyond it, and a transition without `if` fires on entry.

## Example

```yaml
modes:
  run:
    flow: {x: 1}
    transitions: [{when: (x - 1)**2 <= 0, to: run, reset: {x: 0}}]
```

## Use instead

```yaml
modes:
  run:
    flow: {x: 1}
    transitions: [{when: x >= 1, to: run, reset: {x: 0}}]
```

## How it is decided

A point of the surface where all derivatives vanish is looked for, symbolically or by search; points where r has a kink
or jumps are left alone. That r has no positive or no negative value is proved: symbolically, or by interval arithmetic
within bounds that the message states.

## How to fix it

Write the surface with a function that passes through zero: `x >= 1` for `(x - 1)**2 <= 0`.
"""

from __future__ import annotations

from collections.abc import Iterator

from hsdsl.lint.analysis.mode_point import ModePoint, Unsure
from hsdsl.lint.analysis.proof import Proof
from hsdsl.lint.analysis.question import negative, positive, zero
from hsdsl.lint.analysis.wording import at, within
from hsdsl.lint.finding import Finding
from hsdsl.lint.subject import ModePart, Subject
from hsdsl.source import Scalar
from hsdsl.system import Surface


def check(subject: Subject) -> Iterator[Finding]:
    """Find degenerate surfaces."""
    for part in subject.modes:
        surfaces = [(edge.edge.surface, edge.document.when) for edge in part.edges]
        surfaces += zip(part.mode.walls, part.document.domain, strict=True)
        for surface, scalar in surfaces:
            yield from _look(subject, part, surface, scalar)


def _look(subject: Subject, part: ModePart, surface: Surface, scalar: Scalar) -> Iterator[Finding]:
    dynamics, mode = subject.dynamics, part.mode
    residual = dynamics.residual(surface)
    slopes = dynamics.gradient(mode, residual)
    if slopes is None or any(slope.is_number and slope != 0 for slope in slopes):
        return
    answer = dynamics.ask(mode, (zero(residual), *(zero(slope) for slope in slopes if slope != 0)))
    if not answer.somewhere:
        return
    where = at(dynamics, mode, answer, [residual])
    for side, said in ((positive, _uncrossed), (negative, _beyond)):
        proof = Proof(dynamics, mode)
        if not dynamics.ask(mode, (side(residual),)).somewhere and proof.never([(side(residual),)]):
            message = f"{said(surface.text, within(proof.searched))}, and 0 {where}"
            hint = "compare what passes through zero, not its square"
            yield Finding(scalar.place.span, message, hint, proof.decided, severity="warning")
            return
    if _smooth(ModePoint(dynamics, mode, answer.point), residual):
        message = f"the gradient of the surface '{surface.text}' vanishes on it {where}"
        yield Finding(scalar.place.span, message, None, answer.decided or "sampled", severity="note")


def _uncrossed(text: str, limits: str) -> str:
    return f"the surface '{text}' is {'not' if limits else 'never'} crossed{limits}: r is nowhere positive there"


def _beyond(text: str, limits: str) -> str:
    return f"every state{limits} is on or beyond the surface '{text}': r is nowhere negative there"


def _smooth(here: ModePoint, residual: object) -> bool:
    """Whether the function has a gradient at a point."""
    try:
        here.piece(residual, {})
    except Unsure:
        return False
    return True
