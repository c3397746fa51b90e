"""An input that nothing uses.

## What it does

Finds inputs that no part of the model depends on.

## Why it is bad

It is left over, or something that should depend on it does not. The jumps and kinks of a sampled input end steps, so
one that is not used still costs time.

## Example

```yaml
inputs: {u: 20*cos(2.5*t)}
modes:
  free:
    flow: {x: v, v: -x}
```

## Use instead

```yaml
inputs: {u: 20*cos(2.5*t)}
modes:
  free:
    flow: {x: v, v: u - x}
```

## How it is decided

Symbolically, from the names that the file's expressions are written with.

## How to fix it

Remove the input, or use it.
"""

from __future__ import annotations

from collections.abc import Iterator

from hsdsl.lint.finding import Finding
from hsdsl.lint.subject import Subject
from hsdsl.lint.uses import Definition


def check(subject: Subject) -> Iterator[Finding]:
    """Find inputs that nothing uses."""
    for name in subject.document.inputs:
        if Definition("input", None, str(name)) in subject.unused:
            yield Finding(name.place.span, f"nothing uses the input '{name}'", "remove it, or use it")
