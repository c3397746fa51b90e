"""A rule that could not be decided.

## What it does

Says that a rule has given up on this model: its symbolic work took longer than a share of the time that a model may
take, or met an expression that it has no answer for.

## Why it is bad

Nothing found by a rule that gave up does not mean that there is nothing.

## Example

```text
1:1: note HS492: whether HS501 finds something here is not known: it takes too long
```

## Use instead

Simpler expressions, or more time: `--limit seconds=600`.

## How it is decided

By the processor time that the rule takes.

## How to fix it

Make parts of large expressions states, or look at the model yourself with the rule's page beside it.
"""
