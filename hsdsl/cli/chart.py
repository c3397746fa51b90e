"""``hsdsl chart``: speed against accuracy, ours and others'."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from hsdsl.cli.console import FILE, errors_reported, say
from hsdsl.cli.limited import limited
from hsdsl.cli.streams import draw
from hsdsl.errors import UsageError
from hsdsl.names import did_you_mean, visible

if TYPE_CHECKING:
    from hsdsl.chart import Row


@click.command()
@click.argument(
    "models",
    nargs=-1,
    required=True,
    metavar="MODEL...",
    help="Model files; FILE:1 is the second start of its reference.",
)
@click.option("--schemes", metavar="A,B", help="Our schemes; all unless given.")
@click.option("--methods", metavar="A,B", help="Our methods; all unless given.")
@click.option("--engines", metavar="A,B", help="Our engines; all unless given.")
@click.option("--tolerances", metavar="A,B", help="For adaptive methods and peers.")
@click.option("--steps", metavar="A,B", help="For fixed-step methods.")
@click.option("--against", metavar="A,B", help="Peers to run: scipy, heyoka, diffrax, sksundae, casadi; or all.")
@click.option("--states", metavar="A,B", help="Take the error of these states only.")
@click.option("--samples", metavar="N", default=2000, help="How many samples the error is taken at.")
@click.option("--clearance", metavar="DT", default=1e-4, help="Samples nearer than this to an exact jump do not count.")
@click.option("--digits", metavar="N", default=8, help="Digits of the reference where no exact execution is known.")
@click.option("--rounds", metavar="N", default=5, help="Timed turns, after one that warms up.")
@click.option("--patience", metavar="S", default=10.0, help="Slower tools get no tighter setting.")
@click.option("--rho/--no-rho", default=True, help="Also compute rho of our runs.")
@click.option("--out", type=FILE, metavar="FILE", help="Write the table: .csv.")
@click.option("--plot", type=FILE, metavar="FILE", help="Draw the chart: .png or .svg.")
@click.option("--json", is_flag=True, help="Print one JSON object instead of the table.")
@click.option("--quiet", "-q", is_flag=True, help="Print no table and no progress.")
@limited
def chart(
    models: tuple[str, ...],
    schemes: str | None,
    methods: str | None,
    engines: str | None,
    tolerances: str | None,
    steps: str | None,
    against: str | None,
    states: str | None,
    samples: int,
    clearance: float,
    digits: int,
    rounds: int,
    patience: float,
    rho: bool,
    out: Path | None,
    plot: Path | None,
    json: bool,
    quiet: bool,
) -> None:
    """Chart speed against accuracy: methods, schemes, engines and peers against the exact execution."""
    with errors_reported(json):
        from hsdsl.chart import ENGINES, PEERS, SCHEMES, TOLERANCES, work_precision
        from hsdsl.integrators import METHODS

        _check_suffix(out, "--out", (".csv",))
        _check_suffix(plot, "--plot", (".png", ".svg"))
        asked: dict[str, Any] = {
            "schemes": _names(schemes, SCHEMES, "--schemes") or SCHEMES,
            "methods": _names(methods, tuple(METHODS), "--methods"),
            "engines": _names(engines, ENGINES, "--engines") or ENGINES,
            "tolerances": _numbers(tolerances, "--tolerances") or TOLERANCES,
            "steps": _numbers(steps, "--steps"),
            "against": _names(",".join(PEERS) if against == "all" else against, tuple(PEERS), "--against"),
            "rounds": rounds,
            "patience": patience,
            "with_rho": rho,
        }
        found: list[tuple[str, list[Row]]] = []
        with _progress(quiet or json) as watch:
            taken = {"states": _split(states), "samples": samples, "clearance": clearance, "digits": digits}
            for scene in [_scene(text, taken, watch) for text in models]:
                rows, remarks = work_precision(
                    scene, **asked, watch=lambda what, name=scene.name: watch(f"{name}: {what}")
                )
                found.append((scene.name, rows))
                for remark in remarks if not quiet else ():
                    say(f"left out: {remark}")
        _report(found, out, plot, json, quiet)


def _scene(text: str, taken: dict[str, Any], watch: Callable[[str], None]) -> Any:
    from hsdsl.chart import Scene
    from hsdsl.model import load

    watch(f"{text}: the exact execution (where no formula is known, in many digits)")
    path, colon, block = text.rpartition(":")
    if not (colon and block.isdecimal()):
        path, block = text, "0"
    return Scene.of(load(path), block=int(block), **taken)


def _report(found: list[tuple[str, list[Row]]], out: Path | None, plot: Path | None, json: bool, quiet: bool) -> None:
    from hsdsl.chart.picture import panels
    from hsdsl.chart.table import as_csv, as_text, record
    from hsdsl.report import dumps
    from hsdsl.store import forget_sidecar
    from hsdsl.store.atomic import replacing

    rows = [row for _, group in found for row in group]
    if out is not None:
        with replacing(out) as file:
            file.write(as_csv(rows).encode())
            forget_sidecar(out)
        say(f"wrote {out}")
    if plot is not None:
        from hsdsl.plot.work_precision import plot_work_precision

        plot_work_precision(plot, [panels(name, group) for name, group in found])
        say(f"wrote {plot}")
    if json:
        print(dumps({"rows": [record(row) for row in rows]}))
    elif not quiet:
        print("\n\n".join(f"{name}\n{as_text(group)}" for name, group in found))


def _silence(text: str) -> None:
    pass


class _progress:
    """One line on a terminal that says what is running."""

    def __init__(self, quiet: bool) -> None:
        self._shown = not quiet and sys.stderr.isatty()

    def __enter__(self) -> Any:
        return self._say if self._shown else _silence

    def _say(self, text: str) -> None:
        draw(f"\r\x1b[K{visible(text[:100])}")

    def __exit__(self, *_: object) -> None:
        if self._shown:
            draw("\r\x1b[K")


def _split(text: str | None) -> list[str]:
    return [part.strip() for part in (text or "").split(",") if part.strip()]


def _names(text: str | None, known: tuple[str, ...], option: str) -> tuple[str, ...]:
    names = _split(text)
    for name in names:
        if name not in known:
            raise UsageError(f"{option}: there is no '{name}'", did_you_mean(name, known))
    return tuple(names)


def _numbers(text: str | None, option: str) -> tuple[float, ...]:
    try:
        numbers = tuple(float(part) for part in _split(text))
    except ValueError:
        raise UsageError(f"{option} wants numbers with commas between them, not '{text}'") from None
    if not all(0 < number < 1e300 for number in numbers):
        raise UsageError(f"{option} wants positive numbers, not '{text}'")
    return numbers


def _check_suffix(path: Path | None, option: str, suffixes: tuple[str, ...]) -> None:
    if path is not None and path.suffix.lower() not in suffixes:
        raise UsageError(f"{option} {path}: the name must end in {' or '.join(suffixes)}")
    if path is not None and not path.parent.is_dir():
        raise UsageError(f"{option} {path}: there is no folder {path.parent}")
