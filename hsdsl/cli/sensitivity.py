"""``hsdsl sensitivity``: derivatives of a run by parameters and initial states."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from typer import Option

from hsdsl.cli.completion import override_names
from hsdsl.cli.console import print_json, progress, say
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

if TYPE_CHECKING:
    from hsdsl.orbits.sampling import OrbitalStability

SET = "Override a parameter, an initial value or a setting, as `hsdsl run` does. May be repeated."
WRT = "Parameters by name and initial states as initial.NAME, with commas between them."
AT = "Only the derivatives of the end, of transition times, or of states and outputs at the run's samples."
STABILITY = "Run from nearby as well, and tell whether the execution is orbitally stable, as far as was sampled."
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
    stability: Annotated[bool, Option("--stability", help=STABILITY)] = False,
    plot: Annotated[Path | None, option("FILE", "Draw the distances of --stability: .png or .svg.")] = None,
    json: Json = False,
    quiet: Quiet = False,
    allow_path: AllowPath = None,
    limit: Limit = None,
) -> None:
    """Differentiate a run by parameters and initial states, through its jumps."""
    with answering(json, allow_path, limit):
        check_target(plot, "--plot", (".png", ".svg"))
        if plot is not None and not stability:
            raise UsageError("--plot draws the distances of runs from nearby", "add --stability")
        from hsdsl.model import load
        from hsdsl.sensitivity.words import ALWAYS, as_json, summary

        parameters, initial, settings = split(overrides)
        call: dict[str, Any] = {"until": until, "method": method and str(method), "tolerance": tolerance}
        call |= {"engine": engine, "precision": precision}
        call |= {"parameters": parameters, "initial": initial, "settings": settings}
        loaded = load(model)
        found = loaded.sensitivity(wrt, **call)
        parts = (at,) if at else ALWAYS
        nearby = _nearby(loaded, wrt, call, quiet or json) if stability else None
        if nearby is not None and plot is not None:
            nearby.plot(plot)
            say(f"wrote {plot}")
        if json:
            print_json(as_json(found, parts) | ({"orbital_stability": nearby.as_json()} if nearby else {}))
        elif not quiet:
            print(summary(found, parts) + (f"\n\n{nearby.sentence}" if nearby else ""))


def _nearby(model: Any, wrt: str, call: dict[str, Any], hidden: bool) -> OrbitalStability:
    del call["precision"]
    with progress(hidden) as show:

        def tell(done: int, total: int) -> None:
            if show:
                show(lambda: f"{done} of {total} runs from nearby")

        return model.orbital_stability(wrt, progress=tell, **call)
