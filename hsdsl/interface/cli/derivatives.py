"""``hsdsl sensitivity``, ``orbit`` and ``fit``: what derivatives of runs answer."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from typer import Argument, Exit, Option

import hsdsl
from hsdsl.base.errors import UsageError
from hsdsl.base.numbers.decimals import number_of
from hsdsl.base.progress import counted_runs
from hsdsl.interface.cli.console import draw, progress, say
from hsdsl.interface.cli.options import (
    AS_RUN,
    WRT,
    Answer,
    Located,
    Model,
    Until,
    check_target,
    numbers_of,
    option,
    overriding,
)

if TYPE_CHECKING:
    from hsdsl.analysis.orbits.sampling import OrbitalStability


AT = "Print only the derivatives of the end, of transition times, or of states and outputs at the run's samples."
STABILITY = "Also run from nearby points, and say whether these runs show orbital stability."
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
            raise UsageError("--plot draws the distances of nearby runs", "add --stability")
        from hsdsl.analysis.sensitivity.result import ALWAYS, as_json, summary

        call = located.settings(overrides, until=until, precision=precision)
        loaded = hsdsl.load(model)
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
                show(lambda: f"{done} of {total} nearby runs")

        return model.orbital_stability(wrt, progress=tell, **call)


SECTION = "The name of the transition that is the section of the orbit."
LAPS = "Number of transitions of the section after which the orbit closes."
FOLLOW = "Follow the orbit in a parameter from A to B, and mark folds, flips and grazing."
PERIOD = "The period of the forcing, an expression of parameters. Default: that of the sines and cosines of t."
KEEP = "A quantity that the motion keeps, an expression of states or an output: find the orbit with the run's value."


def orbit(
    model: Model,
    *,
    section: Annotated[str, option("EDGE", SECTION)],
    laps: Annotated[int, option("N", LAPS)] = 1,
    period: Annotated[str | None, option("T", PERIOD)] = None,
    keep: Annotated[str | None, option("ENERGY", KEEP)] = None,
    follow: Annotated[str | None, option("PARAM=A:B", FOLLOW, "--continue")] = None,
    overrides: Annotated[list[str] | None, overriding(AS_RUN)] = None,
    until: Annotated[str | None, option("T", "End of the run that gives the initial guess.")] = None,
    located: Located,
    plot: Annotated[Path | None, option("FILE", "Draw the orbit: .png or .svg.")] = None,
    answer: Answer,
) -> None:
    """Find a periodic orbit near the model's run, with its Floquet multipliers."""
    with answer.reporting():
        check_target(plot, "--plot")
        call = located.settings(overrides, until=until, laps=laps, period=period)
        loaded = hsdsl.load(model)
        with progress(answer.hidden) as show:
            if follow is None:
                found = loaded.orbit(section, keep=keep, progress=counted_runs(show), **call)
            else:
                name, *ends = _range(follow)
                found = loaded.continuation(section, name, *ends, keep=keep, progress=counted_runs(show, name), **call)
        draw(found, plot)
        answer.give(found.as_json, lambda: found.summary)


def _range(text: str) -> tuple[str, str, str]:
    """Read PARAM=A:B."""
    name, equals, rest = text.partition("=")
    start, colon, end = rest.partition(":")
    if not (name.strip() and equals and start.strip() and colon and end.strip()):
        raise UsageError(f"--continue: expected PARAM=A:B, got '{text}'", "for example --continue c=0.5:0.9")
    return name.strip(), start.strip(), end.strip()


SET_OF_FITS = (
    "Override a parameter, an initial value or a setting, as `hsdsl run` does. For names in --wrt: the initial guess."
)
SIGMA = "The standard deviation of a column's measurements. Give all or none; may be repeated."
WEIGHT = "The weight of a column. Default: one over its largest size. May be repeated."
STARTS = "Fit from N initial guesses, and keep the best: the given one, and others within the bounds."
INTERVALS = "Find intervals of this level, such as 0.95, by profile likelihood: many further runs."
Data = Annotated[Path, Argument(metavar="DATA", help="A CSV file with columns t or time, states and outputs.")]


def fit(
    model: Model,
    data: Data,
    *,
    wrt: Annotated[str, option("A,B", WRT)],
    sigma: Annotated[list[str] | None, option("NAME=S", SIGMA, "--sigma")] = None,
    weight: Annotated[list[str] | None, option("NAME=W", WEIGHT, "--weight")] = None,
    overrides: Annotated[list[str] | None, overriding(SET_OF_FITS)] = None,
    located: Located,
    intervals: Annotated[float | None, option("LEVEL", INTERVALS)] = None,
    starts: Annotated[int, option("N", STARTS)] = 1,
    plot: Annotated[Path | None, option("FILE", "Draw measurements and run: .png or .svg.")] = None,
    residuals: Annotated[Path | None, option("FILE", "Draw the residuals: .png or .svg.")] = None,
    answer: Answer,
) -> None:
    """Fit parameters and initial states to measurements."""
    with answer.reporting():
        check_target(plot, "--plot")
        check_target(residuals, "--residuals")
        with progress(answer.hidden) as show:
            watch = show and partial(_show_fit, show)
            columns = {"sigma": _by_column("--sigma", sigma), "weights": _by_column("--weight", weight)}
            call = located.settings(overrides, intervals=intervals, starts=starts, **columns)
            found = hsdsl.load(model).fit(data, wrt, progress=watch, **call)
        draw(found, plot)
        if residuals is not None:
            found.plot_residuals(residuals)
            say(f"wrote {residuals}")
        answer.give(found.as_json, lambda: found.summary)
    if not found.success:
        raise Exit(3)


def _show_fit(show: Any, runs: int, values: Mapping[str, float], total: float) -> None:
    listed = ", ".join(f"{name} = {value:.6g}" for name, value in values.items())
    show(lambda: f"{runs} runs, sum of squares {total:.4g}, {listed}")


def _by_column(name: str, pairs: list[str] | None) -> dict[str, float] | float | None:
    """Read NAME=NUMBER, or the number of the only column."""
    alone = number_of(pairs[0]) if pairs and len(pairs) == 1 else None
    return (numbers_of(name, pairs, "x=0.1") or None) if alone is None else alone
