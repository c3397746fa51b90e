"""``hsdsl lint``: findings in models that are legal but suspicious."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

from typer import Option

from hsdsl.base.names import counted
from hsdsl.interface.cli.completion import rule_codes
from hsdsl.interface.cli.diagnostic_report import DiagnosticReport
from hsdsl.interface.cli.options import Answer, Formatted, Models, option

SELECT = "Use these rules alone: codes, beginnings of codes, families or names."
IGNORE = "Do not use these rules."


def lint(
    models: Models,
    *,
    format: Formatted = "text",
    select: Annotated[str | None, option("RULE,...", SELECT, complete=rule_codes)] = None,
    ignore: Annotated[str | None, option("RULE,...", IGNORE, complete=rule_codes)] = None,
    notes: Annotated[bool, Option("--notes", help="Show notes in full; with --select they always are.")] = False,
    fix: Annotated[bool, Option("--fix", help="Remedy in the files what can be remedied safely.")] = False,
    answer: Answer,
) -> None:
    """Look for what is legal in a model but suspicious."""
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
