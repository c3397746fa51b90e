"""``hsdsl validate``: say every error of model files, and run nothing."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from hsdsl.cli.console import MODEL_ERRORS, WRONG_USAGE, report_usage, say
from hsdsl.diagnose import as_json, render
from hsdsl.errors import Diagnostic, ModelError, UsageError


def validate(
    models: Annotated[list[Path], typer.Argument(help="Model files.", metavar="MODEL...")],
    json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Say only what is wrong.")] = False,
) -> None:
    """Check model files and say every error in them."""
    from hsdsl.report import dumps

    entries: list[dict[str, Any]] = []
    diagnostics: list[Diagnostic] = []
    code = 0
    for path in models:
        try:
            line = _checked(path)
        except ModelError as error:
            diagnostics += error.diagnostics
            entries.append({"path": str(path), "valid": False})
            code = max(code, MODEL_ERRORS)
        except UsageError as error:
            report_usage(error, json=False)
            entries.append({"path": str(path), "valid": False, "message": str(error)})
            code = WRONG_USAGE
        else:
            entries.append({"path": str(path), "valid": True})
            if not json and not quiet:
                print(line)
    if json:
        print(dumps({"models": entries, **as_json(diagnostics)}))
    elif diagnostics:
        say("\n\n".join(render(d) for d in diagnostics))
        say(f"\n{len(diagnostics)} error{'s' * (len(diagnostics) > 1)}")
    if code:
        raise typer.Exit(code)


def _checked(path: Path) -> str:
    from hsdsl.model import load

    model = load(path)
    model.resolve()
    modes, edges = len(model.system.modes), sum(len(mode.edges) for mode in model.system.modes)
    return f"{path}: valid, {_count(modes, 'mode')}, {_count(edges, 'transition')}"


def _count(number: int, noun: str) -> str:
    return f"{number} {noun}{'s' * (number != 1)}"
