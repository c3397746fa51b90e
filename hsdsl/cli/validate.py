"""``hsdsl validate``: say every error of model files, and run nothing."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from hsdsl.cli.gathered import Format, Gathered, counted
from hsdsl.errors import ModelError, UsageError


def validate(
    models: Annotated[list[Path], typer.Argument(help="Model files.", metavar="MODEL...")],
    format: Annotated[
        Format, typer.Option(help="How to say what is wrong.", metavar="text|json|sarif|github")
    ] = Format.text,
    json: Annotated[bool, typer.Option("--json", help="The same as --format json.")] = False,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Say only what is wrong.")] = False,
) -> None:
    """Check model files and say every error in them."""
    gathered = Gathered()
    format = Format.json if json else format
    for path in models:
        try:
            line = _checked(path)
        except (ModelError, UsageError) as error:
            gathered.wrong({"path": str(path), "valid": False}, error)
        else:
            gathered.looked({"path": str(path), "valid": True}, (), ())
            if format is Format.text and not quiet:
                print(line)
    gathered.say(format, lint=False)
    raise typer.Exit(gathered.code)


def _checked(path: Path) -> str:
    from hsdsl.model import load

    model = load(path)
    model.resolve()
    modes, edges = len(model.system.modes), sum(len(mode.edges) for mode in model.system.modes)
    return f"{path}: valid, {counted(modes, 'mode')}, {counted(edges, 'transition')}"
