"""``hsdsl stability``: where methods converge, and how they fail, over a plane of settings and numbers."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

from typer import Option

from hsdsl.base.errors import UsageError
from hsdsl.interface.cli.console import progress, say, write_table
from hsdsl.interface.cli.options import Answer, Model, option, overriding, values_of
from hsdsl.interface.cli.texts import check_target

MAP = (
    "Two of h, tolerance, relaxation, parameters and initial.NAME, each with its range if not the default:"
    " h=1e-4:1e-1:20,relaxation. Values are spaced logarithmically, with :lin evenly. Left out, h,relaxation."
)
SET = "Override a parameter, an initial value or a setting for every run. May be repeated."
AGAINST = "Peers, on maps of tolerance: scipy, heyoka, diffrax, sksundae, casadi; or all."


def stability(
    model: Model,
    *,
    map: Annotated[str | None, option("X,Y", MAP, "--map")] = None,
    scheme: Annotated[str | None, option("A,B", "Our schemes; else relaxed on maps of it, and the file's.")] = None,
    method: Annotated[str | None, option("A,B", "Our methods; else rk4 on maps of h, and auto.")] = None,
    against: Annotated[str | None, option("A,B", AGAINST)] = None,
    overrides: Annotated[list[str] | None, overriding(SET)] = None,
    patience: Annotated[float, option("S", "Processor seconds of a run; a longer one is stuck.")] = 10.0,
    processes: Annotated[int | None, option("N", "How many at a time; else as many as there are cores.")] = None,
    rho: Annotated[bool, Option(help="Compute rho of runs that get to the end.")] = True,
    out: Annotated[Path | None, option("FILE", "Write a line for each run: .csv.")] = None,
    plot: Annotated[Path | None, option("FILE", "Draw the map: .png or .svg.")] = None,
    answer: Answer,
) -> None:
    """Map where methods converge, miss transitions, blow up or get stuck, against an exact or precise run."""
    with answer.reporting():
        from hsdsl.interface.chart import PEERS
        from hsdsl.interface.chart.stability import stability_map
        from hsdsl.interface.model import load

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
            found = stability_map(load(model), **options, **given)
        _report(found, out, plot, answer)


def _report(found: Any, out: Path | None, plot: Path | None, answer: Answer) -> None:
    from hsdsl.interface.chart.stability.table import as_csv, as_plain, as_text

    write_table(out, lambda: as_csv(found))
    if plot is not None:
        from hsdsl.interface.chart.stability.picture import plot_stability

        plot_stability(plot, found)
        say(f"wrote {plot}")
    answer.give(lambda: as_plain(found), lambda: as_text(found))
