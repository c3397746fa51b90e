"""``hsdsl chart`` and ``stability``: speed against accuracy, ours and others', and maps of how methods fail."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from typer import Argument, Option

import hsdsl
from hsdsl.base.errors import UsageError
from hsdsl.base.progress import Show, Text, running
from hsdsl.interface.cli.console import progress, say, write_table
from hsdsl.interface.cli.options import (
    Answer,
    Model,
    check_target,
    known_names,
    model_files,
    names_of,
    option,
    overriding,
    values_of,
)

if TYPE_CHECKING:
    from hsdsl.interface.chart import Row


MODELS = "Model files; FILE:1 is the second start of its reference."
PEERS_HELP = "Peers (other tools) to run: scipy, heyoka, diffrax, sksundae, casadi; or all."


def chart(
    models: Annotated[list[str], Argument(metavar="MODEL...", help=MODELS, autocompletion=model_files)],
    *,
    schemes: Annotated[str | None, option("A,B", "Schemes of hsdsl. Default: all.")] = None,
    methods: Annotated[str | None, option("A,B", "Methods of hsdsl. Default: all.")] = None,
    engines: Annotated[str | None, option("A,B", "Engines of hsdsl. Default: all.")] = None,
    tolerances: Annotated[str | None, option("A,B", "Tolerances of adaptive methods and peers.")] = None,
    steps: Annotated[str | None, option("A,B", "Steps of fixed-step methods.")] = None,
    against: Annotated[str | None, option("A,B", PEERS_HELP)] = None,
    states: Annotated[str | None, option("A,B", "Take the error of these states only.")] = None,
    until: Annotated[str | None, option("T", "End of the runs.")] = None,
    samples: Annotated[int, option("N", "Number of samples at which the error is measured.")] = 2000,
    clearance: Annotated[
        float | None,
        option("DT", "Ignore samples closer than this to an exact jump. Default: 1e-4, or 1e-4 of a run below 1."),
    ] = None,
    digits: Annotated[int, option("N", "Digits of the reference if no exact execution is known.")] = 8,
    rounds: Annotated[int, option("N", "Number of timed rounds, after one that warms up.")] = 5,
    patience: Annotated[
        float, option("S", "Time limit in seconds of a run or a search for rho. Its tool then gets no tighter setting.")
    ] = 10.0,
    rho: Annotated[bool, Option(help="Also compute rho for the runs of hsdsl.")] = True,
    out: Annotated[Path | None, option("FILE", "Write the table: .csv.")] = None,
    plot: Annotated[Path | None, option("FILE", "Draw the chart: .png or .svg.")] = None,
    answer: Answer,
) -> None:
    """Chart speed against accuracy: methods, schemes, engines and peers against the exact execution."""
    with answer.reporting():
        from hsdsl.engine.integrators import METHODS
        from hsdsl.interface.chart import ENGINES, OWN_SCHEMES, PEERS, TOLERANCES, work_precision

        check_target(out, "--out", (".csv",))
        check_target(plot, "--plot")
        options: dict[str, Any] = {
            "schemes": known_names(schemes, OWN_SCHEMES, "--schemes") or OWN_SCHEMES,
            "methods": known_names(methods, tuple(METHODS), "--methods"),
            "engines": known_names(engines, ENGINES, "--engines") or ENGINES,
            "tolerances": _numbers(tolerances, "--tolerances") or TOLERANCES,
            "steps": _numbers(steps, "--steps"),
            "against": known_names(",".join(PEERS) if against == "all" else against, tuple(PEERS), "--against"),
            "rounds": rounds,
            "patience": patience,
            "with_rho": rho,
        }
        sampling = {
            **{"states": names_of(states), "samples": samples, "clearance": clearance},
            **{"digits": digits, "until": until},
        }
        charted: list[tuple[str, list[Row]]] = []
        with progress(answer.hidden) as show:

            def watch(text: str) -> None:
                if show:
                    show(lambda: text)

            for scene in [_scene(text, sampling, show) for text in models]:
                name = scene.name
                rows, remarks = work_precision(scene, **options, watch=lambda what, name=name: watch(f"{name}: {what}"))
                charted.append((name, rows))
                for remark in remarks if not answer.quiet else ():
                    say(f"skipped: {remark}")
        _report(charted, out, plot, answer)


def _scene(text: str, sampling: dict[str, Any], show: Show | None) -> Any:
    from hsdsl.interface.chart import Scene

    path, colon, block = text.rpartition(":")
    if not (colon and block.isdecimal()):
        path, block = text, "0"

    def named(far: Text) -> None:
        if show:
            show(lambda: f"{text}: exact execution in many digits {far()}")

    return Scene.of(hsdsl.load(path), block=int(block), **sampling, watch=partial(running, named))


def _report(charted: list[tuple[str, list[Row]]], out: Path | None, plot: Path | None, answer: Answer) -> None:
    from hsdsl.interface.chart.rows import as_csv, as_text, record

    rows = [row for _, group in charted for row in group]
    write_table(out, lambda: as_csv(rows))
    if plot is not None:
        from hsdsl.interface.chart.picture import plot_work_precision

        plot_work_precision(plot, charted)
        say(f"wrote {plot}")
    answer.give(
        lambda: {"rows": [record(row) for row in rows]},
        lambda: "\n\n".join(f"{name}\n{as_text(group)}" for name, group in charted),
    )


def _numbers(text: str | None, name: str) -> tuple[float, ...]:
    try:
        numbers = tuple(float(part) for part in names_of(text))
    except ValueError:
        raise UsageError(f"{name}: expected numbers with commas between them, got '{text}'") from None
    if not all(0 < number < 1e300 for number in numbers):
        raise UsageError(f"{name}: expected positive numbers, got '{text}'")
    return numbers


MAP = (
    "The two axes: h, tolerance, relaxation, a parameter or initial.NAME, each with a range if you like:"
    " h=1e-4:1e-1:20,relaxation. Values are spaced logarithmically, or evenly with :lin. Default: h,relaxation."
)
SET_OF_MAPS = "Override a parameter, an initial value or a setting for every run. May be repeated."
AGAINST = "Peers (other tools) on maps of tolerance: scipy, heyoka, diffrax, sksundae, casadi; or all."


def stability(
    model: Model,
    *,
    map: Annotated[str | None, option("X,Y", MAP, "--map")] = None,
    scheme: Annotated[str | None, option("A,B", "Schemes of hsdsl. Default: the file's, or relaxed.")] = None,
    method: Annotated[str | None, option("A,B", "Methods of hsdsl. Default: rk4 for h, else auto.")] = None,
    against: Annotated[str | None, option("A,B", AGAINST)] = None,
    overrides: Annotated[list[str] | None, overriding(SET_OF_MAPS)] = None,
    patience: Annotated[float, option("S", "Time limit of a run, in processor seconds.")] = 10.0,
    processes: Annotated[int | None, option("N", "Number of processes. Default: one per core.")] = None,
    rho: Annotated[bool, Option(help="Compute rho for runs that reach their end.")] = True,
    out: Annotated[Path | None, option("FILE", "Write one line per run: .csv.")] = None,
    plot: Annotated[Path | None, option("FILE", "Draw the map: .png or .svg.")] = None,
    answer: Answer,
) -> None:
    """Map where methods converge, miss transitions, blow up or get stuck, against an exact or precise run."""
    with answer.reporting():
        from hsdsl.interface.chart import PEERS
        from hsdsl.interface.chart.stability import stability_map

        check_target(out, "--out", (".csv",))
        check_target(plot, "--plot")
        if not 0 < patience < 1e6 or (processes is not None and processes < 1):
            raise UsageError("--patience and --processes: expected positive numbers")
        options = values_of(overrides)
        by_set: dict[str, str] = options["settings"]
        options |= {
            "schemes": (by_set.pop("scheme", None) if scheme is None else scheme) or (),
            "methods": (by_set.pop("method", None) if method is None else method) or (),
            "against": ",".join(PEERS) if against == "all" else against or (),
        }
        with progress(answer.hidden) as show:

            def watch(done: int, count: int) -> None:
                if show:
                    show(lambda: f"{done} of {count} runs")

            given: dict[str, Any] = {"with_rho": rho, "processes": processes, "patience": patience, "watch": watch}
            given |= {} if map is None else {"map": map}
            found = stability_map(hsdsl.load(model), **options, **given)
        from hsdsl.interface.chart.stability import as_csv, as_plain, as_text

        write_table(out, lambda: as_csv(found))
        if plot is not None:
            from hsdsl.interface.chart.stability.picture import plot_stability

            plot_stability(plot, found)
            say(f"wrote {plot}")
        answer.give(lambda: as_plain(found), lambda: as_text(found))
