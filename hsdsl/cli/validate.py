"""``hsdsl validate``: report every error of model files, without a run."""

from __future__ import annotations

from pathlib import Path

from typer import Exit

from hsdsl.cli.console import counted
from hsdsl.cli.diagnostic_report import DiagnosticReport
from hsdsl.cli.options import AllowPath, Formatted, Json, Limit, Models, Quiet, answering
from hsdsl.errors import ModelError, UsageError
from hsdsl.names import visible


def validate(
    models: Models,
    format: Formatted = "text",
    json: Json = False,
    quiet: Quiet = False,
    allow_path: AllowPath = None,
    limit: Limit = None,
) -> None:
    """Check model files and report every error in them."""
    report = DiagnosticReport("json" if json else format)
    with answering(json, allow_path, limit):
        for path in models:
            try:
                line = _checked(path)
            except (ModelError, UsageError) as error:
                report.add_error({"path": str(path), "valid": False}, error)
            else:
                report.add({"path": str(path), "valid": True})
                if report.format == "text" and not quiet:
                    print(line)
    report.print(lint=False)
    raise Exit(report.code)


def _checked(path: Path) -> str:
    from hsdsl.model import load

    model = load(path)
    model.resolve()
    modes, edges = len(model.system.modes), sum(len(mode.edges) for mode in model.system.modes)
    return f"{visible(str(path))}: valid, {counted(modes, 'mode')}, {counted(edges, 'transition')}"
