"""An output that is not the thing of its name.

## What it does

Finds outputs with the name of a parameter, an input or a `let` name whose expression is something else.

## Why it is bad

The name means one thing in the expressions of the file and another in the results.

## Example

```yaml
let: {energy: v**2/2}
modes:
  free:
    flow: {x: v, v: -x}
outputs: {energy: energy + x**2/2}
```

## Use instead

```yaml
let: {kinetic: v**2/2}
modes:
  free:
    flow: {x: v, v: -x}
outputs: {energy: kinetic + x**2/2}
```

## How it is decided

Symbolically: the output's expression is not the name alone.

## How to fix it

Give one of them another name.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator

from hsdsl.expression.syntax import Name
from hsdsl.lint.finding import Finding
from hsdsl.lint.subject import Subject
from hsdsl.source import Key


def check(subject: Subject) -> Iterator[Finding]:
    """Find outputs with a name that means something else."""
    trees = {(e.mode, e.name): e.tree for e in subject.expressions if e.role == "output"}
    for mode, name, taken in _outputs(subject):
        tree = trees[mode, name]
        if name in taken and not (isinstance(tree, Name) and tree.name == name):
            message = f"the output '{name}' is something else than '{name}' in the expressions of this file"
            yield Finding(name.place.span, message, "give one of them another name")


def _outputs(subject: Subject) -> Iterator[tuple[str | None, Key, Collection[str]]]:
    """Every output with its mode, and the names that mean something where it is read."""
    document = subject.document
    shared = {*document.parameters, *document.inputs, *document.let}
    everywhere = shared.union(*(part.document.let for part in subject.modes))
    yield from ((None, name, everywhere) for name in document.outputs)
    for part in subject.modes:
        here = shared.union(part.document.let) if part.document.outputs else shared
        yield from ((str(part.key), name, here) for name in part.document.outputs)
