"""Two names that are hard to tell apart.

## What it does

Finds pairs of names of parameters, inputs, states, `let` names and outputs that differ only in capital letters, in
underscores, or in letters of different alphabets that look alike. Single letters are left alone: that T is not t is
good custom in mathematics.

## Why it is bad

One is taken for the other, by people and sometimes on purpose. The model stays legal when the wrong one is written.

## Example

```yaml
parameters: {x_max: 1, X_max: 2}
modes:
  m:
    flow: {x: X_max}
    transitions: [{when: x >= x_max, to: m, reset: {x: 0}}]
```

## Use instead

```yaml
parameters: {x_max: 1, speed: 2}
modes:
  m:
    flow: {x: speed}
    transitions: [{when: x >= x_max, to: m, reset: {x: 0}}]
```

## How it is decided

Symbolically, from the names alone.

## How to fix it

Give one of them another name.
"""

from __future__ import annotations

import unicodedata
from collections.abc import Iterator

from hsdsl.lint.finding import Finding
from hsdsl.lint.subject import Subject
from hsdsl.source import Key

# Cyrillic and Greek letters that look like Latin ones
_ALIKE = str.maketrans(
    "аеорсухіјѕԁһԛԝАВЕКМНОРСТУХІЈЅΑΒΕΖΗΙΚΜΝΟΡΤΥΧοανρ", "aeopcyxijsdhqwABEKMHOPCTYXIJSABEZHIKMNOPTYXoavp"
)


def check(subject: Subject) -> Iterator[Finding]:
    """Find names that are hard to tell apart."""
    first: dict[str, str] = {}
    for name in _names(subject):
        other = first.setdefault(_look(name), str(name))
        if other != name:
            yield Finding(name.place.span, f"the name '{name}' is easily taken for '{other}'", "call it something else")


def _look(name: str) -> str:
    """What is left of a name to a quick eye."""
    latin = unicodedata.normalize("NFKC", name).translate(_ALIKE)
    return latin if len(latin) == 1 else latin.replace("_", "").casefold()


def _names(subject: Subject) -> Iterator[Key]:
    document = subject.document
    yield from (*document.parameters, *document.inputs, *document.let, *document.outputs)
    for part in subject.modes:
        yield from (*(part.document.flow or ()), *part.document.let, *part.document.outputs)
