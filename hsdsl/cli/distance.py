"""``hsdsl distance``: how far apart two states of a model are, or two saved runs."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import click

from hsdsl.cli.console import FILE, errors_reported, say
from hsdsl.cli.distance_runs import check_picture, of_runs
from hsdsl.cli.limited import limited
from hsdsl.errors import UsageError


@click.command()
@click.argument(
    "first",
    type=FILE,
    metavar="A",
    help="The model file, or a run: a saved one (.npz), or a model's own experiment.",
)
@click.argument("second", type=FILE, metavar="[B]", required=False, help="A second run.")
@click.option(
    "--from", "start", metavar="STATE", help='A mode and all its states: "free x=13 v=5"; values are expressions.'
)
@click.option("--to", "end", metavar="STATE", help="The other state.")
@click.option(
    "--metric",
    metavar="NAME",
    help="Between states: quotient or relaxed. Between runs: rho, rho-hat, sup, skorokhod or tau-epsilon.",
)
@click.option("--relaxation", metavar="EPS", help="Depth of the strips, for the relaxed metric; else the file's.")
@click.option("--set", "overrides", multiple=True, metavar="NAME=VALUE", help="Override a parameter. May be repeated.")
@click.option("--coordinates", metavar="A,B", help="For rho-hat: the states that count as the position.")
@click.option(
    "--plot",
    type=FILE,
    metavar="FILE",
    help="Draw the distance of two runs over time, or the shortest path in the plane: .png or .svg.",
)
@click.option(
    "--hops",
    type=int,
    metavar="N",
    help="The most passages of a path; else eight more than the fewest that connect the modes.",
)
@click.option(
    "--seconds",
    metavar="S",
    default=60.0,
    help="About how long the search may take; what is then still open stays open.",
)
@click.option("--json", is_flag=True, help="Print one JSON object instead of the sentence.")
@limited
def distance(
    first: Path,
    second: Path | None,
    start: str | None,
    end: str | None,
    metric: str | None,
    relaxation: str | None,
    overrides: tuple[str, ...],
    coordinates: str | None,
    plot: Path | None,
    hops: int | None,
    seconds: float,
    json: bool,
) -> None:
    """Measure how far apart two states, or two runs, are in the hybrid metric."""
    with errors_reported(json):
        parameters = _parameters(overrides)
        options = {"relaxation": relaxation, "parameters": parameters, "hops": hops, "seconds": seconds}
        if second is not None:
            if start is not None or end is not None:
                raise UsageError("give two runs, or one model with --from and --to")
            names = None if coordinates is None else [name.strip() for name in coordinates.split(",")]
            of_runs(first, second, metric, json, options, names, plot)
        elif first.suffix.lower() == ".npz":
            hint = "give a second run, or the model file with --from and --to"
            raise UsageError(f"{first} is a run: two runs, or a model and two states, are wanted", hint)
        elif coordinates is not None:
            raise UsageError("--coordinates is for two runs")
        elif start is None or end is None:
            raise UsageError("two states are wanted, or a second run", _example(first))
        else:
            check_picture(plot)
            of_points(first, start, end, metric, json, {**options, "plot": plot})


def _example(path: Path) -> str:
    from hsdsl.model import load

    program = load(path).program
    mode = program.modes[program.initial_mode]
    two = (f'"{mode.name} {" ".join(f"{state}={number}" for state in mode.states)}"' for number in (0, 1))
    return "for example: hsdsl distance {} --from {} --to {}".format(path, *two)


def of_points(path: Path, p: str, q: str, metric: str | None, json: bool, options: dict[str, Any]) -> None:
    """Measure between two states of a model."""
    from hsdsl.model import load
    from hsdsl.report import dumps

    name = metric or ("quotient" if options["relaxation"] is None else "relaxed")
    found = load(path).distance(p, q, metric=name, **options)
    if options["plot"] is not None:
        say(f"wrote {options['plot']}")
    if not json:
        print(found.sentence)
        return
    pieces = [
        {
            "mode": piece.mode, "from": list(piece.start), "to": list(piece.end),
            "edge": piece.edge, "forward": None if piece.edge is None else piece.forward,
        }
        for piece in found.path
    ]  # fmt: skip
    bounds = {"lower": found.interval.lower, "upper": found.interval.upper, "status": found.status}
    print(dumps({**bounds, "metric": name, "certified": found.certified, "path": pieces}))


def _parameters(pairs: Sequence[str]) -> dict[str, str]:
    from hsdsl.model import split_overrides

    parameters, initial, settings = split_overrides(pairs)
    others: list[Any] = [*(f"initial.{name}" for name in initial), *(f"experiment.{name}" for name in settings)]
    if others:
        raise UsageError(f"a distance depends on parameters alone; --set {others[0]} has no meaning here")
    return parameters
