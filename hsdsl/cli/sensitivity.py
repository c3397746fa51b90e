"""``hsdsl sensitivity``: derivatives of a run by parameters and initial states."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from hsdsl.cli.completion import override_names
from hsdsl.cli.console import print_json
from hsdsl.cli.options import AllowPath, Engine, Json, Limit, Method, Model, Quiet, answering, option, split

SET = "Override a parameter, an initial value or a setting, as `hsdsl run` does. May be repeated."
WRT = "Parameters by name and initial states as initial.NAME, with commas between them."
AT = "Only the derivatives of the end, of transition times, or of states and outputs at the run's samples."
At = Literal["final", "transitions", "outputs"]


def sensitivity(
    model: Model,
    wrt: Annotated[str, option("A,B", WRT)],
    at: Annotated[At | None, option("final|transitions|outputs", AT)] = None,
    overrides: Annotated[list[str] | None, option("NAME=VALUE", SET, "--set", complete=override_names)] = None,
    until: Annotated[str | None, option("T", "End of the run.")] = None,
    method: Annotated[Method | None, option("M", "An adaptive method, or auto.")] = None,
    tolerance: Annotated[str | None, option("TOL", "Bound on the local error, relative to the scales.")] = None,
    engine: Annotated[Engine, option("ENGINE", "auto, c or python.")] = "auto",
    precision: Annotated[int | None, option("DIGITS", "Compute with this many decimal digits (mpmath).")] = None,
    json: Json = False,
    quiet: Quiet = False,
    allow_path: AllowPath = None,
    limit: Limit = None,
) -> None:
    """Differentiate a run by parameters and initial states, through its jumps."""
    with answering(json, allow_path, limit):
        from hsdsl.model import load
        from hsdsl.sensitivity.words import ALWAYS, as_json, summary

        parameters, initial, settings = split(overrides)
        call: dict[str, Any] = {"until": until, "method": method and str(method), "tolerance": tolerance}
        call |= {"engine": engine, "precision": precision}
        call |= {"parameters": parameters, "initial": initial, "settings": settings}
        found = load(model).sensitivity(wrt, **call)
        parts = (at,) if at else ALWAYS
        if json:
            print_json(as_json(found, parts))
        elif not quiet:
            print(summary(found, parts))
