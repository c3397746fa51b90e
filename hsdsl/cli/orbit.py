"""``hsdsl orbit``: a periodic orbit by shooting on a section, and its Floquet multipliers."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

from hsdsl.cli.completion import override_names
from hsdsl.cli.console import print_json, say
from hsdsl.cli.options import (
    AllowPath,
    Engine,
    Json,
    Limit,
    Method,
    Model,
    Quiet,
    answering,
    check_target,
    option,
    split,
)
from hsdsl.errors import UsageError

SET = "Override a parameter, an initial value or a setting, as `hsdsl run` does. May be repeated."
SECTION = "The transition that the orbit is cut at, by its name."
LAPS = "How many transitions of the section close the orbit."
FOLLOW = "Follow the orbit in a parameter from A to B, and mark folds, flips and grazing."
PERIOD = "The period of the forcing, an expression of parameters; left out, that of sines and cosines of t."


def orbit(
    model: Model,
    section: Annotated[str, option("EDGE", SECTION)],
    laps: Annotated[int, option("N", LAPS)] = 1,
    period: Annotated[str | None, option("T", PERIOD)] = None,
    follow: Annotated[str | None, option("PARAM=A:B", FOLLOW, "--continue")] = None,
    overrides: Annotated[list[str] | None, option("NAME=VALUE", SET, "--set", complete=override_names)] = None,
    until: Annotated[str | None, option("T", "End of the run that the first guess is from.")] = None,
    method: Annotated[Method | None, option("M", "An adaptive method, or auto.")] = None,
    tolerance: Annotated[str | None, option("TOL", "Bound on the local error, relative to the scales.")] = None,
    engine: Annotated[Engine, option("ENGINE", "auto, c or python.")] = "auto",
    plot: Annotated[Path | None, option("FILE", "Draw it: .png or .svg.")] = None,
    json: Json = False,
    quiet: Quiet = False,
    allow_path: AllowPath = None,
    limit: Limit = None,
) -> None:
    """Find a periodic orbit near the model's run, with its Floquet multipliers."""
    with answering(json, allow_path, limit):
        check_target(plot, "--plot", (".png", ".svg"))
        from hsdsl.model import load

        parameters, initial, settings = split(overrides)
        call: dict[str, Any] = {"until": until, "method": method and str(method), "tolerance": tolerance}
        call |= {"engine": engine, "parameters": parameters, "initial": initial, "settings": settings}
        call |= {"laps": laps, "period": period}
        loaded = load(model)
        if follow is None:
            found = loaded.orbit(section, **call)
        else:
            found = loaded.continuation(section, *_range(follow), **call)
        if plot is not None:
            found.plot(plot)
            say(f"wrote {plot}")
        if json:
            print_json(found.as_json())
        elif not quiet:
            print(found.summary)


def _range(text: str) -> tuple[str, str, str]:
    """Read PARAM=A:B."""
    name, equals, rest = text.partition("=")
    start, colon, end = rest.partition(":")
    if not (name.strip() and equals and start.strip() and colon and end.strip()):
        raise UsageError(f"--continue: expected PARAM=A:B, got '{text}'", "for example --continue c=0.5:0.9")
    return name.strip(), start.strip(), end.strip()
