"""``hsdsl export``: write a model as code or as a document for another tool."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated

from typer import Option

from hsdsl.base.errors import UsageError
from hsdsl.export import TARGETS, Modes, check_folder, check_scheme, check_target, files_of, source_of, write
from hsdsl.interface.cli.console import print_json, say
from hsdsl.interface.cli.options import Answer, Experiment, Model, option
from hsdsl.interface.cli.texts import names_of

TO = f"The target: {', '.join(TARGETS)}."
OUT = "The folder for the files; left out, a target with one file of text prints it."
MODE = "What the number of the mode is in a functional mock-up unit: local, the default, an output, or left out (none)."
KEEP = "Only these states and outputs, with what they depend on."


def export(
    model: Model,
    *,
    to: Annotated[str, option("TARGET", TO, "--to", complete=lambda: list(TARGETS.items()))],
    out: Annotated[Path | None, option("DIR", OUT)] = None,
    force: Annotated[bool, Option("--force", help="Write into a folder that is not empty.")] = False,
    experiment: Experiment,
    outputs: Annotated[str | None, option("A,B", KEEP)] = None,
    mode: Annotated[Modes | None, Option(metavar="|".join(Modes.__args__), help=MODE)] = None,
    answer: Answer,
) -> None:
    """Export a model with its settings: code for other tools, or a document."""
    with answer.reporting():
        from hsdsl.interface.model import load

        check_target(to)
        if out is not None:
            check_folder(out, force)
        settings = experiment.settings()
        loaded = load(model)
        check_scheme(loaded, to, settings)
        source = source_of(loaded if outputs is None else loaded.only(names_of(outputs)), settings)
        files = files_of(source, to, mode)
        if out is None:
            name, text = only_text(files, to)
            if answer.json:
                print_json({"target": to, "name": name, "text": text})
            else:
                print(text, end="")
            return
        written = write(files, out, force)
        if answer.json:
            print_json({"target": to, "files": [str(path) for path in written]})
        elif not answer.quiet:
            say(f"wrote {written[0] if len(written) == 1 else f'{len(written)} files below {out}'}")


def only_text(files: Mapping[str, bytes], to: str) -> tuple[str, str]:
    """The name and the text of the only file of a target.

    Raises UsageError: it has several, or one that is no text.
    """
    if len(files) > 1:
        raise UsageError(f"{to} has {len(files)} files: expected --out DIR")
    ((name, content),) = files.items()
    try:
        return name, content.decode()
    except UnicodeDecodeError:
        raise UsageError(f"{name} is no text: expected --out DIR") from None
