"""``hsdsl lint``: what is legal in a model and still probably not meant."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click
from click.exceptions import Exit

from hsdsl.cli.console import FILE
from hsdsl.cli.gathered import FORMAT, FORMATS, Format, Gathered, counted
from hsdsl.cli.limited import limited
from hsdsl.errors import ModelError, UsageError
from hsdsl.names import visible

if TYPE_CHECKING:
    from hsdsl.lint import Report, Selection


@click.command()
@click.argument("models", nargs=-1, required=True, type=FILE, metavar="MODEL...", help="Model files.")
@click.option("--format", type=FORMAT, default="text", metavar=FORMATS, help="How to say what is found.")
@click.option("--json", is_flag=True, help="The same as --format json.")
@click.option(
    "--select", metavar="RULE,...", help="Use these rules alone: codes, beginnings of codes, families or names."
)
@click.option("--ignore", metavar="RULE,...", help="Do not use these rules.")
@click.option("--notes", is_flag=True, help="Show notes in full; with --select they always are.")
@click.option("--fix", is_flag=True, help="Remedy in the files what can be remedied safely.")
@click.option("--quiet", "-q", is_flag=True, help="Say only what is found.")
@limited
def lint(
    models: tuple[Path, ...],
    format: Format,
    json: bool,
    select: str | None,
    ignore: str | None,
    notes: bool,
    fix: bool,
    quiet: bool,
) -> None:
    """Look for what is legal in a model and still probably not meant."""
    gathered = Gathered(notes=notes or select is not None)
    format = Format.json if json else format
    for path in models:
        try:
            report, remedied = _look(path, _selection(path, select, ignore), fix)
        except (ModelError, UsageError) as error:
            gathered.wrong({"path": str(path), "clean": False}, error)
        else:
            entry = {"path": str(path), "clean": not report.findings, "fixed": remedied}
            gathered.looked(entry, report.findings, report.ignored)
            if format is Format.text and not quiet:
                _sum_up(path, report, remedied, gathered.notes)
    gathered.say(format, lint=True)
    if format is Format.text and not quiet:
        gathered.count_hidden()
    raise Exit(gathered.code)


def _selection(path: Path, select: str | None, ignore: str | None) -> Selection:
    """The rules for a model: what an option says counts before what the configuration says."""
    from hsdsl.lint import Selection, configured

    given = {key: text.split(",") for key, text in (("select", select), ("ignore", ignore)) if text is not None}
    return Selection.of(**{**configured(path), **given})


def _look(path: Path, selection: Selection, fix: bool) -> tuple[Report, int]:
    if fix:
        from hsdsl.lint.fix import fix as remedy

        return remedy(path, selection)
    from hsdsl.lint import lint as look

    return look(path, selection), 0


def _sum_up(path: Path, report: Report, remedied: int, notes: bool) -> None:
    """Say in a line what became of a model without findings to show, or with something remedied or ignored."""
    shown = [finding for finding in report.findings if notes or finding.severity == "warning"]
    parts = [f"{remedied} fixed"] * bool(remedied) + [f"{len(report.ignored)} ignored"] * bool(report.ignored)
    found = counted(len(shown), "finding") if shown else "clean"
    if parts or not shown:
        print(", ".join([f"{visible(str(path))}: {found}", *parts]))
