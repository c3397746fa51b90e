"""Models for the tests of rules: fragments with what is missing written below, so that lines keep their numbers."""

from __future__ import annotations

import re

import yaml


def completed(fragment: str) -> str:
    """A whole model: the fragment, and `hsdsl`, `initial` (the first mode at 0) and `experiment` where it has none."""
    keys = yaml.load(fragment, yaml.BaseLoader)
    lines = [fragment.rstrip("\n")]
    if "hsdsl" not in keys:
        lines.append("hsdsl: 1")
    if "initial" not in keys:
        name, mode = next(iter(keys["modes"].items()))
        states = "".join(f", {state}: 0" for state in mode.get("flow", {}))
        lines.append(f"initial: {{mode: {name}{states}}}")
    if "experiment" not in keys:
        lines.append("experiment: {until: 1}")
    return "\n".join(lines) + "\n"


def examples(page: str, heading: str) -> list[str]:
    """The YAML blocks of a rule's page below a heading."""
    parts = re.split(r"^## ", page, flags=re.MULTILINE)
    return [
        block
        for part in parts
        if part.startswith(heading + "\n")
        for block in re.findall(r"^```yaml\n(.*?)^```$", part, flags=re.MULTILINE | re.DOTALL)
    ]
