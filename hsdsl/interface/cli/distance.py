"""``hsdsl distance``: the distance between two states of a model, or between two runs."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Annotated, Any

from typer import Argument

from hsdsl.analysis.metrics.table import CURVE_METRICS, POINT_METRICS
from hsdsl.base.errors import UsageError
from hsdsl.interface.cli.completion import model_files
from hsdsl.interface.cli.console import Text, print_json, progress, say
from hsdsl.interface.cli.options import AllowPath, Json, Limit, Metric, answering, option, overriding, split
from hsdsl.interface.cli.saved import run_of
from hsdsl.interface.cli.texts import check_target, names_of

SET = "Override a parameter. May be repeated."
FIRST = "The model file, or a run: a saved one (.npz), or a model's own experiment."
FROM = 'A mode and all its states: "free x=13 v=5"; values are expressions.'
_OF_RUNS = [name for name in CURVE_METRICS if name not in POINT_METRICS]
METRIC = f"Between states: {' or '.join(POINT_METRICS)}. Between runs: {', '.join(_OF_RUNS[:-1])} or {_OF_RUNS[-1]}."
DEPTH = "Depth of the strips, for the relaxed metric; else the file's."
PLOT = "Draw the distance of two runs over time, or the shortest path in the plane: .png or .svg."
HOPS = "The most passages of a path; else eight more than the fewest that connect the modes."
SECONDS = "About how long the search may take; it then returns the bounds it has."


def distance(
    first: Annotated[Path, Argument(metavar="A", help=FIRST, autocompletion=model_files)],
    second: Annotated[Path | None, Argument(metavar="[B]", help="A second run.", autocompletion=model_files)] = None,
    start: Annotated[str | None, option("STATE", FROM, "--from")] = None,
    end: Annotated[str | None, option("STATE", "The other state.", "--to")] = None,
    metric: Annotated[Metric | None, option("NAME", METRIC)] = None,
    relaxation: Annotated[str | None, option("EPS", DEPTH)] = None,
    overrides: Annotated[list[str] | None, overriding(SET)] = None,
    coordinates: Annotated[str | None, option("A,B", "For rho-hat: the states that count as the position.")] = None,
    plot: Annotated[Path | None, option("FILE", PLOT)] = None,
    hops: Annotated[int | None, option("N", HOPS)] = None,
    seconds: Annotated[float, option("S", SECONDS)] = 60.0,
    json: Json = False,
    allow_path: AllowPath = None,
    limit: Limit = None,
) -> None:
    """Measure the distance between two states, or two runs, in the hybrid metric."""
    with answering(json, allow_path, limit):
        parameters, metric = _parameters(overrides), metric and str(metric)
        options = {"relaxation": relaxation, "parameters": parameters, "hops": hops, "seconds": seconds}
        check_target(plot, "--plot")
        if second is not None:
            if start is not None or end is not None:
                raise UsageError("give two runs, or one model with --from and --to")
            position = None if coordinates is None else names_of(coordinates)
            _between_runs((first, second), metric, position, plot, json, options)
        elif first.suffix.lower() == ".npz":
            hint = "give a second run, or the model file with --from and --to"
            raise UsageError(f"{first} is a run: expected two runs, or a model and two states", hint)
        elif coordinates is not None:
            raise UsageError("--coordinates is for two runs")
        elif start is None or end is None:
            raise UsageError("expected two states, or a second run", _example(first))
        else:
            _between_points(first, (start, end), metric, plot, json, options)


def _example(path: Path) -> str:
    from hsdsl.interface.model import load

    program = load(path).program
    mode = program.modes[program.initial_mode]
    two = (f'"{mode.name} {" ".join(f"{state}={number}" for state in mode.states)}"' for number in (0, 1))
    return "for example: hsdsl distance {} --from {} --to {}".format(path, *two)


def _between_points(
    path: Path, points: tuple[str, str], metric: str | None, plot: Path | None, json: bool, options: dict[str, Any]
) -> None:
    from hsdsl.interface.model import load

    name = metric or ("quotient" if options["relaxation"] is None else "relaxed")
    result = load(path).distance(*points, metric=name, plot=plot, **options)
    if plot is not None:
        say(f"wrote {plot}")
    if not json:
        print(result.sentence)
        return
    pieces = [
        {
            "mode": piece.mode, "from": list(piece.start), "to": list(piece.end),
            "edge": piece.edge, "forward": None if piece.edge is None else piece.forward,
        }
        for piece in result.path
    ]  # fmt: skip
    bounds = {"lower": result.interval.lower, "upper": result.interval.upper, "status": result.status}
    print_json({**bounds, "metric": name, "certified": result.certified, "path": pieces})


def _parameters(overrides: list[str] | None) -> dict[str, str]:
    parameters, initial, settings = split(overrides)
    others: list[Any] = [*(f"initial.{name}" for name in initial), *(f"experiment.{name}" for name in settings)]
    if others:
        raise UsageError(f"a distance depends on parameters alone; --set {others[0]} has no meaning here")
    return parameters


def _between_runs(
    paths: tuple[Path, Path],
    metric: str | None,
    coordinates: list[str] | None,
    plot: Path | None,
    json: bool,
    options: dict[str, Any],
) -> None:
    from hsdsl.interface.model.distances import distance_of_runs as between_runs
    from hsdsl.interface.model.distances import plot_distance

    (run, model), (other, _) = (run_of(path, options["parameters"]) for path in paths)
    options = {**options, "model": model}
    with progress() as show:
        watch = show and partial(_watch, show)
        result = between_runs(run, other, metric or "rho", coordinates=coordinates, watch=watch, **options)
    if plot is not None:
        plot_distance(run, other, plot, **options)
        say(f"wrote {plot}")
    if json:
        print_json(result.as_json())
    else:
        print(result.sentence)


def _watch(show: Callable[[Text], None], lower: float, upper: float) -> None:
    show(lambda: f"at least {lower:.4g}, at most {upper:.4g} so far")
