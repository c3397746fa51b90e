"""``hsdsl complete``: write a model with modes for motion along guards and for sliding."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from hsdsl.cli.console import say
from hsdsl.cli.options import AllowPath, Limit, Model, answering, option
from hsdsl.cli.texts import check_target
from hsdsl.errors import UsageError

NOTHING = (
    "nothing to complete: no reset of a transition to the same mode keeps a state on its guard, and no two modes press "
    "on one surface"
)


def complete(
    model: Model,
    out: Annotated[Path | None, option("FILE", "Write it there (.yaml) rather than to standard output.")] = None,
    allow_path: AllowPath = None,
    limit: Limit = None,
) -> None:
    """Write a model with a mode for each motion along a guard, and for each surface that two modes press on."""
    with answering(False, allow_path, limit):
        from hsdsl.model import load
        from hsdsl.store.atomic import replacing

        check_target(out, "--out", (".yaml", ".yml"))
        if out is not None and out.exists() and model.exists() and out.samefile(model):
            raise UsageError(f"--out {out}: this is the model itself", "choose another name")
        text = load(model).completed()
        if text is None:
            raise UsageError(NOTHING)
        if out is None:
            print(text, end="")
            return
        with replacing(out) as file:
            file.write(text.encode())
        say(f"wrote {out}")
