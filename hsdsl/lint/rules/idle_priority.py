"""A priority without a rival.

## What it does

Finds `priority` where no other transition of the mode has a different one.

## Why it is bad

A priority decides between transitions that are reached together. Alone, or equal to all others, it decides nothing, and
seems to.

## Example

```yaml
modes:
  m:
    flow: {x: 1}
    transitions: [{when: x >= 1, to: m, reset: {x: 0}, priority: 2}]
```

## Use instead

```yaml
modes:
  m:
    flow: {x: 1}
    transitions: [{when: x >= 1, to: m, reset: {x: 0}}]
```

## How it is decided

Symbolically, from the file alone.

## How to fix it

Leave it out, which `--fix` does, or give the rival another one.
"""

from __future__ import annotations

from collections.abc import Iterator

from hsdsl.lint.edits import without_entry
from hsdsl.lint.finding import Finding
from hsdsl.lint.subject import Subject
from hsdsl.source import Mapping


def check(subject: Subject) -> Iterator[Finding]:
    """Find priorities that decide nothing."""
    for part in subject.modes:
        if len({edge.priority for edge in part.mode.edges}) > 1:
            continue
        for item in part.edges:
            mapping = subject.node("modes", str(part.key), "transitions", item.index)
            if item.edge.priority and isinstance(mapping, Mapping) and "priority" in mapping.entries:
                key, _ = mapping.entries["priority"]
                message = f"no transition of the mode '{part.key}' has another priority"
                yield Finding(key.place.span, message, "leave it out", fix=without_entry(mapping, "priority"))
