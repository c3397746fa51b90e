"""A parameter that nothing uses.

## What it does

Finds parameters that no part of the model depends on: neither directly nor through other parameters, inputs or
`let` names that are used themselves.

## Why it is bad

It is left over, or something that should depend on it does not. Whoever sets it with `--set` changes nothing.

## Example

```yaml
parameters: {g: 9.81, drag: 0.1}
modes:
  fall:
    flow: {h: v, v: -g}
```

## Use instead

```yaml
parameters: {g: 9.81, drag: 0.1}
modes:
  fall:
    flow: {h: v, v: -g - drag*v}
```

## How it is decided

Symbolically, from the names that the file's expressions are written with.

## How to fix it

Remove the parameter, or use it.
"""

from __future__ import annotations

from collections.abc import Iterator

from hsdsl.lint.finding import Finding
from hsdsl.lint.subject import Subject
from hsdsl.lint.uses import Definition


def check(subject: Subject) -> Iterator[Finding]:
    """Find parameters that nothing uses."""
    for name in subject.document.parameters:
        if Definition("parameter", None, str(name)) in subject.unused:
            yield Finding(name.place.span, f"nothing uses the parameter '{name}'", "remove it, or use it")
