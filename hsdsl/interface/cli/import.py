"""``hsdsl import``: read a model of another tool and write it as one of this language."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from typer import Argument, Option

from hsdsl.base.errors import UsageError
from hsdsl.base.names import counted
from hsdsl.interface.cli.console import print_json, say
from hsdsl.interface.cli.options import Json, Limit, Quiet, Until, answering, option
from hsdsl.interface.cli.texts import check_target

FILE = "A model of SpaceEx or SBML (.xml)."
CFG = "The configuration of a SpaceEx model; left out, the file of the same name that ends in .cfg."
OUT = "The model's file (.yaml); left out, the model is printed."
URGENT = "SpaceEx: make a transition as soon as its guard holds, where SpaceEx may wait."


def import_(
    file: Annotated[Path, Argument(metavar="FILE", help=FILE)],
    cfg: Annotated[Path | None, option("FILE", CFG)] = None,
    out: Annotated[Path | None, option("FILE", OUT)] = None,
    force: Annotated[bool, Option("--force", help="Replace a file that is there.")] = False,
    urgent: Annotated[bool, Option("--urgent", help=URGENT)] = False,
    until: Until = None,
    json: Json = False,
    quiet: Quiet = False,
    limit: Limit = None,
) -> None:
    """Import a model of SpaceEx or SBML: write it as a model that runs, or say what cannot be kept."""
    with answering(json, None, limit):
        check_target(out, "--out", (".yaml", ".yml"))
        if out is not None and out.exists() and not force:
            raise UsageError(f"--out {out}: the file is there already", "--force replaces it")
        from hsdsl.base.atomic import replacing
        from hsdsl.interface.model import loads

        text = _imported(file, cfg, until, urgent)
        system = loads(text).system
        if out is None:
            print(text, end="")
            return
        with replacing(out) as target:
            target.write(text.encode())
        edges = sum(len(mode.edges) for mode in system.modes)
        if json:
            print_json({"file": str(out), "modes": len(system.modes), "transitions": edges})
        elif not quiet:
            say(f"wrote {out}: {counted(len(system.modes), 'mode')}, {counted(edges, 'transition')}")


def _imported(file: Path, cfg: Path | None, until: str | None, urgent: bool) -> str:
    """The text of the model in a file of one of the formats."""
    from hsdsl.interface.imports import sbml, spaceex
    from hsdsl.language.files import read_bytes
    from hsdsl.language.source.xml import read_xml

    root = read_xml(str(file), read_bytes(file), sbml.DEEPEST)
    if not sbml.is_sbml(root):
        return spaceex.imported(file, cfg, until, urgent)
    if cfg is not None or urgent:
        raise UsageError(f"{'--cfg' if cfg else '--urgent'} is for models of SpaceEx, and {file} is one of SBML")
    return sbml.imported(root, until)
