"""``hsdsl distance``: how far apart two states of a model are, or two saved runs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from hsdsl.cli.console import errors_reported
from hsdsl.errors import UsageError


def distance(
    first: Annotated[Path, typer.Argument(help="The model file, or a saved run (.npz).", metavar="A")],
    second: Annotated[Path | None, typer.Argument(help="A second saved run.", metavar="[B]")] = None,
    from_: Annotated[
        str | None,
        typer.Option(
            "--from", metavar="STATE", help='A mode and all its states: "free x=13 v=5"; values are expressions.'
        ),
    ] = None,
    to: Annotated[str | None, typer.Option(metavar="STATE", help="The other state.")] = None,
    metric: Annotated[
        str | None,
        typer.Option(
            metavar="NAME",
            help="Between states: quotient or relaxed. Between runs: rho, rho-hat, sup, skorokhod or tau-epsilon.",
        ),
    ] = None,
    relaxation: Annotated[
        str | None, typer.Option(metavar="EPS", help="Depth of the strips, for the relaxed metric; else the file's.")
    ] = None,
    set_: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="NAME=VALUE", help="Override a parameter. May be repeated."),
    ] = None,
    json: Annotated[bool, typer.Option("--json", help="Print one JSON object instead of the sentence.")] = False,
) -> None:
    """Measure how far apart two states, or two runs, are in the hybrid metric."""
    with errors_reported(json):
        parameters = _parameters(set_ or [])
        if second is not None:
            if from_ is not None or to is not None:
                raise UsageError("give two runs, or one model with --from and --to")
            of_runs(first, second, metric, relaxation, parameters, json)
        elif from_ is None or to is None:
            raise UsageError(
                "two states are wanted, or a second run",
                f'for example: hsdsl distance {first} --from "free x=13 v=5" --to "free x=13 v=-4"',
            )
        else:
            of_points(first, from_, to, metric, relaxation, parameters, json)


def of_points(
    path: Path, p: str, q: str, metric: str | None, relaxation: str | None, parameters: dict[str, str], json: bool
) -> None:
    """Measure between two states of a model."""
    from hsdsl.model import load
    from hsdsl.report import dumps

    name = metric or ("quotient" if relaxation is None else "relaxed")
    found = load(path).distance(p, q, metric=name, relaxation=relaxation, parameters=parameters)
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
    bounds = {"lower": found.interval.lower, "upper": found.interval.upper}
    print(dumps({**bounds, "metric": name, "certified": found.certified, "path": pieces}))


def of_runs(
    first: Path, second: Path, metric: str | None, relaxation: str | None, parameters: dict[str, str], json: bool
) -> None:
    """Measure between two saved runs."""
    from hsdsl.model.between_runs import distance_of_runs
    from hsdsl.report import dumps
    from hsdsl.store.npz import load

    depth = None if relaxation is None else _number(relaxation)
    runs = load(first), load(second)
    found = distance_of_runs(*runs, metric or "rho", relaxation=depth, parameters=parameters)
    if json:
        print(dumps(found.as_json()))
        return
    attained = "" if found.time is None else f", attained at t = {found.time:.10g}"
    print(
        f"{found.metric}: {found.upper:.10g}, in {found.interval}{attained}" + (f"\n{found.note}" if found.note else "")
    )


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise UsageError(f"--relaxation is a number here, not {text}") from None


def _parameters(pairs: list[str]) -> dict[str, str]:
    from hsdsl.model import split_overrides

    parameters, initial, settings = split_overrides(pairs)
    others: list[Any] = [*(f"initial.{name}" for name in initial), *(f"experiment.{name}" for name in settings)]
    if others:
        raise UsageError(f"a distance depends on parameters alone; --set {others[0]} has no meaning here")
    return parameters
