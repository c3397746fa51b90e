# pyright: basic
"""A relaxation that means very different things at different surfaces.

## What it does

Finds relaxed runs where the depth of states beyond their surfaces grows at speeds s = L_f r/|grad r| that differ by
more than a factor of 1,000 from one surface to another.

## Why it is bad

The relaxation is compared with a depth in the model's own units and with time, as in the paper. A transition is
delayed by up to relaxation/s: one value cannot suit both a surface that is approached at 1e-3 and one that is
approached at 10.

## Example

```yaml
modes:
  m:
    flow: {metres: 1, grams: 100000}
    transitions:
      - {when: metres >= 1, to: m, reset: {metres: 0}}
      - {when: grams >= 1000, to: m, reset: {grams: 0}}
experiment: {until: 10, scheme: relaxed}
```

## Use instead

```yaml
modes:
  m:
    flow: {metres: 1, kilograms: 100}
    transitions:
      - {when: metres >= 1, to: m, reset: {metres: 0}}
      - {when: kilograms >= 1, to: m, reset: {kilograms: 0}}
experiment: {until: 10, scheme: relaxed}
```

## How it is decided

Symbolically where the speed is a constant, with the parameters of the file; else by its values at the transitions
that the `reference` gives with all states. Other surfaces are left alone.

## How to fix it

Choose units in which the states are of similar size.
"""

from __future__ import annotations

from collections.abc import Iterator

import sympy as sp

from hsdsl.expression import numeric
from hsdsl.expression.scope import symbol
from hsdsl.lint.finding import Finding
from hsdsl.lint.numbers import Number, evaluate
from hsdsl.lint.start import along
from hsdsl.lint.subject import EdgePart, Subject
from hsdsl.schema import ReferenceTransitionDocument
from hsdsl.system import TIME, Mode

_FACTOR = 1000


def check(subject: Subject) -> Iterator[Finding]:
    """Find surfaces whose speeds are far apart."""
    if not subject.relaxed:
        return
    speeds = [found for part in subject.modes for item in part.edges for found in _speeds(subject, part.mode, item)]
    if not speeds:
        return
    (slow, edge, exact), (fast, other, also) = min(speeds, key=_speed), max(speeds, key=_speed)
    if fast > _FACTOR * slow and edge is not other:
        message = (
            f"the guard of '{edge.edge.name}' is approached at {float(slow):.2g} and that of '{other.edge.name}' "
            f"at {float(fast):.2g}: one relaxation does not suit both"
        )
        decided = "symbolic" if exact and also else "sampled"
        yield Finding(edge.document.when.place.span, message, "choose units of similar size", decided)


def _speed(found: tuple[Number, EdgePart, bool]) -> Number:
    return found[0]


def _speeds(subject: Subject, mode: Mode, item: EdgePart) -> Iterator[tuple[Number, EdgePart, bool]]:
    """Positive speeds at a guard, and whether each holds everywhere on it."""
    residual = item.edge.surface.residual
    within = residual.free_symbols & {*map(symbol, mode.states), TIME}
    squared = sp.Add(*(residual.diff(s) ** 2 for s in within))
    rate = along(mode, residual)
    symbols = rate.free_symbols | squared.free_symbols
    if symbols <= set(subject.numbers):
        points, exact = [subject.numbers], True
    else:
        points, exact = [p for p in _known_points(subject, item) if symbols <= set(p)], False
    for point in points:
        speed = numeric.inverse(evaluate(sp.sqrt(squared), point))
        speed = numeric.product([speed, evaluate(rate, point)])
        if numeric.finite(speed) and speed > 0:
            yield speed, item, exact


def _known_points(subject: Subject, item: EdgePart) -> Iterator[dict[sp.Symbol, Number]]:
    """The states before transitions of an edge, as references of the file give them."""
    for reference in subject.document.reference:
        for event in reference.transitions:
            if isinstance(event, ReferenceTransitionDocument) and event.edge and event.edge.value == item.edge.name:
                before = {symbol(name): subject.read(scalar) for name, scalar in event.before.items()}
                yield {**subject.numbers, TIME: subject.read(event.time), **before}
