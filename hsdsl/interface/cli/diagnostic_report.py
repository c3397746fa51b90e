"""Errors and findings of several models, printed in one of four formats."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from typer import Exit

from hsdsl import __version__
from hsdsl.base.errors import Diagnostic, ModelError, UsageError
from hsdsl.base.names import counted, visible
from hsdsl.interface.cli.console import MODEL_ERRORS, WRONG_USAGE, print_errors, print_json, report_usage, usage_entry
from hsdsl.interface.cli.options import Format
from hsdsl.language.diagnose import as_annotation, as_sarif, finding, measured, render

if TYPE_CHECKING:
    from hsdsl.analysis.lint import Ignored


@dataclass
class DiagnosticReport:
    """Errors and findings so far, and the exit code that follows from them.

    ``success`` is the key of an entry whose value is false where a model has errors.
    """

    format: Format
    quiet: bool
    success: str
    notes: bool = True  # whether text shows notes in full
    entries: list[dict[str, Any]] = field(default_factory=list[dict[str, Any]])
    errors: list[Diagnostic] = field(default_factory=list[Diagnostic])
    refused: list[dict[str, Any]] = field(default_factory=list[dict[str, Any]])  # what is no error of a model
    findings: list[Diagnostic] = field(default_factory=list[Diagnostic])
    ignored: list[Ignored] = field(default_factory=list["Ignored"])
    code: int = 0

    @property
    def chatty(self) -> bool:
        """Whether it prints a line about each model."""
        return self.format == "text" and not self.quiet

    def examine(self, models: Sequence[Path], look: Callable[[Path], tuple[dict[str, Any], str]]) -> None:
        """Add every model: ``look(path)`` gives its entry and, for text, a line."""
        for path in models:
            entry: dict[str, Any] = {"path": str(path), self.success: False}
            try:
                result, line = look(path)
            except ModelError as error:
                self.errors += error.diagnostics
                self.code = max(self.code, MODEL_ERRORS)
            except UsageError as error:
                report_usage(error, json=False)
                entry["message"] = str(error)
                self.refused.append({**usage_entry(error, str(path)), "length": None})
                self.code = WRONG_USAGE
            else:
                entry |= result
                if line and self.chatty:
                    print(f"{visible(str(path))}: {line}")
            self.entries.append(entry)

    def add(self, findings: Sequence[Diagnostic], ignored: Sequence[Ignored]) -> list[Diagnostic]:
        """Add findings; return those that text shows."""
        self.findings += findings
        self.ignored += ignored
        warnings = [finding for finding in findings if finding.severity == "warning"]
        self.code = max(self.code, MODEL_ERRORS * bool(warnings))
        return list(findings) if self.notes else warnings

    def finish(self) -> None:
        """Print everything, errors as text to standard error, all else to standard output; exit."""
        {"json": self._json, "sarif": self._sarif, "github": self._github, "text": self._text}[self.format]()
        raise Exit(self.code)

    def _text(self) -> None:
        if self.errors:
            print_errors(self.errors)
        shown = [finding for finding in self.findings if self.notes or finding.severity == "warning"]
        if shown:
            print("\n\n".join(map(render, shown)))
            print(f"\n{counted(len(shown), 'finding')}")
        hidden = [finding.code for finding in self.findings if finding.severity == "note" and not self.notes]
        if hidden and self.chatty:
            about = " on the mathematics" if all(code.startswith("HS5") for code in hidden) else ""
            print(f"{counted(len(hidden), 'note')}{about}: hsdsl lint --notes")

    def _json(self) -> None:
        errors = [*map(measured, self.errors), *self.refused]
        content: dict[str, Any] = {"models": self.entries, "errors": errors}
        if self.success == "clean":
            content["findings"] = [finding(diagnostic) for diagnostic in self.findings]
            content["ignored"] = [{**finding(i.diagnostic), "reason": i.reason} for i in self.ignored]
        print_json(content)

    def _github(self) -> None:
        for diagnostic in (*self.errors, *self.findings):
            print(as_annotation(diagnostic))

    def _sarif(self) -> None:
        from hsdsl.analysis.lint.pages import pages, titles

        ignored = [(i.diagnostic, i.reason) for i in self.ignored]
        print_json(as_sarif([*self.errors, *self.findings], ignored, titles(), pages(), __version__))
