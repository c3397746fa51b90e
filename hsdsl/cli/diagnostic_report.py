"""Errors and findings of several models, printed in one of four formats."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from hsdsl import __version__
from hsdsl.cli.console import MODEL_ERRORS, WRONG_USAGE, counted, print_errors, print_json, report_usage
from hsdsl.cli.options import Format
from hsdsl.diagnose import as_annotation, as_sarif, finding, measured, render
from hsdsl.errors import Diagnostic, ModelError, UsageError

if TYPE_CHECKING:
    from hsdsl.lint import Ignored


@dataclass
class DiagnosticReport:
    """Errors and findings so far, and the exit code that follows from them."""

    format: Format
    notes: bool = True  # whether text shows notes in full
    entries: list[dict[str, Any]] = field(default_factory=list[dict[str, Any]])
    errors: list[Diagnostic] = field(default_factory=list[Diagnostic])
    findings: list[Diagnostic] = field(default_factory=list[Diagnostic])
    ignored: list[Ignored] = field(default_factory=list["Ignored"])
    code: int = 0

    def add_error(self, entry: dict[str, Any], error: ModelError | UsageError) -> None:
        """Add a model that has errors or cannot be read."""
        if isinstance(error, ModelError):
            self.errors += error.diagnostics
            self.entries.append(entry)
            self.code = max(self.code, MODEL_ERRORS)
        else:
            report_usage(error, json=False)
            self.entries.append({**entry, "message": str(error)})
            self.code = WRONG_USAGE

    def add(self, entry: dict[str, Any], findings: Sequence[Diagnostic] = (), ignored: Sequence[Ignored] = ()) -> None:
        """Add a model without errors."""
        self.entries.append(entry)
        self.findings += findings
        self.ignored += ignored
        self.code = max(self.code, MODEL_ERRORS * any(found.severity == "warning" for found in findings))

    def print(self, lint: bool) -> None:
        """Print everything: errors as text to standard error, all else to standard output."""
        if self.format == "json":
            self._json(lint)
        elif self.format == "sarif":
            self._sarif()
        elif self.format == "github":
            for diagnostic in (*self.errors, *self.findings):
                print(as_annotation(diagnostic))
        else:
            self._text()

    def _text(self) -> None:
        if self.errors:
            print_errors(self.errors)
        shown = [finding for finding in self.findings if self.notes or finding.severity == "warning"]
        if shown:
            print("\n\n".join(map(render, shown)))
            print(f"\n{counted(len(shown), 'finding')}")

    def count_hidden(self) -> None:
        """Print the number of notes that text does not show."""
        hidden = [found.code for found in self.findings if found.severity == "note" and not self.notes]
        if hidden:
            about = " on the mathematics" if all(code.startswith("HS5") for code in hidden) else ""
            print(f"{counted(len(hidden), 'note')}{about}: hsdsl lint --notes")

    def _json(self, lint: bool) -> None:
        content: dict[str, Any] = {"models": self.entries, "errors": [measured(error) for error in self.errors]}
        if lint:
            content["findings"] = [finding(diagnostic) for diagnostic in self.findings]
            content["ignored"] = [{**finding(i.diagnostic), "reason": i.reason} for i in self.ignored]
        print_json(content)

    def _sarif(self) -> None:
        from hsdsl.lint.pages import pages, titles

        ignored = [(i.diagnostic, i.reason) for i in self.ignored]
        print_json(as_sarif([*self.errors, *self.findings], ignored, titles(), pages(), __version__))
