"""``hsdsl sweep``: runs over many values into a dataset of Parquet files, and pictures of it."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from typer import Argument, Exit

import hsdsl
from hsdsl.base.errors import UsageError
from hsdsl.base.interrupts import INTERRUPTED
from hsdsl.base.names import visible
from hsdsl.interface.cli.console import progress, say
from hsdsl.interface.cli.options import (
    Answer,
    Engine,
    Experiment,
    check_target,
    model_files,
    names_of,
    numbers_of,
    option,
)

if TYPE_CHECKING:
    from hsdsl.analysis.sweep import Sweep
    from hsdsl.analysis.sweep.manifest import Manifest

OPTIONS = {"overrides": "set"}

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
SLICE = "Draw only the rows where a grid has its value nearest to this, or the tenth of a draw's rows. May be repeated."
WORST = "List the ten rows with the largest numbers of a column, such as final.v; --best lists the smallest."
BEST = "List the ten rows with the smallest numbers of a column, such as a criterion; --worst lists the largest."
ENDS = {"worst": "largest", "best": "smallest"}
TAIL = "The last share of each run, whose transitions and samples a bifurcation diagram shows. Default: 0.5."


def sweep(
    model: Model = None,
    *,
    vary: Annotated[list[str] | None, option("NAME=VALUES", VARY)] = None,
    out: Annotated[Path | None, option("DIR", "The folder of the dataset. The same command resumes it.")] = None,
    random: Annotated[int | None, option("N", "Rows at each point of the grids, for random draws.")] = None,
    seed: Annotated[int | None, option("S", "Seed of the random draws. Default: 0.")] = None,
    record: Annotated[str | None, option("A,B", RECORD + " Default: final.")] = None,
    outputs: Annotated[str | None, option("A,B", "Keep only these states and outputs.")] = None,
    experiment: Experiment,
    engine: Annotated[Engine | None, option("ENGINE", "auto, c or python. Default: auto.")] = None,
    cluster: Annotated[str | None, option("ADDRESS", "The scheduler of a Dask cluster.")] = None,
    processes: Annotated[int | None, option("N", "Number of processes on this machine. Default: one per core.")] = None,
    chunk: Annotated[int | None, option("ROWS", CHUNK)] = None,
    show: Annotated[Path | None, option("DIR", "Summarise and draw a dataset, without running anything.")] = None,
    plot: Annotated[Path | None, option("FILE", "Draw the dataset: .png or .svg.")] = None,
    of: Annotated[str | None, option("COLUMN", OF)] = None,
    over: Annotated[str | None, option("time", OVER)] = None,
    tail: Annotated[float | None, option("SHARE", TAIL)] = None,
    part: Annotated[list[str] | None, option("NAME=VALUE", SLICE, "--slice")] = None,
    worst: Annotated[str | None, option("COLUMN", WORST)] = None,
    best: Annotated[str | None, option("COLUMN", BEST)] = None,
    answer: Answer,
) -> None:
    """Run a model for many values, and write a dataset of Parquet files."""
    with answer.reporting():
        check_target(plot, "--plot")
        drawing = {"of": of, "over": over, "tail": tail, "slice": part}
        running: dict[str, Any] = {"random": random, "seed": seed, "record": record, "engine": engine}
        running |= {"cluster": cluster, "processes": processes, "chunk": chunk, "outputs": names_of(outputs) or None}
        _check(model, out, show, given(vary=vary, out=out, **running, **experiment._asdict()), plot, given(**drawing))
        from hsdsl.analysis.sweep.dataset import check_ranked, load
        from hsdsl.analysis.sweep.picture import Picture

        picture = Picture(of, 0.5 if tail is None else tail, over, numbers_of("--slice", part, "c=0.8"))
        ranked = {"worst": worst, "best": best}

        def check(manifest: Manifest) -> None:
            if plot is not None or given(**drawing):
                picture.check(manifest)
            for column in filter(None, ranked.values()):
                check_ranked(manifest, column)

        if show is not None:
            found = load(show)
            check(found.manifest)
        else:
            assert model is not None and out is not None
            settings = experiment.settings(**given(**running))
            found = _run(model, vary or [], out, settings | {"check": check}, answer.hidden)
        target = plot or (show and show / "_picture.png")
        if target is not None:
            try:
                picture.draw(found, target)
                say(f"wrote {target}")
            except UsageError as error:
                if plot is not None or bool(given(**drawing)):
                    raise
                say(f"no picture: {error}")
        rows = {how: getattr(found, how)(column) for how, column in ranked.items() if column}
        summary = [] if answer.quiet else [found.summary]
        listed = "\n".join([*summary, *_listed(found, rows, ranked)])
        shown = answer._replace(quiet=answer.quiet and not rows)  # a requested list is no summary
        shown.give(lambda: found.as_json() | rows, lambda: listed.lstrip("\n"))


def given(**options: Any) -> dict[str, Any]:
    """The options that a command line has."""
    return {name: value for name, value in options.items() if value not in (None, [])}


def _check(
    model: Path | None,
    out: Path | None,
    show: Path | None,
    running: Mapping[str, Any],
    plot: Path | None,
    drawing: Mapping[str, Any],
) -> None:
    """Refuse options that are for something else."""
    if show is not None and (model or running):
        names = ", ".join([*["MODEL"] * bool(model), *(f"--{OPTIONS.get(name, name)}" for name in running)])
        raise UsageError(f"--show displays an existing dataset; it does not take {names}")
    if show is None and model is None:
        raise UsageError("expected a model, or --show DIR", "hsdsl sweep MODEL --vary c=0.5:0.9:101 --out DIR")
    if show is None and out is None:
        raise UsageError("expected --out DIR, the folder of the dataset", "for example --out sweep")
    if show is None and plot is None and drawing:
        raise UsageError(f"--{next(iter(drawing))} applies to a picture, and there is none", "give --plot FILE")
    if "cluster" in running and "processes" in running:
        raise UsageError("--processes applies to this machine, and --cluster uses others", "leave one out")


def _listed(found: Sweep, rows: Mapping[str, list[dict[str, Any]]], ranked: Mapping[str, str | None]) -> Iterator[str]:
    """The rows at one end as a table, and the command that makes the first of them again."""
    for how, kept in rows.items():
        yield f"\nrows with the {ENDS[how]} {ranked[how]}" + ("" if kept else ": no row has a number")
        cells = [[f"{x:.9g}" if isinstance(x, float) else visible(str(x)) for x in row.values()] for row in kept]
        table = [[*map(visible, kept[0])], *cells] if kept else []
        widths = [max(map(len, column)) for column in zip(*table, strict=True)]
        yield from ("  " + "  ".join(map(str.ljust, line, widths)).rstrip() for line in table)
        if kept:
            yield f"  again: {found.command(kept[0]['row'])}"


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
    say(f"interrupted: {rows}; the same command continues")
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
