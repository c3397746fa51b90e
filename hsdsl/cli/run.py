"""``hsdsl run``: simulate a model, say what happened, and keep it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from click.exceptions import Exit

from hsdsl.cli.console import FILE, errors_reported, progress, say
from hsdsl.cli.limited import limited
from hsdsl.errors import UsageError

if TYPE_CHECKING:
    from hsdsl.execution import Execution

STOPPED, INTERRUPTED = 3, 130
OUT_SUFFIXES, PLOT_SUFFIXES = (".csv", ".parquet", ".npz"), (".png", ".svg", ".html")


@click.command()
@click.argument("model", type=FILE, metavar="MODEL", help="The model file.")
@click.option(
    "--set",
    "overrides",
    metavar="NAME=VALUE",
    multiple=True,
    help="Override a parameter (c=0.8), an initial value (initial.v=20), the initial mode or a setting"
    " (experiment.step=1e-3). May be repeated; values are expressions of parameters.",
)
@click.option("--until", metavar="T", help="End of the run.")
@click.option("--scheme", metavar="S", help="relaxed, located or paoli-schatzman.")
@click.option("--method", metavar="M", help="A method's name, such as dopri5 or taylor, or auto.")
@click.option("--step", metavar="H", help="Fixed step size; excludes --tolerance.")
@click.option("--tolerance", metavar="TOL", help="Bound on the local error, relative to the states' scales.")
@click.option("--relaxation", metavar="EPS", help="The paper's epsilon: depth of the strips, and a time.")
@click.option("--engine", metavar="ENGINE", default="auto", help="auto, c or python.")
@click.option(
    "--precision",
    type=int,
    metavar="DIGITS",
    help="Compute with this many decimal digits (mpmath); the default tolerance of taylor follows.",
)
@click.option("--outputs", metavar="A,B", help="Only these states and outputs in files and final outputs.")
@click.option("--estimate", is_flag=True, help="Run again, finer, and say how far apart the two runs are.")
@click.option("--out", type=FILE, metavar="FILE", help="Save the execution: .csv, .parquet or .npz.")
@click.option(
    "--every",
    type=int,
    metavar="K",
    help="Write every K-th step to --out (.csv) while the run goes on, in constant memory; jumps are always written.",
)
@click.option("--plot", type=FILE, metavar="FILE", help="Draw it: .png, .svg or .html.")
@click.option("--json", is_flag=True, help="Print one JSON object instead of the summary.")
@click.option("--quiet", "-q", is_flag=True, help="Print no summary and no progress.")
@limited
def run(
    model: Path,
    overrides: tuple[str, ...],
    engine: str,
    outputs: str | None,
    estimate: bool,
    out: Path | None,
    every: int | None,
    plot: Path | None,
    json: bool,
    quiet: bool,
    precision: int | None,
    **settings: str | None,
) -> None:
    """Simulate a model and summarise what happened."""
    asked: dict[str, Any] = {**settings, "engine": engine, "precision": precision}
    with errors_reported(json):
        _check_target(out, "--out", OUT_SUFFIXES)
        if out is not None and out.suffix.lower() == ".npz" and outputs is not None:
            raise UsageError("an .npz file holds the whole execution; --outputs chooses columns of .csv and .parquet")
        _check_target(plot, "--plot", PLOT_SUFFIXES)
        if every is None:
            stop = _simulate(model, overrides, asked, outputs, estimate, out, plot, json, quiet).stop
        else:
            from hsdsl.cli.streamed import streamed

            if out is None or plot is not None or estimate or precision is not None:
                raise UsageError("--every streams to --out FILE.csv, without --plot, --estimate or --precision")
            stop = streamed(model, overrides, asked, outputs, out, every, json, quiet)
    if stop.reason == "interrupted":
        raise Exit(INTERRUPTED)
    if not stop.complete:
        raise Exit(STOPPED)


def _simulate(
    path: Path,
    overrides: Sequence[str],
    asked: dict[str, Any],
    outputs: str | None,
    estimate: bool,
    out: Path | None,
    plot: Path | None,
    json: bool,
    quiet: bool,
) -> Execution:
    from hsdsl.files import read_bytes
    from hsdsl.model import engines, load, split_overrides

    text = read_bytes(path)
    engines.begin(text, *(asked[key] for key in ("engine", "precision", "scheme", "method")))
    model = load(path, text=text)
    names = chosen_names(outputs, model.columns)
    parameters, initial, settings = split_overrides(overrides)
    asked |= {"parameters": parameters, "initial": initial, "settings": settings, "outputs": names}
    with progress(quiet or json) as watch:
        execution = model.simulate(**asked, watch=watch)
    found = model.estimate(execution) if estimate else None
    if found is not None:
        execution = execution.estimated()
    if out is not None:
        for written in execution.save(out, columns=names):
            say(f"wrote {written}")
    if plot is not None:
        model.plot(execution, plot, parameters)
        say(f"wrote {plot}")
    _report(execution, names, found, json, quiet)
    return execution


def _report(execution: Execution, names: list[str] | None, found: Any, json: bool, quiet: bool) -> None:
    from hsdsl.report import as_json, dumps, summary

    if json:
        result = as_json(execution)
        if names is not None:
            chosen = result["final"]["outputs"]
            result["final"]["outputs"] = {name: value for name, value in chosen.items() if name in names}
        print(dumps(result | ({} if found is None else {"estimate": found.as_json()})))
    elif not quiet:
        print(summary(execution) + ("" if found is None else f"\n{found.sentence}"))
    if not execution.stop.complete and not json:
        say(f"hsdsl: stopped ({execution.stop.reason}): {execution.stop.message}")


def chosen_names(outputs: str | None, known: list[str]) -> list[str] | None:
    """Return the names that ``--outputs`` gives, None where it is left out."""
    from hsdsl.names import did_you_mean

    if outputs is None:
        return None
    names = [name.strip() for name in outputs.split(",") if name.strip()]
    for name in names:
        if name not in known:
            raise UsageError(f"--outputs: the model has no state or output '{name}'", did_you_mean(name, known))
    if not names:
        raise UsageError("--outputs wants names of states or outputs, with commas between them")
    return names


def _check_target(path: Path | None, option: str, suffixes: tuple[str, ...]) -> None:
    """Refuse a file that could not be written before a long run, not after it."""
    if path is None:
        return
    if path.suffix.lower() not in suffixes:
        raise UsageError(f"{option} {path}: the name must end in {', '.join(suffixes[:-1])} or {suffixes[-1]}")
    if not path.parent.is_dir():
        raise UsageError(f"{option} {path}: there is no folder {path.parent}")
    if path.suffix.lower() == ".parquet":
        from hsdsl.execution.samples import optional

        optional("pyarrow", f"{option} {path}")
