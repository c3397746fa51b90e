"""``hsdsl plot``: saved runs, or models' own experiments, in one picture."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

from typer import Argument, Option

from hsdsl.base.errors import UsageError
from hsdsl.interface.cli.completion import model_files
from hsdsl.interface.cli.console import print_json, say
from hsdsl.interface.cli.options import Answer, Phases, option
from hsdsl.interface.cli.saved import drawn
from hsdsl.interface.cli.texts import PICTURES, check_target, names_of, pairs_of

RUNS = "Saved runs (.npz), or model files, each of which is run as its own experiment says."
OUT = "The picture: .png, .svg, or .html, an interactive page."
OUTPUTS = "Only these states and outputs over time, in this order."
LABEL = "The name of a run in the legend, in the order of the runs; else its file's. Once for each run."
MODEL = "The model of saved runs: for units, levels of guards where all runs have one, and outputs."
TITLE = "The title; else that of the model."


def plot(
    runs: Annotated[list[Path], Argument(metavar="RUN...", help=RUNS, autocompletion=model_files)],
    *,
    out: Annotated[Path, option("FILE", OUT)],
    outputs: Annotated[str | None, option("A,B", OUTPUTS)] = None,
    phase: Phases = None,
    labels: Annotated[list[str] | None, Option("--label", metavar="TEXT", help=LABEL)] = None,
    title: Annotated[str | None, option("TEXT", TITLE)] = None,
    model: Annotated[Path | None, option("MODEL", MODEL, complete=model_files)] = None,
    answer: Answer,
) -> None:
    """Draw runs in one picture."""
    with answer.reporting():
        check_target(out, "--out", (*PICTURES, ".html"))
        if labels and len(labels) != len(runs):
            raise UsageError(f"--label: expected {len(runs)}, one for each run, got {len(labels)}")
        loaded = None if model is None else _loaded(model)
        columns = None if outputs is None else names_of(outputs)
        used = None if columns is None else [*columns, *(name for pair in phase or () for name in names_of(pair))]
        executions = [drawn(path, loaded, used) for path in runs]
        from hsdsl.analysis.plot import plot
        from hsdsl.analysis.plot.curves import names_of as known_names

        options: dict[str, Any] = {} if loaded is None else _look(loaded, executions)
        if loaded is None and len(executions) == 1:
            options = executions[0].view()
        known = known_names(executions)
        options |= {
            "columns": columns,
            "phases": pairs_of(phase, known),
            "labels": labels or _labels(runs),
            "title": title,
        }
        plot(executions, out, **options)
        if answer.json:
            print_json({"files": [str(out)], "runs": options["labels"]})
        elif not answer.quiet:
            say(f"wrote {out}")


def _loaded(path: Path) -> Any:
    from hsdsl.interface.model import load

    return load(path)


def _look(model: Any, runs: list[Any]) -> dict[str, Any]:
    """Units, and the levels of guards where all runs have the same; those of runs with other parameters differ."""
    from hsdsl.engine.preparation.options import parameters_of

    looks = [model.look(parameters_of(run.overrides)) for run in runs]
    same = all(look["guards"] == looks[0]["guards"] for look in looks)
    return looks[0] | ({} if same else {"guards": ()})


def _labels(runs: list[Path]) -> list[str]:
    """The files' names, with their folders where names repeat."""
    names = [path.stem for path in runs]
    return names if len(set(names)) == len(names) else [str(path) for path in runs]
