"""A surface whose gradient vanishes on it.

## What it does

Finds guards and walls r = 0 on which the gradient of r vanishes: a warning where r does not change its sign, as the
square of something, a note where it is one point of the surface, as where two lines cross.

## Why it is bad

How deep a state is beyond a surface is measured as r/|grad r|, which says nothing where the gradient vanishes: the
relaxed scheme halves its steps to no end. A function that does not change its sign is never crossed at all.

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

A point of the surface where all derivatives vanish is looked for, symbolically or by search, and one where r is
positive and one where it is negative.

## How to fix it

Write the surface with a function that passes through zero: `x >= 1` for `(x - 1)**2 <= 0`.
"""

from __future__ import annotations

from collections.abc import Iterator

from hsdsl.lint.analysis.question import negative, positive, zero
from hsdsl.lint.analysis.words import at
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
    passes = all(dynamics.ask(mode, (side(residual),)).somewhere for side in (positive, negative))
    where = at(dynamics, mode, answer, [residual])
    if passes:
        message = f"the gradient of the surface '{surface.text}' vanishes on it {where}"
    else:
        message = (
            f"the surface '{surface.text}' is never crossed: r does not change its sign, and its gradient vanishes "
            f"{where}"
        )
    hint = None if passes else "compare what passes through zero, not its square"
    severity = "note" if passes else "warning"
    yield Finding(scalar.place.span, message, hint, answer.decided or "sampled", severity=severity)
