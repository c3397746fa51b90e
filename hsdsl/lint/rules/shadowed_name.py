"""A `let` of a mode with the name of one of the whole model.

## What it does

Finds named subexpressions of a mode that hide one of the model.

## Why it is bad

It is legal, and the mode uses its own. Who reads another part of the file sees the same name and thinks of the other
expression; a top-level `let` that uses the hidden one still uses the hidden one.

## Example

```yaml
let: {force: -x}
modes:
  free:
    let: {force: -2*x}
    flow: {x: v, v: force}
outputs: {f: force}
```

## Use instead

```yaml
let: {force: -x}
modes:
  free:
    let: {double_force: -2*x}
    flow: {x: v, v: double_force}
outputs: {f: force}
```

## How it is decided

Symbolically, from the names alone.

## How to fix it

Give one of them another name.
"""

from __future__ import annotations

from collections.abc import Iterator

from hsdsl.lint.finding import Finding
from hsdsl.lint.subject import Subject


def check(subject: Subject) -> Iterator[Finding]:
    """Find `let` names of modes that hide others."""
    top = {str(name): name for name in subject.document.let}
    for part in subject.modes:
        for name in part.document.let:
            if name in top:
                line = top[str(name)].place.span.line
                message = f"'{name}' hides the `let` name of line {line} in the mode '{part.key}'"
                yield Finding(name.place.span, message, "give one of them another name")
