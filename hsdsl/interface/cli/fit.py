"""``hsdsl fit``: parameters and initial states from measurements."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Annotated, Any

from typer import Argument, Exit

from hsdsl.base.errors import UsageError
from hsdsl.base.numbers.decimals import number_of
from hsdsl.interface.cli.console import draw, progress
from hsdsl.interface.cli.options import WRT, Answer, Located, Model, option, overriding
from hsdsl.interface.cli.texts import check_target

SET = "Override a parameter, an initial value or a setting, as `hsdsl run` does; for a name in --wrt the first value."
SIGMA = "The standard deviation of a column's measurements. Give all or none; may be repeated."
WEIGHT = "The weight of a column; left out, one over its largest size. May be repeated."
Data = Annotated[Path, Argument(metavar="DATA", help="A CSV file: t or time, and states and outputs.")]


def fit(
    model: Model,
    data: Data,
    *,
    wrt: Annotated[str, option("A,B", WRT)],
    sigma: Annotated[list[str] | None, option("NAME=S", SIGMA, "--sigma")] = None,
    weight: Annotated[list[str] | None, option("NAME=W", WEIGHT, "--weight")] = None,
    overrides: Annotated[list[str] | None, overriding(SET)] = None,
    located: Located,
    plot: Annotated[Path | None, option("FILE", "Draw measurements and run: .png or .svg.")] = None,
    answer: Answer,
) -> None:
    """Fit parameters and initial states to measurements."""
    with answer.reporting():
        check_target(plot, "--plot")
        from hsdsl.interface.model import load

        with progress(answer.hidden) as show:
            watch = show and partial(_watch, show)
            columns = {"sigma": _numbers("--sigma", sigma), "weights": _numbers("--weight", weight)}
            found = load(model).fit(data, wrt, progress=watch, **columns, **located.settings(overrides))
        draw(found, plot)
        answer.give(found.as_json, lambda: found.summary)
    if not found.success:
        raise Exit(3)


def _watch(show: Any, runs: int, values: Mapping[str, float], total: float) -> None:
    listed = ", ".join(f"{name} = {value:.6g}" for name, value in values.items())
    show(lambda: f"{runs} runs, sum of squares {total:.4g}, {listed}")


def _numbers(name: str, pairs: list[str] | None) -> dict[str, float] | float | None:
    """Read NAME=NUMBER, or the number of the only column."""
    found: dict[str, float] = {}
    for pair in pairs or ():
        if len(pairs or ()) == 1 and (alone := number_of(pair)) is not None:
            return alone
        column, equals, value = (part.strip() for part in pair.partition("="))
        number = number_of(value)
        if not equals or not column or number is None:
            raise UsageError(f"{name}: expected NAME=NUMBER, got '{pair}'", f"for example {name} x=0.1")
        found[column] = number
    return found or None
