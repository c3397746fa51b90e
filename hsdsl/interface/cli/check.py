"""``hsdsl validate``, ``lint`` and ``explain``: errors and findings of models, and their pages."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from typer import Argument, Exit, Option

import hsdsl
from hsdsl import __version__
from hsdsl.base.errors import Diagnostic, ModelError, UsageError
from hsdsl.base.names import counted, did_you_mean, visible
from hsdsl.base.parts import written_edges, written_modes
from hsdsl.interface.cli.console import (
    MODEL_ERRORS,
    WRONG_USAGE,
    errors_reported,
    print_errors,
    print_json,
    report_usage,
    usage_entry,
)
from hsdsl.interface.cli.options import Answer, Format, Formatted, Json, Models, codes, option, rule_codes
from hsdsl.language.diagnose import as_annotation, as_sarif, finding, measured, render

if TYPE_CHECKING:
    from hsdsl.analysis.lint import Ignored


def validate(models: Models, *, format: Formatted = "text", answer: Answer) -> None:
    """Check model files and report every error in them."""
    report = DiagnosticReport("json" if answer.json else format, answer.quiet, "valid")
    with answer.reporting():
        report.examine(models, _size)
    report.finish()


def _size(path: Path) -> tuple[dict[str, Any], str]:
    model = hsdsl.load(path)
    model.resolve()
    modes, parts = written_modes(model.system.modes), len(model.system.parts)
    edges = sum(len(written_edges(mode.edges)) for mode in modes)
    size = counted(parts, "part") if parts else counted(len(modes), "mode")
    return {"valid": True}, f"valid, {size}, {counted(edges, 'transition')}"


SELECT = "Use only these rules: codes, beginnings of codes, families or names."
IGNORE = "Do not use these rules."


def lint(
    models: Models,
    *,
    format: Formatted = "text",
    select: Annotated[str | None, option("RULE,...", SELECT, complete=rule_codes)] = None,
    ignore: Annotated[str | None, option("RULE,...", IGNORE, complete=rule_codes)] = None,
    notes: Annotated[bool, Option("--notes", help="Show notes in full, as --select always does.")] = False,
    fix: Annotated[bool, Option("--fix", help="Apply the remedies that keep the model's meaning.")] = False,
    answer: Answer,
) -> None:
    """Find what is legal in a model but suspicious."""
    from hsdsl.analysis.lint import configured, selected
    from hsdsl.analysis.lint import lint as findings_of
    from hsdsl.analysis.lint.fix import fix as remedy

    report = DiagnosticReport(
        "json" if answer.json else format, answer.quiet, "clean", notes=notes or select is not None
    )
    options = {key: text.split(",") for key, text in (("select", select), ("ignore", ignore)) if text is not None}

    def look(path: Path) -> tuple[dict[str, Any], str]:
        selection = selected(**{**configured(path), **options})
        result, remedied = remedy(path, selection) if fix else (findings_of(path, selection), 0)
        shown = report.add(result.findings, result.ignored)
        parts = [f"{count} {what}" for count, what in ((remedied, "fixed"), (len(result.ignored), "ignored")) if count]
        verdict = counted(len(shown), "finding") if shown else "clean"
        line = ", ".join([verdict, *parts]) if parts or not shown else ""
        return {"clean": not result.findings, "fixed": remedied}, line

    with answer.reporting():
        report.examine(models, look)
    report.finish()


CODE = "A code such as HS111, or the name of a lint rule."


def explain(
    code: Annotated[str, Argument(metavar="CODE", help=CODE, autocompletion=codes)], json: Json = False
) -> None:
    """Explain an error, a warning of a run or a finding: its meaning, its reason, and what to write instead."""
    from hsdsl.analysis.lint import RULES
    from hsdsl.analysis.lint.pages import pages, titles

    with errors_reported(json):
        by_name = {rule.name: code for code, rule in RULES.items()}
        known = by_name.get(code.lower(), code.upper())
        if known not in titles():
            raise UsageError(f"there is no code '{code}'", did_you_mean(known, [*titles(), *by_name]))
        name = RULES[known].name if known in RULES else None
        if json:
            print_json({"code": known, "name": name, "title": titles()[known], "page": pages()[known]})
        else:
            print(f"{known} {name or ''}".strip() + "\n\n" + pages()[known])


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
        if self.format == "json":
            errors = [*map(measured, self.errors), *self.refused]
            content: dict[str, Any] = {"models": self.entries, "errors": errors}
            if self.success == "clean":
                content["findings"] = [finding(diagnostic) for diagnostic in self.findings]
                content["ignored"] = [{**finding(i.diagnostic), "reason": i.reason} for i in self.ignored]
            print_json(content)
        elif self.format == "sarif":
            from hsdsl.analysis.lint.pages import pages, titles

            ignored = [(i.diagnostic, i.reason) for i in self.ignored]
            print_json(as_sarif([*self.errors, *self.findings], ignored, titles(), pages(), __version__))
        elif self.format == "github":
            for diagnostic in (*self.errors, *self.findings):
                print(as_annotation(diagnostic))
        else:
            self._text()
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
