"""``hsdsl sensitivity``: derivatives of a run by parameters and initial states."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from typer import Option

from hsdsl.base.errors import UsageError
from hsdsl.interface.cli.console import draw, progress
from hsdsl.interface.cli.options import AS_RUN, WRT, Answer, Located, Model, Until, option, overriding
from hsdsl.interface.cli.texts import check_target

if TYPE_CHECKING:
    from hsdsl.analysis.orbits.sampling import OrbitalStability

AT = "Only the derivatives of the end, of transition times, or of states and outputs at the run's samples."
STABILITY = "Run from nearby as well, and tell whether the execution is orbitally stable, as far as was sampled."
At = Literal["final", "transitions", "outputs"]


def sensitivity(
    model: Model,
    *,
    wrt: Annotated[str, option("A,B", WRT)],
    part: Annotated[At | None, option("final|transitions|outputs", AT, "--at")] = None,
    overrides: Annotated[list[str] | None, overriding(AS_RUN)] = None,
    until: Until = None,
    located: Located,
    precision: Annotated[int | None, option("DIGITS", "Compute with this many decimal digits (mpmath).")] = None,
    stability: Annotated[bool, Option("--stability", help=STABILITY)] = False,
    plot: Annotated[Path | None, option("FILE", "Draw the distances of --stability: .png or .svg.")] = None,
    answer: Answer,
) -> None:
    """Differentiate a run by parameters and initial states, through its jumps."""
    with answer.reporting():
        check_target(plot, "--plot")
        if plot is not None and not stability:
            raise UsageError("--plot draws the distances of runs from nearby", "add --stability")
        from hsdsl.analysis.sensitivity.result import ALWAYS, as_json, summary
        from hsdsl.interface.model import load

        call = located.settings(overrides, until=until, precision=precision)
        loaded = load(model)
        found = loaded.sensitivity(wrt, **call)
        parts = (part,) if part else ALWAYS
        nearby = _nearby(loaded, wrt, call, answer.hidden) if stability else None
        if nearby is not None:
            draw(nearby, plot)
        answer.give(
            lambda: as_json(found, parts) | ({"orbital_stability": nearby.as_json()} if nearby else {}),
            lambda: summary(found, parts) + (f"\n\n{nearby.sentence}" if nearby else ""),
        )


def _nearby(model: Any, wrt: str, call: dict[str, Any], hidden: bool) -> OrbitalStability:
    del call["precision"]
    with progress(hidden) as show:

        def tell(done: int, total: int) -> None:
            if show:
                show(lambda: f"{done} of {total} runs from nearby")

        return model.orbital_stability(wrt, progress=tell, **call)
