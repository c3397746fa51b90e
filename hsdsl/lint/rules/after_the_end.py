"""Something that comes after the end of a run.

## What it does

Finds transitions and walls of a final mode.

## Why it is bad

A run ends on entering a final mode. Nothing that stands there can happen.

## Example

```yaml
modes:
  drive:
    flow: {x: 1}
    transitions: [{when: x >= 1, to: home}]
  home:
    final: true
    flow: {x: 1}
    transitions: [{when: x >= 2, to: drive, reset: {x: 0}}]
```

## Use instead

```yaml
modes:
  drive:
    flow: {x: 1}
    transitions: [{when: x >= 1, to: home}]
  home:
    final: true
```

## How it is decided

Symbolically, from the file alone.

## How to fix it

Remove what stands there, or `final: true`.
"""

from __future__ import annotations

from collections.abc import Iterator

from hsdsl.lint.finding import Finding
from hsdsl.lint.subject import Subject


def check(subject: Subject) -> Iterator[Finding]:
    """Find transitions and walls of final modes."""
    for part in subject.modes:
        if part.mode.final:
            for item in part.edges:
                message = f"this transition never fires: a run ends on entering '{part.key}'"
                yield Finding(item.document.when.place.span, message, "remove it, or `final: true`")
            for scalar in part.document.domain:
                message = f"this wall is never met: a run ends on entering '{part.key}'"
                yield Finding(scalar.place.span, message, "remove it, or `final: true`")
