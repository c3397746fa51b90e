"""Diagnostics with a place, and the exceptions that carry them."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

Severity = Literal["error", "warning", "note"]
Decided = Literal["symbolic", "interval", "sampled"]


@dataclass(frozen=True, order=True)
class Span:
    """A place in a text.

    Attributes
    ----------
    path : str
        The file.
    line, column : int
        From 1.
    length : int
        The number of characters.
    """

    path: str
    line: int
    column: int
    length: int = 1


@dataclass(frozen=True, order=True)
class Edit:
    """A change of a text: ``replacement`` replaces the characters from ``start`` to ``end``."""

    start: int
    end: int
    replacement: str = ""


@dataclass(frozen=True)
class Diagnostic:
    """One error in a model, or one finding about it.

    Attributes
    ----------
    code : str
        The code of an error (:data:`CODES`) or of a lint rule; `hsdsl explain CODE` prints its page.
    message : str
        One sentence.
    span : Span or None
        Its place; None if no single place is at fault.
    hint : str or None
        The right form, if it is known.
    text : str or None
        The line of the file.
    severity : {"error", "warning", "note"}
        An error makes the model unusable; warnings and notes come from lint rules.
    decided : {"symbolic", "interval", "sampled"} or None
        The kind of proof of a finding.
    fix : tuple of Edit
        Edits that remedy the finding and keep the model's meaning.
    """

    code: str
    message: str
    span: Span | None = None
    hint: str | None = None
    text: str | None = field(default=None, compare=False)
    severity: Severity = "error"
    decided: Decided | None = None
    fix: tuple[Edit, ...] = ()

    def __post_init__(self) -> None:
        if self.severity == "error" and self.code not in CODES:
            raise ValueError(f"unregistered diagnostic code {self.code}")

    def __str__(self) -> str:
        """``path:line:column: error HS012: sentence``."""
        where = f"{self.span.path}:{self.span.line}:{self.span.column}: " if self.span else ""
        return f"{where}{self.severity} {self.code}: {self.message}"


class ModelError(Exception):
    """The model has errors (exit code 1).

    Attributes
    ----------
    diagnostics : tuple of Diagnostic
        All of them, in source order.
    """

    def __init__(self, diagnostics: list[Diagnostic] | tuple[Diagnostic, ...]) -> None:
        self.diagnostics = tuple(diagnostics)
        super().__init__(self.diagnostics)  # its arguments when it is unpickled in another process

    def __str__(self) -> str:
        return "\n".join(f"{d}" + (f" ({d.hint})" if d.hint else "") for d in self.diagnostics)


class UsageError(Exception):
    """The request is wrong, or a file cannot be read (exit code 2). The message is a sentence for the user.

    Attributes
    ----------
    hint : str or None
        What to write instead, if it is known.
    """

    def __init__(self, message: str, hint: str | None = None) -> None:
        super().__init__(message)
        self.hint = hint
        if hint is not None:
            self.add_note(f"hint: {hint}")


MOST_DIAGNOSTICS = 500


@dataclass
class Findings:
    """The diagnostics of one file, gathered so that all are reported, not only the first."""

    path: str = ""
    diagnostics: dict[Diagnostic, None] = field(default_factory=dict[Diagnostic, None])

    def add(self, diagnostic: Diagnostic) -> None:
        """Keep a diagnostic, once.

        Raises ModelError: when there are :data:`MOST_DIAGNOSTICS`: nobody reads on.
        """
        self.diagnostics[diagnostic] = None
        if len(self.diagnostics) >= MOST_DIAGNOSTICS:
            self.raise_if_any()

    def raise_if_any(self) -> None:
        """Raise all diagnostics so far, in source order, other files last.

        Raises ModelError: when there is at least one diagnostic.
        """
        if self.diagnostics:
            raise ModelError(sorted(self.diagnostics, key=self._source_order))

    def _source_order(self, diagnostic: Diagnostic) -> tuple[bool, str, int, int]:
        span = diagnostic.span
        return (span.path != self.path, span.path, span.line, span.column) if span else (False, "", 0, 0)


def _titles(file: str) -> dict[str, str]:
    """What each code is about, in one line, by the headings of its pages."""
    return dict(re.findall(r"^# (HS\d{3}) (.*)$", Path(__file__).with_name(file).read_text("utf-8"), re.MULTILINE))


CODES = _titles("errors.md")  # The codes are stable; a retired one is never used again.
WARNINGS = _titles("warnings.md")  # of runs
TOO_LONG = "HS122"
STEP_AND_TOLERANCE = "HS320"  # wrong usage rather than a wrong model: the command line exits with 2
