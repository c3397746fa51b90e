"""``hsdsl distance A B``: how far apart two runs are, saved ones or a model's own experiment."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from hsdsl.cli.console import say
from hsdsl.errors import UsageError
from hsdsl.execution import Execution

PICTURES = (".png", ".svg")


def of_runs(
    first: Path,
    second: Path,
    metric: str | None,
    relaxation: str | None,
    parameters: dict[str, Any],
    json: bool,
    coordinates: Sequence[str] | None = None,
    plot: Path | None = None,
) -> None:
    """Measure between two runs; a model file stands for the run of its own experiment."""
    from hsdsl.model.between_runs import distance
    from hsdsl.report import dumps

    if plot is not None and plot.suffix.lower() not in PICTURES:
        raise UsageError(f"--plot {plot}: the name should end in .png or .svg")
    run, other = _run(first, parameters), _run(second, parameters)
    model = _model_beside(first, run)
    options: dict[str, Any] = {"relaxation": relaxation, "model": model, "parameters": parameters}
    found = distance(run, other, metric or "rho", coordinates=coordinates, **options)
    if plot is not None:
        from hsdsl.model.between_runs import plot_distance

        plot_distance(run, other, plot, **options)
        say(f"wrote {plot}")
    if json:
        print(dumps(found.as_json()))
        return
    print(found.sentence)


def _run(path: Path, parameters: dict[str, Any]) -> Execution:
    if path.suffix.lower() == ".npz":
        from hsdsl.store import load

        return load(path)
    from hsdsl.model import load as load_model

    return load_model(path).simulate(parameters=parameters)


def _model_beside(path: Path, run: Execution) -> Path | None:
    """Return where the model is: where the run says, or else in the folder of the saved run."""
    beside = path.parent / Path(run.model).name
    return beside if not Path(run.model).exists() and beside.exists() else None
