"""``hsdsl run``: simulate a model, say what happened, and keep it."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from hsdsl.cli.console import errors_reported, progress, say
from hsdsl.errors import UsageError
from hsdsl.execution import Execution

STOPPED, INTERRUPTED = 3, 130
OUT_SUFFIXES, PLOT_SUFFIXES = (".csv", ".parquet", ".npz"), (".png", ".svg", ".html")


def run(
    model: Annotated[Path, typer.Argument(help="The model file.", metavar="MODEL")],
    set_: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            metavar="NAME=VALUE",
            help="Override a parameter (c=0.8), an initial value (initial.v=20), the initial mode or a setting"
            " (experiment.step=1e-3). May be repeated; values are expressions of parameters.",
        ),
    ] = None,
    until: Annotated[str | None, typer.Option(metavar="T", help="End of the run.")] = None,
    scheme: Annotated[str | None, typer.Option(metavar="S", help="relaxed or paoli-schatzman.")] = None,
    method: Annotated[
        str | None, typer.Option(metavar="M", help="euler, midpoint, heun, ralston, rk4, dopri5 or auto.")
    ] = None,
    step: Annotated[str | None, typer.Option(metavar="H", help="Fixed step size; excludes --tolerance.")] = None,
    tolerance: Annotated[
        str | None, typer.Option(metavar="TOL", help="Bound on the local error relative to 1 + |x|; adaptive steps.")
    ] = None,
    relaxation: Annotated[
        str | None, typer.Option(metavar="EPS", help="The paper's epsilon: depth of the strips, and a time.")
    ] = None,
    engine: Annotated[str, typer.Option(metavar="ENGINE", help="auto, c or python.")] = "auto",
    precision: Annotated[
        int | None, typer.Option(metavar="DIGITS", help="Compute with this many decimal digits (mpmath).")
    ] = None,
    outputs: Annotated[
        str | None, typer.Option(metavar="A,B", help="Only these states and outputs in files and final outputs.")
    ] = None,
    estimate: Annotated[
        bool, typer.Option("--estimate", help="Run again, finer, and say how far apart the two runs are.")
    ] = False,
    out: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Save the execution: .csv, .parquet or .npz.")
    ] = None,
    plot: Annotated[Path | None, typer.Option(metavar="FILE", help="Draw it: .png, .svg or .html.")] = None,
    json: Annotated[bool, typer.Option("--json", help="Print one JSON object instead of the summary.")] = False,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Print no summary and no progress.")] = False,
) -> None:
    """Simulate a model and summarise what happened."""
    asked: dict[str, Any] = {
        "until": until,
        "scheme": scheme,
        "method": method,
        "step": step,
        "tolerance": tolerance,
        "relaxation": relaxation,
        "engine": engine,
        "precision": precision,
    }
    with errors_reported(json):
        _check_target(out, "--out", OUT_SUFFIXES)
        if out is not None and out.suffix.lower() == ".npz" and outputs is not None:
            raise UsageError("an .npz file holds the whole execution; --outputs chooses columns of .csv and .parquet")
        _check_target(plot, "--plot", PLOT_SUFFIXES)
        execution = _simulate(model, set_ or [], asked, outputs, estimate, out, plot, json, quiet)
    if execution.stop.reason == "interrupted":
        raise typer.Exit(INTERRUPTED)
    if not execution.stop.complete:
        raise typer.Exit(STOPPED)


def _simulate(
    path: Path,
    overrides: list[str],
    asked: dict[str, Any],
    outputs: str | None,
    estimate: bool,
    out: Path | None,
    plot: Path | None,
    json: bool,
    quiet: bool,
) -> Execution:
    from hsdsl.model import load, split_overrides

    model = load(path)
    names = _names(outputs, model.columns)
    parameters, initial, settings = split_overrides(overrides)
    asked |= {"parameters": parameters, "initial": initial, "settings": settings}
    with progress(quiet or json) as watch:
        execution = model.simulate(**asked, watch=watch)
    found = model.estimate(execution, **asked) if estimate else None
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


def _names(outputs: str | None, known: list[str]) -> list[str] | None:
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
