"""``hsdsl complete``: write a model with modes for motion along guards and for sliding."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from hsdsl.base.errors import UsageError
from hsdsl.interface.cli.console import print_json, say
from hsdsl.interface.cli.options import Answer, Model, option
from hsdsl.interface.cli.texts import check_target

NOTHING = (
    "nothing to complete: no reset of a transition to the same mode keeps a state on its guard, and no two modes press "
    "on one surface"
)


def complete(
    model: Model,
    *,
    out: Annotated[Path | None, option("FILE", "Write it there (.yaml) rather than to standard output.")] = None,
    answer: Answer,
) -> None:
    """Write a model with a mode for each motion along a guard, and for each surface that two modes press on.

    A model that has neither is refused (exit code 2).
    """
    with answer.reporting():
        from hsdsl.base.atomic import replacing
        from hsdsl.interface.model import load

        check_target(out, "--out", (".yaml", ".yml"))
        if out is not None and out.exists() and model.exists() and out.samefile(model):
            raise UsageError(f"--out {out}: this is the model itself", "choose another name")
        text = load(model).completed()
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
