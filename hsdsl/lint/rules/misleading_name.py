"""A name that looks like a function or a constant.

## What it does

Finds names that are those of a function, of `pi`, or of a word of the language but for capital letters, or that other
languages use for a function or a constant.

## Why it is bad

`Pi` or `ln` in an expression is read as the constant or the function, and here it is something else.

## Example

```yaml
parameters: {Pi: 3}
modes:
  m:
    flow: {x: Pi}
```

## Use instead

```yaml
modes:
  m:
    flow: {x: pi}
```

## How it is decided

Symbolically, from the names alone.

## How to fix it

Use the constant or the function of the language, or call it something else.
"""

from __future__ import annotations

from collections.abc import Iterator

from hsdsl.expression.scope import RESERVED
from hsdsl.lint.finding import Finding
from hsdsl.lint.subject import Subject

_ELSEWHERE = {
    "ln": "the logarithm",
    "arcsin": "the inverse sine",
    "arccos": "the inverse cosine",
    "arctan": "the inverse tangent",
    "sgn": "the sign",
    "pow": "a power",
    "inf": "infinity",
    "nan": "a missing number",
    "π": "pi",
}


def check(subject: Subject) -> Iterator[Finding]:
    """Find names that look like something else."""
    document = subject.document
    states = (key for part in subject.modes for key in part.document.flow or ())
    inner = (key for part in subject.modes for key in (*part.document.let, *part.document.outputs))
    for name in (*document.parameters, *document.inputs, *document.let, *document.outputs, *states, *inner):
        lowered = name.lower()
        if len(name) > 1 and lowered in RESERVED:
            yield Finding(name.place.span, f"'{name}' looks like `{lowered}` of the language", "call it something else")
        elif lowered in _ELSEWHERE:
            yield Finding(name.place.span, f"'{name}' looks like {_ELSEWHERE[lowered]}", "call it something else")
