"""A `let` name that nothing uses.

## What it does

Finds named subexpressions, of the model or of a mode, that no part of the model depends on.

## Why it is bad

It is left over, or one was meant where something else stands. A `let` of a mode also hides the one of the whole model
with the same name, which is then used nowhere in that mode.

## Example

```yaml
let: {energy: v**2/2 + x**2/2}
modes:
  free:
    flow: {x: v, v: -x}
```

## Use instead

```yaml
let: {energy: v**2/2 + x**2/2}
modes:
  free:
    flow: {x: v, v: -x}
outputs: {E: energy}
```

## How it is decided

Symbolically, from the names that the file's expressions are written with.

## How to fix it

Remove it, which `--fix` does, or use it.
"""

from __future__ import annotations

from collections.abc import Iterator

from hsdsl.lint.edits import without_entry
from hsdsl.lint.finding import Finding
from hsdsl.lint.subject import Subject
from hsdsl.lint.uses import Definition


def check(subject: Subject) -> Iterator[Finding]:
    """Find `let` names that nothing uses."""
    for name in subject.document.let:
        if Definition("let", None, str(name)) in subject.unused:
            fix = without_entry(subject.node("let"), str(name))
            yield Finding(name.place.span, f"nothing uses the `let` name '{name}'", "remove it, or use it", fix=fix)
    for part in subject.modes:
        for name in part.document.let:
            if Definition("let", str(part.key), str(name)) in subject.unused:
                message = f"nothing in the mode '{part.key}' uses its `let` name '{name}'"
                fix = without_entry(subject.node("modes", str(part.key), "let"), str(name))
                yield Finding(name.place.span, message, "remove it, or use it", fix=fix)
