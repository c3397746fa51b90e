# pyright: basic
"""A run that ends at the very moment of a transition.

## What it does

Finds ends of an experiment at which a guard is reached: one that depends on time alone, one that the constant flow of
the initial mode reaches then, or one that the `reference` gives a transition for.

## Why it is bad

A guard reached at the end still fires, within round-off; on another machine or with another method it may not. Whoever
compares two runs compares states before and after the jump.

## Example

```yaml
modes:
  m:
    flow: {x: 1}
    transitions: [{when: t >= 1, to: m, reset: {x: 0}}]
experiment: {until: 1}
```

## Use instead

```yaml
modes:
  m:
    flow: {x: 1}
    transitions: [{when: t >= 1, to: m, reset: {x: 0}}]
experiment: {until: 1.5}
```

## How it is decided

By the values of the surface functions at the end, with the parameters of the file. Guards that are reached only after
other transitions are not followed.

## How to fix it

End a little earlier or later.
"""

from __future__ import annotations

from collections.abc import Iterator

import sympy as sp

from hsdsl.expression import numeric
from hsdsl.expression.scope import symbol
from hsdsl.lint.finding import Finding
from hsdsl.lint.numbers import Number, evaluate, holds
from hsdsl.lint.start import ON, leaves, side
from hsdsl.lint.subject import ModePart, Subject
from hsdsl.source import Scalar
from hsdsl.system import TIME

_TIE = 1e-12


def check(subject: Subject) -> Iterator[Finding]:
    """Find ends at which something happens."""
    until = subject.setting("until")
    names = dict.fromkeys((*_timed(subject, until), *_reached(subject, until), *_known(subject, until)))
    for name in names:
        message = f"the run ends at the very moment of '{name}'"
        yield Finding(subject.document.experiment.until.place.span, message, "end a little earlier or later")


def _timed(subject: Subject, until: Number) -> Iterator[str]:
    """The guards of time alone."""
    point = {**subject.numbers, TIME: until}
    for part in subject.modes:
        for edge in part.mode.edges:
            symbols = edge.surface.residual.free_symbols
            reached = TIME in symbols and symbols <= set(point) and side(edge.surface, point) == ON
            if reached and leaves(part.mode, edge.surface, point) is not False:  # rising, as far as is known
                yield edge.name


def _reached(subject: Subject, until: Number) -> Iterator[str]:
    """The guards that the constant flow of the initial mode reaches at the end, and none before."""
    part = subject.mode(subject.system.initial.mode)
    end = {**subject.start, TIME: until}
    constant = set(subject.numbers)
    for name, rate in zip(part.mode.states, part.mode.flow, strict=True):
        if not rate.free_symbols <= constant:
            return
        end[symbol(name)] = evaluate(symbol(name) + rate * TIME, {**subject.start, TIME: until})
    surfaces = [edge.surface for edge in part.mode.edges]
    sides = [side(surface, end) for surface in (*surfaces, *part.mode.walls) if _affine(part, surface.residual)]
    known = len(sides) == len(surfaces) + len(part.mode.walls)
    if known and all(where is not None and where <= ON for where in sides):
        pairs = zip(part.mode.edges, sides, strict=False)
        yield from (edge.name for edge, where in pairs if where == ON and holds(edge.condition, end))


def _affine(part: ModePart, residual: sp.Expr) -> bool:
    """Whether a surface function is affine in states and time: then it is monotone along a constant flow."""
    symbols = residual.free_symbols & {*map(symbol, part.mode.states), TIME}
    return all(residual.diff(a, b) == 0 for a in symbols for b in symbols)


def _known(subject: Subject, until: Number) -> Iterator[str]:
    """The transitions that a reference of the file as it stands gives the time of the end."""
    for reference in subject.document.reference:
        if reference.settings:
            continue
        for event in reference.transitions:
            scalar = event if isinstance(event, Scalar) else event.time
            time = subject.read(scalar)
            if numeric.finite(time) and abs(time - until) <= _TIE * abs(until):
                edge = None if isinstance(event, Scalar) else event.edge
                yield "a transition of the reference" if edge is None else edge.value
