"""``hsdsl run``: simulate a model, summarise the run, save it and draw it."""

from __future__ import annotations

from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from typer import Exit, Option

from hsdsl.base.errors import UsageError
from hsdsl.base.interrupts import INTERRUPTED
from hsdsl.base.names import visible
from hsdsl.base.progress import counted, running
from hsdsl.interface.cli.console import progress, say
from hsdsl.interface.cli.options import (
    PICTURES,
    STATE,
    Answer,
    EngineName,
    Experiment,
    Model,
    Phases,
    check_target,
    known_names,
    option,
    pairs_of,
)

if TYPE_CHECKING:
    from hsdsl.engine.execution import Execution, Stop
    from hsdsl.interface.model.stream import Streamed


STOPPED = 3
PRECISION = "Compute with this many decimal digits (mpmath). The default tolerance of taylor follows."
EXPLAIN = "Print every reason of the verdict."
ESTIMATE = "Run again with smaller steps, and print the distance between the two runs."
SAMPLES = "Rows of tables: every=TIME or count=N, and rows at jumps. Default: the file's samples, or all steps."
JUMPS = "Rows of a jump in tables: both sides, only the one after, or none besides samples. Default: both."
EVERY = "Write each K-th step and each jump to --out (.csv) during the run, in constant memory."
DRAW = "Draw the run: .png, .svg, or .html (an interactive page). --outputs chooses what is drawn."
FILM = "Run again and write a film of the model's scene: .gif, or .mp4 if ffmpeg is installed."
SPEED = "Speed of the film: model time per second. Default: 1 if the film then lasts 4 to 20 s."
EVERY_ALONE = "--every streams to --out FILE.csv, without --plot, --animate, --estimate or --precision"
WRITES = {  # the suffixes of the files that options write
    "--out": (".csv", ".parquet", ".npz"),
    "--plot": (*PICTURES, ".html"),
    "--animate": (".gif", ".mp4"),
}


def run(
    model: Model,
    *,
    experiment: Experiment,
    engine: EngineName = "auto",
    precision: Annotated[int | None, option("DIGITS", PRECISION)] = None,
    outputs: Annotated[str | None, option("A,B", "The states and outputs in files and final outputs.")] = None,
    estimate: Annotated[bool, Option("--estimate", help=ESTIMATE)] = False,
    out: Annotated[Path | None, option("FILE", "Save the execution: .csv, .parquet or .npz.")] = None,
    samples: Annotated[str | None, option("N", SAMPLES)] = None,
    jumps: Annotated[Literal["both", "after", "none"], option("ROWS", JUMPS)] = "both",
    every: Annotated[int | None, option("K", EVERY)] = None,
    plot: Annotated[Path | None, option("FILE", DRAW)] = None,
    phase: Phases = None,
    animate: Annotated[Path | None, option("FILE", FILM)] = None,
    speed: Annotated[float | None, option("X", SPEED)] = None,
    explain: Annotated[bool, Option("--explain", help=EXPLAIN)] = False,
    answer: Answer,
) -> None:
    """Simulate a model and summarise what happened."""
    from hsdsl.interface.model.model import load

    with answer.reporting():
        _check_files(out, plot, animate, outputs)
        if jumps != "both" and (out is None or out.suffix.lower() == ".npz" or every is not None):
            raise UsageError("--jumps chooses rows of a table: give --out FILE.csv or .parquet, without --every")
        loaded = load(model)
        settings = experiment.settings(engine=engine, precision=precision, samples=samples)
        names = chosen_names(outputs, loaded.columns, [one.name for one in loaded.program.inputs])
        shown = {"columns": names, "phases": pairs_of(phase, loaded.columns)}
        pairs = shown["phases"]
        if pairs is not None and plot is None:
            raise UsageError("--phase applies to a picture: give --plot FILE too")
        if speed is not None and animate is None:
            raise UsageError("--speed applies to a film: give --animate FILE too")
        if animate is not None:
            from hsdsl.analysis.plot.animation import check

            check(animate)
            loaded.check_scene()
        needed = names and [*names, *(name for pair in shown["phases"] or () for name in pair)]
        result: Any
        with progress(answer.hidden) as show:
            settings["watch"] = show and partial(running, show)
            if every is None:
                result = loaded.simulate(**settings, outputs=needed)
            elif out is None or plot or animate or estimate or precision is not None:
                raise UsageError(EVERY_ALONE)
            else:
                settings = {name: value for name, value in settings.items() if value is not None}
                result = loaded.stream(out, every=every, columns=names, **settings)
        if every is None:
            _answer(loaded, result, shown, estimate, explain, out, jumps, plot, settings["parameters"], answer)
            if animate is not None:
                with progress(answer.hidden) as show:
                    settings["watch"] = None
                    loaded.animate(animate, speed=speed, progress=counted(show, "frames"), **settings)
                say(f"wrote {animate}")
        else:
            answer.give(
                lambda: _streamed(result, model),
                lambda: (
                    f"{result.rows} of {result.steps} rows written to {visible(str(result.path))}\n"
                    f"stop      {result.stop.reason}: {result.stop.message}\ntransitions {result.transitions}"
                    + "".join(f"\nwarning   {visible(each.message)}" for each in result.warnings)
                ),
            )
    _leave(result.stop, answer)


