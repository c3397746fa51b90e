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

from collections.abc import Iterator

from hsdsl.expression.syntax import Name
from hsdsl.lint.finding import Finding
from hsdsl.lint.subject import Subject


def check(subject: Subject) -> Iterator[Finding]:
    """Find outputs with a name that means something else."""
    document = subject.document
    trees = {e.name: e.tree for e in subject.expressions if e.role == "output"}
    for name in document.outputs:
        tree = trees[name]
        taken = name in document.parameters or name in document.inputs or name in document.let
        if taken and not (isinstance(tree, Name) and tree.name == name):
            message = f"the output '{name}' is something else than '{name}' in the expressions of this file"
            yield Finding(name.place.span, message, "give one of them another name")
