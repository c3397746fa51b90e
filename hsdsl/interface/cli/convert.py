"""``hsdsl export``, ``import``, ``complete`` and ``schema``: models written for other tools, or read from them."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from typer import Argument, Option

import hsdsl
from hsdsl.base.errors import ModelError, UsageError
from hsdsl.base.names import counted
from hsdsl.base.parts import written_edges, written_modes
from hsdsl.export import ABOUT, Modes, check_folder, check_scheme, files_of, source_of, write
from hsdsl.export import check_target as check_known
from hsdsl.interface.cli.console import print_json, say
from hsdsl.interface.cli.options import (
    Answer,
    Experiment,
    Json,
    Limit,
    Model,
    Quiet,
    Until,
    answering,
    check_target,
    names_of,
    option,
)

if TYPE_CHECKING:
    from hsdsl.language.system import HybridSystem

TO = f"The target: {', '.join(ABOUT)}, or that of a plug-in."
FOLDER = "The folder for the files. Without it, a target that has one text file prints it."
MODE = "The number of the mode in a functional mock-up unit: a local variable (default), an output, or none."
KEEP = "Keep only these states and outputs, and what they depend on."


def export(
    model: Model,
    *,
    to: Annotated[str, option("TARGET", TO, "--to", complete=lambda: list(ABOUT.items()))],
    out: Annotated[Path | None, option("DIR", FOLDER)] = None,
    force: Annotated[bool, Option("--force", help="Write into a folder that is not empty.")] = False,
    experiment: Experiment,
    outputs: Annotated[str | None, option("A,B", KEEP)] = None,
    mode: Annotated[Modes | None, Option(metavar="|".join(Modes.__args__), help=MODE)] = None,
    answer: Answer,
) -> None:
    """Export a model with its settings: code for other tools, or a document."""
    with answer.reporting():
        check_known(to)
        if out is not None:
            check_folder(out, force)
        settings = experiment.settings()
        loaded = hsdsl.load(model)
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
        raise UsageError(f"{name} is not a text file: expected --out DIR") from None


FILE = "A model of SpaceEx or SBML (.xml)."
CFG = "The configuration of a SpaceEx model. Default: the file of the same name that ends in .cfg."
WRITTEN_TO = "The model's file (.yaml). Without it, the model is printed."
URGENT = "SpaceEx: make a transition as soon as its guard holds, where SpaceEx may wait."


AT = (
    "SpaceEx: a point of an initial set, centre, lower, upper or NAME=VALUE. May be repeated. Without it an initial "
    "box is kept: a run takes its centre, a sweep draws from it."
)


SEED = "SBML: draws the order of simultaneous events of equal priority, 1 to 2147483646."


def import_(
    file: Annotated[Path, Argument(metavar="FILE", help=FILE)],
    cfg: Annotated[Path | None, option("FILE", CFG)] = None,
    out: Annotated[Path | None, option("FILE", WRITTEN_TO)] = None,
    force: Annotated[bool, Option("--force", help="Replace an existing file.")] = False,
    urgent: Annotated[bool, Option("--urgent", help=URGENT)] = False,
    at: Annotated[list[str] | None, option("POINT", AT)] = None,
    seed: Annotated[int | None, option("N", SEED)] = None,
    until: Until = None,
    json: Json = False,
    quiet: Quiet = False,
    limit: Limit = None,
) -> None:
    """Import a model of SpaceEx or SBML: write a model that runs, or name what this language lacks."""
    with answering(json, None, limit):
        check_target(out, "--out", (".yaml", ".yml"))
        if out is not None and out.exists() and not force:
            raise UsageError(f"--out {out}: the file already exists", "--force replaces it")
        from hsdsl.base.atomic import replacing

        text, system = _imported(file, cfg, until, urgent, at or [], seed)
        if out is None:
            print(text, end="")
            return
        with replacing(out) as target:
            target.write(text.encode())
        modes = written_modes(system.modes)
        edges = sum(len(written_edges(mode.edges)) for mode in modes)
        if json:
            print_json({"file": str(out), "modes": len(modes), "transitions": edges})
        elif not quiet:
            say(f"wrote {out}: {counted(len(modes), 'mode')}, {counted(edges, 'transition')}")


def _imported(
    file: Path, cfg: Path | None, until: str | None, urgent: bool, at: list[str], seed: int | None
) -> tuple[str, HybridSystem]:
    """The text of the model in a file of one of the formats, and its mathematics."""
    from hsdsl.interface.imports import sbml, spaceex
    from hsdsl.interface.model import loads
    from hsdsl.language.files import read_bytes
    from hsdsl.language.source.xml import read_xml

    root = read_xml(str(file), read_bytes(file), sbml.DEEPEST)
    if not sbml.is_sbml(root):
        if seed is not None:
            raise UsageError(f"--seed applies to SBML models, and {file} is a SpaceEx model")
        text = spaceex.imported(file, cfg, until, urgent, at)
        return text, loads(text).system
    given = [name for name, value in (("--cfg", cfg), ("--urgent", urgent), ("--at", at)) if value]
    if given:
        raise UsageError(f"{given[0]} applies to SpaceEx models, and {file} is an SBML model")
    seed = 1 if seed is None else seed
    try:
        text = sbml.imported(
            root, until or "1", seed=seed
        )  # any end, so that errors of the file are found without one as well
        try:
            system = loads(text).system
        except ModelError as error:
            raise sbml.placed(error, text, root) from None
    except ModelError as error:
        end = root.fault("HS202", "the end of the run is not given", "SBML does not say it: give --until")
        raise ModelError([*error.diagnostics, *([] if until else [end])]) from None
    return (text if until else sbml.imported(root, seed=seed)), system


NOTHING = (
    "nothing to complete: no reset of a transition to the same mode keeps a state on its guard, and no two modes press "
    "on one surface"
)


def complete(
    model: Model,
    *,
    out: Annotated[Path | None, option("FILE", "Write the model to this file (.yaml), not to standard output.")] = None,
    answer: Answer,
) -> None:
    """Write a model with a mode for each motion along a guard, and for each surface on which two modes slide.

    A model that has neither is refused (exit code 2).
    """
    with answer.reporting():
        from hsdsl.base.atomic import replacing

        check_target(out, "--out", (".yaml", ".yml"))
        if out is not None and out.exists() and model.exists() and out.samefile(model):
            raise UsageError(f"--out {out}: this is the model itself", "choose another name")
        text = hsdsl.load(model).completed()
        if text is None:
            raise UsageError(NOTHING)
        if out is not None:
            with replacing(out) as file:
                file.write(text.encode())
        if answer.json:
            print_json({"model": str(model)} | ({"text": text} if out is None else {"files": [str(out)]}))
        elif out is None:
            print(text, end="")
        elif not answer.quiet:
            say(f"wrote {out}")


def schema(json: Json = False) -> None:
    """Print the JSON Schema (draft 7) of the language, one JSON object."""
    from json import dumps

    from hsdsl.language.schema.jsonschema import json_schema

    print(dumps(json_schema(), indent=2))
