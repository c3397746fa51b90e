"""``hsdsl plot`` and ``distance``: of saved runs, or of runs as the experiments of models say."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from typer import Argument, Option

import hsdsl
from hsdsl.analysis.metrics.table import CURVE_METRICS, POINT_METRICS
from hsdsl.base.errors import ModelError, UsageError
from hsdsl.interface.cli.console import Text, print_json, progress, say
from hsdsl.interface.cli.options import (
    PICTURES,
    AllowPath,
    Answer,
    Json,
    Limit,
    Phases,
    answering,
    check_target,
    model_files,
    names_of,
    option,
    overriding,
    pairs_of,
    values_of,
)

if TYPE_CHECKING:
    from hsdsl.engine.execution import Execution
    from hsdsl.interface.model import Model


RUNS = "Saved runs (.npz) or model files. A model file is run with its own experiment."
DRAWN = "The picture: .png, .svg, or .html, an interactive page."
OUTPUTS = "Draw only these states and outputs over time, in this order."
LABEL = "The name of a run in the legend; give it once for each run, in their order. Default: the file's name."
OF_MODEL = "The model of saved runs. It gives units, outputs, and the levels of guards that all runs share."
TITLE = "The title. Default: that of the model."


def plot(
    runs: Annotated[list[Path], Argument(metavar="RUN...", help=RUNS, autocompletion=model_files)],
    *,
    out: Annotated[Path, option("FILE", DRAWN)],
    outputs: Annotated[str | None, option("A,B", OUTPUTS)] = None,
    phase: Phases = None,
    labels: Annotated[list[str] | None, Option("--label", metavar="TEXT", help=LABEL)] = None,
    title: Annotated[str | None, option("TEXT", TITLE)] = None,
    model: Annotated[Path | None, option("MODEL", OF_MODEL, complete=model_files)] = None,
    answer: Answer,
) -> None:
    """Draw runs in one picture."""
    with answer.reporting():
        check_target(out, "--out", (*PICTURES, ".html"))
        if labels and len(labels) != len(runs):
            raise UsageError(f"--label: expected {len(runs)}, one for each run, got {len(labels)}")
        loaded = None if model is None else hsdsl.load(model)
        columns = None if outputs is None else names_of(outputs)
        used = None if columns is None else [*columns, *(name for pair in phase or () for name in names_of(pair))]
        executions = [drawn(path, loaded, used) for path in runs]
        from hsdsl.analysis.plot import plot
        from hsdsl.analysis.plot.curves import names_of as known_names

        options: dict[str, Any] = {}
        if loaded is not None:
            from hsdsl.engine.preparation.options import parameters_of

            looks = [loaded.look(parameters_of(run.overrides)) for run in executions]
            same = all(look["guards"] == looks[0]["guards"] for look in looks)
            options = looks[0] | ({} if same else {"guards": ()})  # runs with other parameters have other levels
        elif len(executions) == 1:
            options = executions[0].view()
        known, names = known_names(executions), [path.stem for path in runs]
        options |= {
            "columns": columns,
            "phases": pairs_of(phase, known),
            "labels": labels or (names if len(set(names)) == len(names) else [str(path) for path in runs]),
            "title": title,
        }
        plot(executions, out, **options)
        if answer.json:
            print_json({"files": [str(out)], "runs": options["labels"]})
        elif not answer.quiet:
            say(f"wrote {out}")


SET_PARAMETERS = "Override a parameter. May be repeated."
FIRST = "The model file; or a run: a saved one (.npz), or a model file, run with its own experiment."
FROM = 'A mode and all its states: "free x=13 v=5"; values are expressions.'
_OF_RUNS = [name for name in CURVE_METRICS.own if name not in POINT_METRICS]
METRIC = f"Between states: {' or '.join(POINT_METRICS)}. Between runs: {', '.join(_OF_RUNS[:-1])} or {_OF_RUNS[-1]}."
DEPTH = "The relaxation of the relaxed metric. Default: the file's."
PLOT = "Draw the distance of two runs over time, or the shortest path in the plane: .png or .svg."
HOPS = "Largest number of passages of a path. Default: eight more than the fewest that connect the modes."
SECONDS = "Approximate time limit of the search in seconds. It then returns the bounds that it has."


def distance(
    first: Annotated[Path, Argument(metavar="A", help=FIRST, autocompletion=model_files)],
    second: Annotated[Path | None, Argument(metavar="[B]", help="A second run.", autocompletion=model_files)] = None,
    start: Annotated[str | None, option("STATE", FROM, "--from")] = None,
    end: Annotated[str | None, option("STATE", "The other state.", "--to")] = None,
    metric: Annotated[str | None, option("NAME", METRIC, complete=lambda: [*CURVE_METRICS])] = None,
    relaxation: Annotated[str | None, option("EPS", DEPTH)] = None,
    overrides: Annotated[list[str] | None, overriding(SET_PARAMETERS)] = None,
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
        given = values_of(overrides)
        others = [f"initial.{name}" for name in given["initial"]] + [f"experiment.{name}" for name in given["settings"]]
        if others:
            raise UsageError(f"a distance depends on parameters alone; --set {others[0]} has no meaning here")
        options = {"relaxation": relaxation, "parameters": given["parameters"], "hops": hops, "seconds": seconds}
        check_target(plot, "--plot")
        if second is not None:
            if start is not None or end is not None:
                raise UsageError("give two runs, or one model with --from and --to")
            position = None if coordinates is None else names_of(coordinates)
            found, record = _between_runs((first, second), metric or "rho", position, plot, options)
        elif first.suffix.lower() == ".npz":
            hint = "give a second run, or the model file with --from and --to"
            raise UsageError(f"{first} is a run: expected two runs, or a model and two states", hint)
        elif coordinates is not None:
            raise UsageError("--coordinates is for two runs")
        elif start is None or end is None:
            program = hsdsl.load(first).program
            mode = program.modes[program.initial_mode]
            two = (f'"{mode.name} {" ".join(f"{state}={number}" for state in mode.states)}"' for number in (0, 1))
            raise UsageError(
                "expected two states, or a second run",
                "for example: hsdsl distance {} --from {} --to {}".format(first, *two),
            )
        else:
            name = metric or ("quotient" if relaxation is None else "relaxed")
            found, record = _between_points(first, (start, end), name, plot, options)
        if plot is not None:
            say(f"wrote {plot}")
        if json:
            print_json(record)
        else:
            print(found.sentence)


def _between_points(
    path: Path, points: tuple[str, str], metric: str, plot: Path | None, options: dict[str, Any]
) -> Any:
    """The distance of two points, and what ``--json`` prints of it."""
    result = hsdsl.load(path).distance(*points, metric=metric, plot=plot, **options)
    pieces = [
        {
            "mode": piece.mode, "from": list(piece.start), "to": list(piece.end),
            "edge": piece.edge, "forward": None if piece.edge is None else piece.forward,
        }
        for piece in result.path
    ]  # fmt: skip
    bounds = {"lower": result.interval.lower, "upper": result.interval.upper, "status": result.status}
    return result, {**bounds, "metric": metric, "certified": result.certified, "path": pieces}


def _between_runs(
    paths: tuple[Path, Path], metric: str, coordinates: list[str] | None, plot: Path | None, options: dict[str, Any]
) -> Any:
    """The distance of two runs, and what ``--json`` prints of it."""
    from hsdsl.interface.model.distances import distance_of_runs, plot_distance

    (run, model), (other, _) = (run_of(path, options["parameters"]) for path in paths)
    options = {**options, "model": model}
    with progress() as show:
        watch = show and partial(_show_bounds, show)
        result = distance_of_runs(run, other, metric, coordinates=coordinates, watch=watch, **options)
    if plot is not None:
        plot_distance(run, other, plot, **options)
    return result, result.as_json()


def _show_bounds(show: Callable[[Text], None], lower: float, upper: float) -> None:
    show(lambda: f"at least {lower:.4g}, at most {upper:.4g} so far")


def run_of(path: Path, parameters: dict[str, Any]) -> tuple[Execution, Model | Path | None]:
    """Return a run, and its model where its path is not the recorded one."""
    if path.suffix.lower() == ".npz":
        from hsdsl.analysis.store import load

        run = load(path)
        neighbour = path.parent / Path(run.model).name
        return run, neighbour if not Path(run.model).exists() and neighbour.exists() else None
    if path.suffix.lower() in (".csv", ".parquet"):
        raise UsageError(f"{path} is a table: expected a run", "save runs with --out RUN.npz, which loses nothing")
    model = hsdsl.load(path)  # read once: it may come through a pipe
    return model.simulate(parameters=parameters), model


def drawn(path: Path, model: Model | None, columns: list[str] | None) -> Execution:
    """Return a run with its outputs between rows, as far as ``columns`` has some, or is None.

    Those of a saved run are computed by its model. Where that is not known, a message says that they are straight.
    """
    run, other = run_of(path, {})
    outputs = run.output_names if columns is None else set(columns) & set(run.output_names)
    if run.output_function is not None or not outputs:
        return run
    try:
        return (model or hsdsl.load(other if isinstance(other, Path) else run.model)).with_outputs(run)
    except (UsageError, ModelError) as error:
        first = str(error).splitlines()[0]
        say(f"hsdsl: {path}: outputs are straight lines between rows: {first}; give the model with --model")
        return run
