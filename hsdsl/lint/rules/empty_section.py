"""A section without anything in it.

## What it does

Finds empty maps and lists under keys that may be left out: `parameters`, `inputs`, `let`, `outputs`, `units`,
`reference`, and the `let`, `domain`, `outputs`, `transitions` and `reset` of modes.

## Why it is bad

It says nothing, and whoever reads the file stops there.

## Example

```yaml
parameters: {}
modes:
  m:
    flow: {x: 1}
    transitions: []
```

## Use instead

```yaml
modes:
  m:
    flow: {x: 1}
```

## How it is decided

Symbolically, from the file alone.

## How to fix it

Remove the key; `--fix` does.
"""

from __future__ import annotations

from collections.abc import Iterator

from hsdsl.lint.edits import without_entry
from hsdsl.lint.finding import Finding
from hsdsl.lint.subject import Subject
from hsdsl.source import Mapping, Node, Scalar

_OF_MODEL = ("parameters", "inputs", "let", "outputs", "units", "reference")
_OF_MODE = ("let", "domain", "outputs", "transitions")


def check(subject: Subject) -> Iterator[Finding]:
    """Find empty sections."""
    yield from _empty(subject.root, _OF_MODEL)
    for part in subject.modes:
        name = str(part.key)
        yield from _empty(subject.node("modes", name), _OF_MODE)
        for index in range(len(part.edges)):
            yield from _empty(subject.node("modes", name, "transitions", index), ("reset",))


def _empty(mapping: Node | None, keys: tuple[str, ...]) -> Iterator[Finding]:
    if not isinstance(mapping, Mapping):
        return
    for key, value in mapping:
        if key in keys and _nothing(value):
            fix = without_entry(mapping, str(key))
            yield Finding(key.place.span, f"`{key}` is empty", "leave it out", fix=fix)


def _nothing(value: Node) -> bool:
    if isinstance(value, Scalar):
        return value.kind == "null"
    return not (value.entries if isinstance(value, Mapping) else value.items)
