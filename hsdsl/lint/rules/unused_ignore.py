"""A comment that ignores a finding that is not there.

## What it does

Finds codes in `# hsdsl: ignore[...]` comments that nothing on their line is reported for. A comment is about its own
line, or, where it stands alone on a line, about the next line that is not a comment.

## Why it is bad

The finding was remedied, or the comment has strayed from its line. Left there, it would hide the next finding.

## Example

```yaml
parameters: {g: 9.81}  # hsdsl: ignore[HS401] for a later experiment
modes:
  fall:
    flow: {h: v, v: -g}
```

## Use instead

```yaml
parameters: {g: 9.81}
modes:
  fall:
    flow: {h: v, v: -g}
```

## How it is decided

By comparison with what the rules have found. Codes of rules that did not run are left alone.

## How to fix it

Remove the code, or the comment.
"""
