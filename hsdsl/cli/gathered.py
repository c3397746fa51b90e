"""What `validate` and `lint` have to say of several models, said in one of four formats."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import StrEnum
from typing import TYPE_CHECKING, Any

import click

from hsdsl import __version__
from hsdsl.cli.console import MODEL_ERRORS, WRONG_USAGE, report_usage, say_lines
from hsdsl.diagnose import as_annotation, as_sarif, finding, measured, render
from hsdsl.errors import Diagnostic, ModelError, UsageError

if TYPE_CHECKING:
    from hsdsl.lint import Ignored


class Format(StrEnum):
    """How to say it."""

    text = "text"
    json = "json"
    sarif = "sarif"
    github = "github"


FORMAT = click.Choice(Format)
FORMATS = "|".join(Format)


@dataclass
class Gathered:
    """What was found so far, and the exit code that follows from it."""

    entries: list[dict[str, Any]] = field(default_factory=list[dict[str, Any]])
    errors: list[Diagnostic] = field(default_factory=list[Diagnostic])
    findings: list[Diagnostic] = field(default_factory=list[Diagnostic])
    ignored: list[Ignored] = field(default_factory=list["Ignored"])
    code: int = 0
    notes: bool = True  # whether text shows notes in full

    def wrong(self, entry: dict[str, Any], error: ModelError | UsageError) -> None:
        """Take note of a model that has errors or cannot be read."""
        if isinstance(error, ModelError):
            self.errors += error.diagnostics
            self.entries.append(entry)
            self.code = max(self.code, MODEL_ERRORS)
        else:
            report_usage(error, json=False)
            self.entries.append({**entry, "message": str(error)})
            self.code = WRONG_USAGE

    def looked(self, entry: dict[str, Any], findings: tuple[Diagnostic, ...], ignored: tuple[Ignored, ...]) -> None:
        """Take note of what lint found in a model."""
        self.entries.append(entry)
        self.findings += findings
        self.ignored += ignored
        self.code = max(self.code, MODEL_ERRORS * any(found.severity == "warning" for found in findings))

    def say(self, format: Format, lint: bool) -> None:
        """Say everything: data and annotations on standard output, and text for people as it is due."""
        match format:
            case Format.json:
                self._json(lint)
            case Format.sarif:
                self._sarif()
            case Format.github:
                for diagnostic in (*self.errors, *self.findings):
                    print(as_annotation(diagnostic))
            case Format.text:
                self._text()

    def _text(self) -> None:
        if self.errors:
            say_lines("\n\n".join(map(render, self.errors)))
            say_lines(f"\n{counted(len(self.errors), 'error')}")
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
        from hsdsl.report import dumps

        said: dict[str, Any] = {"models": self.entries, "errors": [measured(error) for error in self.errors]}
        if lint:
            said["findings"] = [finding(diagnostic) for diagnostic in self.findings]
            said["ignored"] = [{**finding(i.diagnostic), "reason": i.reason} for i in self.ignored]
        print(dumps(said))

    def _sarif(self) -> None:
        from hsdsl.lint.pages import pages, titles
        from hsdsl.report import dumps

        ignored = [(i.diagnostic, i.reason) for i in self.ignored]
        print(dumps(as_sarif([*self.errors, *self.findings], ignored, titles(), pages(), __version__)))


def counted(number: int, noun: str) -> str:
    """A number with its noun."""
    return f"{number} {noun}{'s' * (number != 1)}"
