"""A comment that asks to ignore something that no rule has.

## What it does

Finds `# hsdsl: ignore` comments without a code in brackets, and codes in them that no lint rule has. Codes of errors
are among these: a model with an error does not run, and there is nothing to ignore.

## Why it is bad

The comment does nothing, and who wrote it thinks that it does.

## Example

```yaml
parameters: {g: 9.81}  # hsdsl: ignore
modes:
  fall:
    flow: {h: v, v: -9.81}
```

## Use instead

```yaml
parameters: {g: 9.81}  # hsdsl: ignore[HS401] for a later experiment
modes:
  fall:
    flow: {h: v, v: -9.81}
```

## How it is decided

By comparison with the codes of all rules.

## How to fix it

Write the code in brackets; a reason may follow.
"""
