# pyright: basic
"""An `if` that is always true, or always false.

## What it does

Finds conditions that do not depend on anything.

## Why it is bad

A condition that always holds says nothing. One that never holds switches its transition off, and the surface with it:
the states beyond it belong to the mode, which is hardly what the transition is there for.

## Example

```yaml
modes:
  m:
    flow: {x: 1}
    transitions: [{when: x >= 1, if: x**2 >= 0, to: m, reset: {x: 0}}]
```

## Use instead

```yaml
modes:
  m:
    flow: {x: 1}
    transitions: [{when: x >= 1, to: m, reset: {x: 0}}]
```

## How it is decided

Symbolically: for every comparison, whether the sign of the difference of its sides is known for all real values.

## How to fix it

Remove the condition, or the transition.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import sympy as sp

from hsdsl.lint.finding import Finding
from hsdsl.lint.subject import Subject


def check(subject: Subject) -> Iterator[Finding]:
    """Find conditions that are always true or always false."""
    for part in subject.modes:
        for item in part.edges:
            scalar = item.document.condition
            decided = None if scalar is None else _decided(item.edge.condition)
            if scalar is not None and decided is not None:
                hint = "remove it" if decided else "remove the transition, or write when it is to fire"
                yield Finding(scalar.place.span, f"this condition is always {str(decided).lower()}", hint)


def _decided(condition: Any) -> bool | None:
    known = {}
    for relation in condition.atoms(sp.core.relational.Relational):
        truth = _truth(relation)
        if truth is not None:
            known[relation] = sp.true if truth else sp.false
    left = condition.xreplace(known)
    return bool(left) if left in (sp.true, sp.false) else None


def _truth(relation: Any) -> bool | None:
    difference = sp.expand(relation.lhs - relation.rhs)
    match relation:
        case sp.Gt() | sp.Le():
            truth = difference.is_positive if difference.is_positive is not None else _not(difference.is_nonpositive)
            return truth if isinstance(relation, sp.Gt) else _not(truth)
        case sp.Lt() | sp.Ge():
            truth = difference.is_negative if difference.is_negative is not None else _not(difference.is_nonnegative)
            return truth if isinstance(relation, sp.Lt) else _not(truth)
        case sp.Eq():
            return difference.is_zero
        case _:
            return _not(difference.is_zero)


def _not(truth: bool | None) -> bool | None:
    return None if truth is None else not truth
