"""``hsdsl sweep``: runs over many values into a dataset of Parquet files, and pictures of it."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Annotated, Any

from typer import Argument, Exit

import hsdsl
from hsdsl.base.errors import UsageError
from hsdsl.base.interrupts import INTERRUPTED
from hsdsl.interface.cli.console import progress, say
from hsdsl.interface.cli.options import Answer, EngineName, Experiment, check_target, model_files, names_of, option

Model = Annotated[
    Path | None, Argument(metavar="[MODEL]", help="The model file; not with --show.", autocompletion=model_files)
]
VARY = (
    "Vary a parameter or initial.NAME: c=FROM:TO:COUNT (with :log evenly in the logarithm), c=A,B,C, or a random draw,"
    " 'c~normal(0.9, 0.02)'. May be repeated: every combination is run."
)
RECORD = "What to keep of each run: final, transitions, outputs:every=TIME, outputs:count=N, verdict."
OF = "The column that --plot draws, such as final.x or transitions. before.v and sample.x give a bifurcation diagram."
OVER = "Draw samples, such as --of sample.x, over time: one curve per row, coloured by what varies."
CHUNK = "Rows per file. Default: hsdsl times a few runs and chooses."
TAIL = "The last share of each run, whose transitions and samples a bifurcation diagram shows."


def sweep(
    model: Model = None,
    *,
    vary: Annotated[list[str] | None, option("NAME=VALUES", VARY)] = None,
    out: Annotated[Path | None, option("DIR", "The folder of the dataset. The same command resumes it.")] = None,
    random: Annotated[int | None, option("N", "Rows at each point of the grids, for random draws.")] = None,
    seed: Annotated[int, option("S", "Seed of the random draws.")] = 0,
    record: Annotated[str, option("A,B", RECORD)] = "final",
    outputs: Annotated[str | None, option("A,B", "Keep only these states and outputs.")] = None,
    experiment: Experiment,
    engine: EngineName = "auto",
    cluster: Annotated[str | None, option("ADDRESS", "The scheduler of a Dask cluster.")] = None,
    processes: Annotated[int | None, option("N", "Number of processes on this machine. Default: one per core.")] = None,
    chunk: Annotated[int | None, option("ROWS", CHUNK)] = None,
    show: Annotated[Path | None, option("DIR", "Summarise and draw a dataset, without running anything.")] = None,
    plot: Annotated[Path | None, option("FILE", "Draw the dataset: .png or .svg.")] = None,
    of: Annotated[str | None, option("COLUMN", OF)] = None,
    over: Annotated[str | None, option("time", OVER)] = None,
    tail: Annotated[float, option("SHARE", TAIL)] = 0.5,
    answer: Answer,
) -> None:
    """Run a model for many values, and write a dataset of Parquet files."""
    with answer.reporting():
        check_target(plot, "--plot")
        _check(model, vary, out, show)
        if show is not None:
            from hsdsl.analysis.sweep import load

            found = load(show)
        else:
            settings = experiment.settings(
                engine=engine, random=random, seed=seed, record=record, cluster=cluster, processes=processes,
                chunk=chunk, outputs=names_of(outputs) or None,
            )  # fmt: skip
            assert model is not None and out is not None
            found = _run(model, vary or [], out, settings, answer.hidden)
        target = plot or (show and show / "_picture.png")
        if target is not None:
            _draw(found, target, of, {"tail": tail, "over": over}, any(x is not None for x in (plot, of, over)))
        answer.give(found.as_json, lambda: found.summary)


def _check(model: Path | None, vary: list[str] | None, out: Path | None, show: Path | None) -> None:
    if show is not None and (model, vary, out) != (None, None, None):
        raise UsageError("--show shows a dataset that is there, and takes neither MODEL nor --vary nor --out")
    if show is None and model is None:
        raise UsageError("expected a model, or --show DIR", "hsdsl sweep MODEL --vary c=0.5:0.9:101 --out DIR")
    if show is None and out is None:
        raise UsageError("expected --out DIR, the folder of the dataset", "for example --out sweep")


def _run(model: Path, vary: list[str], out: Path, settings: dict[str, Any], quiet: bool) -> Any:
    pace = Pace()
    with progress(quiet) as shown:

        def watch(done: int, rows: int) -> None:
            pace.note(done, rows)
            if shown is not None:
                shown(pace.text)

        try:
            return hsdsl.load(model).sweep(vary, out, progress=watch, **settings)
        except KeyboardInterrupt:
            rows = f"{pace.done:,} of {pace.rows:,} rows are in {out}" if pace.rows else "nothing was run"
    say(f"interrupted: {rows}; the same command goes on")
    raise Exit(INTERRUPTED)


class Pace:
    """How far a sweep is, how fast, and how long it will take."""

    def __init__(self) -> None:
        self.began = self.latest = time.monotonic()
        self.first = self.done = self.rows = 0

    def note(self, done: int, rows: int) -> None:
        """Take down how many rows there are."""
        self.latest = time.monotonic()
        if not self.rows:
            self.began, self.first = self.latest, done
        self.done, self.rows = done, rows

    def text(self, width: int = 30) -> str:
        """Write it for a person."""
        share = self.done / self.rows if self.rows else 1.0
        bar = f"[{'=' * round(width * share):{width}}] {self.done:,} of {self.rows:,} rows"
        made, spent = self.done - self.first, self.latest - self.began
        if not made or not spent:
            return bar
        left = (self.rows - self.done) * spent / made - (time.monotonic() - self.latest)
        return f"{bar}, {made / spent:,.0f} rows/s, {duration(max(0.0, left))} left"


def duration(seconds: float) -> str:
    """Write a time for a person."""
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours} h {minutes:02} min" if hours else f"{minutes} min {rest:02} s" if minutes else f"{rest} s"


def _draw(found: Any, plot: Path, of: str | None, options: dict[str, Any], needed: bool) -> None:
    try:
        found.plot(plot, of, **options)
        say(f"wrote {plot}")
    except UsageError as error:
        if needed:
            raise
        say(f"no picture: {error}")
