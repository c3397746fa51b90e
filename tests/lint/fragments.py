"""Models for the tests of rules and of pages: fragments with what is missing written below, so that lines stay."""

from __future__ import annotations

import re

MISSING = (("hsdsl", "hsdsl: 1"), ("modes", "modes: {m: {flow: {x: 1}}}"), ("experiment", "experiment: {until: 1}"))
FIRST_MODE = re.compile(r"^modes:\s*\{?\s*(?P<name>[\w.]+):", re.MULTILINE)
FLOW = re.compile(r"flow:\s*(?:\{(?P<braces>.*)\}|(?P<lines>(?:\n +\w+:.*)+))")
STATE = re.compile(r"(?:^|[,{\n])\s*(\w+):")


def completed(fragment: str) -> str:
    """A whole model: the fragment, and the required keys that it lacks; `initial` is the first mode at 0.

    By the look of the text, since some fragments are not YAML at all.
    """
    if not re.search(r"^\w", fragment, re.MULTILINE):
        return fragment
    lines = [fragment.rstrip("\n")]
    of_parts = re.search(r"^system:", fragment, re.MULTILINE)
    missing = [(key, line) for key, line in MISSING if not (of_parts and key == "modes")]
    lines += [line for key, line in missing if not re.search(rf"^{key}:", fragment, re.MULTILINE)]
    if not of_parts and not re.search(r"^initial:", fragment, re.MULTILINE):
        lines.append(initial("\n".join(lines)))
    return "\n".join(lines) + "\n"


def initial(text: str) -> str:
    """The first mode, its states at 0."""
    mode, flow = FIRST_MODE.search(text), FLOW.search(text)
    states = []
    if flow:
        inner = flow["braces"] or flow["lines"] or ""
        states = STATE.findall(inner.split("}")[0])
    return "initial: {mode: " + ", ".join([mode["name"] if mode else "m", *(f"{s}: 0" for s in states)]) + "}"


def examples(page: str, heading: str) -> list[str]:
    """The YAML blocks of a page below a heading."""
    return [text for language, text in blocks(page, heading) if language == "yaml"]


def blocks(page: str, heading: str) -> list[tuple[str, str]]:
    """The language and the text of each fenced block below a heading."""
    parts = re.split(r"^## ", page, flags=re.MULTILINE)
    return [
        block
        for part in parts
        if part.startswith(heading + "\n")
        for block in re.findall(r"^```(\w+)\n(.*?)^```$", part, flags=re.MULTILINE | re.DOTALL)
    ]
