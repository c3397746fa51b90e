"""``hsdsl lint``: what is legal in a model and still probably not meant."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from hsdsl.cli.console import MODEL_ERRORS, WRONG_USAGE, report_usage, say
from hsdsl.diagnose import as_json, finding, render
from hsdsl.errors import Diagnostic, ModelError, UsageError


def lint(
    models: Annotated[list[Path], typer.Argument(help="Model files.", metavar="MODEL...")],
    json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
    select: Annotated[
        str | None,
        typer.Option(help="Use these rules alone: codes, beginnings of codes, families or names.", metavar="RULE,..."),
    ] = None,
    ignore: Annotated[str | None, typer.Option(help="Do not use these rules.", metavar="RULE,...")] = None,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Say only what is found.")] = False,
) -> None:
    """Look for what is legal in a model and still probably not meant."""
    from hsdsl.lint import Ignored, Selection, configured
    from hsdsl.lint import lint as look
    from hsdsl.report import dumps

    errors: list[Diagnostic] = []
    findings: list[Diagnostic] = []
    ignored: list[Ignored] = []
    entries: list[dict[str, Any]] = []
    code = 0
    for path in models:
        try:
            given = {"select": _parts(select), "ignore": _parts(ignore)}
            asked = {**configured(path), **{key: parts for key, parts in given.items() if parts is not None}}
            report = look(path, Selection.of(**asked))
        except ModelError as error:
            errors += error.diagnostics
            entries.append({"path": str(path), "clean": False})
            code = max(code, MODEL_ERRORS)
        except UsageError as error:
            report_usage(error, json=False)
            entries.append({"path": str(path), "clean": False, "message": str(error)})
            code = WRONG_USAGE
        else:
            findings += report.findings
            ignored += report.ignored
            entries.append({"path": str(path), "clean": not report.findings})
            code = max(code, MODEL_ERRORS * bool(report.findings))
    if json:
        hidden = [{**finding(i.diagnostic), "reason": i.reason} for i in ignored]
        print(dumps({"models": entries, **as_json(errors), "findings": [*map(finding, findings)], "ignored": hidden}))
    else:
        if errors:
            say("\n\n".join(map(render, errors)))
        if findings:
            print("\n\n".join(map(render, findings)))
        if not quiet:
            say(f"{len(errors)} errors, {len(findings)} findings, {len(ignored)} ignored")
    raise typer.Exit(code)


def _parts(text: str | None) -> list[str] | None:
    return None if text is None else text.split(",")
