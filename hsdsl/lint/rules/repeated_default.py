"""A setting that says what holds anyway.

## What it does

Finds `priority: 0`, `final: false`, `hold: zero`, and settings of `experiment` that are their defaults. `scheme` is
left alone: which scheme a model was made for is worth saying.

## Why it is bad

A model says what its scene needs and nothing more. Who reads a setting takes it for a choice.

## Example

```yaml
modes:
  m:
    flow: {x: 1}
    final: false
experiment: {until: 1, relaxation: 1e-6}
```

## Use instead

```yaml
modes:
  m:
    flow: {x: 1}
experiment: {until: 1}
```

## How it is decided

Symbolically: the exact values are equal.

## How to fix it

Leave it out; `--fix` does.
"""

from __future__ import annotations

from collections.abc import Iterator

from hsdsl.defaults import DEFAULT_TOLERANCE, DEFAULTS
from hsdsl.lint.edits import without_entry
from hsdsl.lint.finding import Finding
from hsdsl.lint.subject import Subject
from hsdsl.source import Mapping, Node

_NUMBERS = {key: DEFAULTS[key] for key in ("relaxation", "max_transitions")} | {"tolerance": DEFAULT_TOLERANCE}


def check(subject: Subject) -> Iterator[Finding]:
    """Find settings that are their defaults."""
    for name, entry in subject.document.inputs.items():
        if getattr(entry, "hold", None) == "zero":
            yield from _repeated(subject.node("inputs", str(name)), "hold")
    for part in subject.modes:
        path = ("modes", str(part.key))
        if not part.mode.final:
            yield from _repeated(subject.node(*path), "final")
        for item in part.edges:
            if item.edge.priority == 0:
                yield from _repeated(subject.node(*path, "transitions", item.index), "priority")
    experiment = subject.system.experiment
    for key, default in _NUMBERS.items():
        value = getattr(experiment, key)
        if key == "relaxation" and not subject.setting("until") >= 1:  # then the default is smaller
            continue
        if value is not None and value.is_Rational and value.p * default.denominator == value.q * default.numerator:
            yield from _repeated(subject.node("experiment"), key)
    if experiment.method == DEFAULTS["method"]:
        yield from _repeated(subject.node("experiment"), "method")


def _repeated(mapping: Node | None, name: str) -> Iterator[Finding]:
    if isinstance(mapping, Mapping) and name in mapping.entries:
        key, _ = mapping.entries[name]
        yield Finding(key.place.span, f"`{name}` is this anyway", "leave it out", fix=without_entry(mapping, name))
