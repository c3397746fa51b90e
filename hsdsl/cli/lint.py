"""``hsdsl lint``: findings in models that are legal but suspicious."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from typer import Exit, Option

from hsdsl.cli.completion import rule_codes
from hsdsl.cli.console import counted
from hsdsl.cli.diagnostic_report import DiagnosticReport
from hsdsl.cli.options import AllowPath, Formatted, Json, Limit, Models, Quiet, answering
from hsdsl.errors import ModelError, UsageError
from hsdsl.names import visible

if TYPE_CHECKING:
    from hsdsl.lint import Report, Selection

SELECT = "Use these rules alone: codes, beginnings of codes, families or names."


def lint(
    models: Models,
    format: Formatted = "text",
    json: Json = False,
    select: Annotated[str | None, Option(metavar="RULE,...", help=SELECT, autocompletion=rule_codes)] = None,
    ignore: Annotated[
        str | None, Option(metavar="RULE,...", help="Do not use these rules.", autocompletion=rule_codes)
    ] = None,
    notes: Annotated[bool, Option("--notes", help="Show notes in full; with --select they always are.")] = False,
    fix: Annotated[bool, Option("--fix", help="Remedy in the files what can be remedied safely.")] = False,
    quiet: Quiet = False,
    allow_path: AllowPath = None,
    limit: Limit = None,
) -> None:
    """Look for what is legal in a model but suspicious."""
    report = DiagnosticReport("json" if json else format, notes=notes or select is not None)
    with answering(json, allow_path, limit):
        for path in models:
            try:
                result, remedied = _lint(path, _selection(path, select, ignore), fix)
            except (ModelError, UsageError) as error:
                report.add_error({"path": str(path), "clean": False}, error)
            else:
                entry = {"path": str(path), "clean": not result.findings, "fixed": remedied}
                report.add(entry, result.findings, result.ignored)
                if report.format == "text" and not quiet:
                    _sum_up(path, result, remedied, report.notes)
    report.print(lint=True)
    if report.format == "text" and not quiet:
        report.count_hidden()
    raise Exit(report.code)


def _selection(path: Path, select: str | None, ignore: str | None) -> Selection:
    """The rules for a model: options take precedence over the configuration."""
    from hsdsl.lint import Selection, configured

    given = {key: text.split(",") for key, text in (("select", select), ("ignore", ignore)) if text is not None}
    return Selection.of(**{**configured(path), **given})


def _lint(path: Path, selection: Selection, fix: bool) -> tuple[Report, int]:
    if fix:
        from hsdsl.lint.fix import fix as remedy

        return remedy(path, selection)
    from hsdsl.lint import lint as look

    return look(path, selection), 0


def _sum_up(path: Path, report: Report, remedied: int, notes: bool) -> None:
    """Print a line about a model without findings to show, or with something remedied or ignored."""
    shown = [finding for finding in report.findings if notes or finding.severity == "warning"]
    parts = [f"{remedied} fixed"] * bool(remedied) + [f"{len(report.ignored)} ignored"] * bool(report.ignored)
    verdict = counted(len(shown), "finding") if shown else "clean"
    if parts or not shown:
        print(", ".join([f"{visible(str(path))}: {verdict}", *parts]))