def _leave(stop: Stop, answer: Answer) -> None:
    """End with the exit code of a run that stopped early."""
    if not stop.complete:
        if not answer.json:
            say(f"hsdsl: stopped ({stop.reason})" + (f": {stop.message}" if answer.quiet else ""))
        raise Exit(INTERRUPTED if stop.reason == "interrupted" else STOPPED)


def _check_files(out: Path | None, plot: Path | None, animate: Path | None, outputs: str | None) -> None:
    """Refuse files that could not be written."""
    given = {"--out": out, "--plot": plot, "--animate": animate}
    for name, path in given.items():
        check_target(path, name, WRITES[name], WRITES)
    if out is not None and out.suffix.lower() == ".npz" and outputs is not None:
        raise UsageError("an .npz file holds the whole execution; --outputs chooses columns of .csv and .parquet")


def _answer(
    model: Any,
    execution: Execution,
    shown: dict[str, Any],
    estimate: bool,
    explain: bool,
    out: Path | None,
    jumps: str,
    plot: Path | None,
    parameters: dict[str, str],
    answer: Answer,
) -> None:
    """Save, draw and print a run."""
    names = shown["columns"]
    estimated = model.estimate(execution) if estimate else None
    if estimated is not None:
        execution = execution.estimated()
    if out is not None:
        for written in execution.save(out, columns=names, jumps=jumps):
            say(f"wrote {written}")
    if plot is not None:
        model.plot(execution, plot, parameters, **shown)
        say(f"wrote {plot}")
    answer.give(lambda: _record(execution, names, estimated), lambda: _text(execution, estimated, explain))


def _text(execution: Execution, estimated: Any, explain: bool) -> str:
    from hsdsl.analysis.report.summary import summary

    return summary(execution, explain=explain) + ("" if estimated is None else f"\n{estimated.sentence}")


def _record(execution: Execution, names: list[str] | None, estimated: Any) -> dict[str, Any]:
    from hsdsl.analysis.report import record

    result = record(execution)
    if names is not None:
        chosen = result["final"]["outputs"]
        result["final"]["outputs"] = {name: value for name, value in chosen.items() if name in names}
    return result | ({} if estimated is None else {"estimate": estimated.as_json()})


def chosen_names(outputs: str | None, known: list[str], inputs: list[str]) -> list[str] | None:
    """The names of ``--outputs``, None where it is left out."""
    if outputs is None:
        return None
    names = known_names(outputs, known, "--outputs", STATE, inputs)
    if not names:
        raise UsageError("--outputs: expected names of states or outputs, with commas between them")
    return list(names)


def _streamed(run: Streamed, model: Path) -> dict[str, Any]:
    from hsdsl.analysis.report.json_form import named

    final = run.final
    states = [name for name, present in zip(final.states, final.present[0], strict=True) if present]
    return (
        {"model": str(model)}
        | named(run, "engine scheme method overrides")
        | {
            "stop": named(run.stop, "reason time message"),
            "transition_count": run.transitions,
            "warnings": [asdict(each) for each in run.warnings],
            "out": {"file": str(run.path), "rows": run.rows, "steps": run.steps},
            "final": {
                "time": float(final.time[0]),
                "mode": str(final.mode[0]),
                "state": {name: float(final[name][0]) for name in states},
                "outputs": {name: float(final[name][0]) for name in final.outputs},
            },
            "seconds": {"simulate": run.seconds},
        }
    )
