"""Formulas below each other, as LaTeX."""

from __future__ import annotations

import re

WIDEST = 90  # signs of a formula that fit into a line, roughly: a longer one is a paragraph that breaks by itself
_COMMAND = re.compile(r"\\[A-Za-z]+|[{}^_ ]")


def equations(pairs: list[tuple[str, str]]) -> list[str]:
    """Equations below each other, aligned; where one is too long for that, each is a paragraph."""
    if not pairs:
        return []
    if any(len(_COMMAND.sub("", left + right)) > WIDEST for left, right in pairs):
        return [r"\begin{flushleft}", *(rf"\({left} = {right}\)\par" for left, right in pairs), r"\end{flushleft}"]
    rows = [rf"{left} &= {right}" for left, right in pairs]
    return [r"\begin{align*}", " \\\\\n".join(rows), r"\end{align*}"]


def stacked(formulas: list[str]) -> list[str]:
    return [r"\begin{gather*}", " \\\\\n".join(formulas), r"\end{gather*}"]
