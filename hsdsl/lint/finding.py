"""What a rule says of a model."""

from __future__ import annotations

from dataclasses import dataclass

from hsdsl.errors import Decided, Edit, Severity, Span


@dataclass(frozen=True)
class Finding:
    """One thing that a rule has found. Its code is the rule's.

    Attributes
    ----------
    span : Span
        Where: the smallest part of the file that has to change.
    message : str
        One sentence, with the names it is about.
    hint : str or None
        What to write instead, when that is known.
    decided : {"symbolic", "interval", "sampled"}
        How it is known: for all values, by bounds over boxes, or at points that were tried.
    fix : tuple of Edit
        Changes of the text that remedy it and leave what the model means as it is; empty where there are none.
    severity : {"warning", "note"} or None
        How much it weighs, where that is not what the rule's findings usually weigh.
    """

    span: Span
    message: str
    hint: str | None = None
    decided: Decided = "symbolic"
    fix: tuple[Edit, ...] = ()
    severity: Severity | None = None
