"""A reset that says what holds anyway.

## What it does

Finds entries of `reset` that give a state its own value.

## Why it is bad

A state that a reset does not name keeps its value where the target has it. Who reads the entry looks for a change
and finds none; where a change was meant, it is missing.

## Example

```yaml
modes:
  free:
    flow: {x: v, v: -x}
    transitions:
      - {when: x >= 1, to: free, reset: {x: x, v: -v}}
```

## Use instead

```yaml
modes:
  free:
    flow: {x: v, v: -x}
    transitions:
      - {when: x >= 1, to: free, reset: {v: -v}}
```

## How it is decided

Symbolically: the expression, with `let` names replaced, is the state itself.

## How to fix it

Remove the entry; `--fix` does.
"""

from __future__ import annotations

from collections.abc import Iterator

from hsdsl.expression.scope import symbol
from hsdsl.lint.edits import without_entry
from hsdsl.lint.finding import Finding
from hsdsl.lint.subject import Subject


def check(subject: Subject) -> Iterator[Finding]:
    """Find resets of a state to itself."""
    for part in subject.modes:
        for edge in part.edges:
            new = dict(zip(edge.edge.target_states, edge.edge.reset, strict=True))
            for name in edge.document.reset:
                if new[str(name)] == symbol(name) and name in part.mode.states:
                    message = f"the state '{name}' keeps its value anyway"
                    table = subject.node("modes", str(part.key), "transitions", edge.index, "reset")
                    fix = without_entry(table, str(name))
                    yield Finding(name.place.span, message, "leave it out", fix=fix)
