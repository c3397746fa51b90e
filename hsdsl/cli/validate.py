"""``hsdsl validate``: say every error of model files, and run nothing."""

from __future__ import annotations

from pathlib import Path

import click
from click.exceptions import Exit

from hsdsl.cli.console import FILE
from hsdsl.cli.gathered import FORMAT, FORMATS, Format, Gathered, counted
from hsdsl.cli.limited import limited
from hsdsl.errors import ModelError, UsageError
from hsdsl.names import visible


@click.command()
@click.argument("models", nargs=-1, required=True, type=FILE, metavar="MODEL...", help="Model files.")
@click.option("--format", type=FORMAT, default="text", metavar=FORMATS, help="How to say what is wrong.")
@click.option("--json", is_flag=True, help="The same as --format json.")
@click.option("--quiet", "-q", is_flag=True, help="Say only what is wrong.")
@limited
def validate(models: tuple[Path, ...], format: Format, json: bool, quiet: bool) -> None:
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
    raise Exit(gathered.code)


def _checked(path: Path) -> str:
    from hsdsl.model import load

    model = load(path)
    model.resolve()
    modes, edges = len(model.system.modes), sum(len(mode.edges) for mode in model.system.modes)
    return f"{visible(str(path))}: valid, {counted(modes, 'mode')}, {counted(edges, 'transition')}"
