"""``hsdsl distance A B``: how far apart two runs are, saved ones or a model's own experiment."""

from __future__ import annotations

import sys
from collections.abc import Callable, Generator, Sequence
from contextlib import contextmanager
from pathlib import Path
from time import monotonic
from typing import TYPE_CHECKING, Any

from hsdsl.cli.console import FIRST_SIGN, INTERVAL, say
from hsdsl.cli.streams import draw
from hsdsl.errors import UsageError

if TYPE_CHECKING:
    from hsdsl.execution import Execution
    from hsdsl.model import Model

PICTURES = (".png", ".svg")


def of_runs(
    first: Path,
    second: Path,
    metric: str | None,
    json: bool,
    options: dict[str, Any],
    coordinates: Sequence[str] | None = None,
    plot: Path | None = None,
) -> None:
    """Measure between two runs; a model file stands for the run of its own experiment.

    ``options`` are ``relaxation``, ``parameters``, ``hops`` and ``seconds``.
    """
    from hsdsl.model.distances import distance_of_runs as distance
    from hsdsl.report import dumps

    check_picture(plot)
    (run, model), (other, _) = (_run(path, options["parameters"]) for path in (first, second))
    options = {**options, "model": model}
    with _progress() as watch:
        found = distance(run, other, metric or "rho", coordinates=coordinates, watch=watch, **options)
    if plot is not None:
        from hsdsl.model.distances import plot_distance

        plot_distance(run, other, plot, **options)
        say(f"wrote {plot}")
    print(dumps(found.as_json()) if json else found.sentence)


def check_picture(plot: Path | None) -> None:
    """Refuse a name that does not say what to draw.

    Raises
    ------
    UsageError
        Another suffix than those of ``PICTURES``.
    """
    if plot is not None and plot.suffix.lower() not in PICTURES:
        raise UsageError(f"--plot {plot}: the name should end in .png or .svg")


@contextmanager
def _progress() -> Generator[Callable[[float, float], None] | None]:
    """Show what is known so far, on a terminal, once it takes longer than a moment."""
    if not sys.stderr.isatty():
        yield None
        return
    due = monotonic() + FIRST_SIGN

    def watch(lower: float, upper: float) -> None:
        nonlocal due
        if monotonic() >= due:
            due = monotonic() + INTERVAL
            draw(f"\rat least {lower:.4g}, at most {upper:.4g} so far\x1b[K")

    try:
        yield watch
    finally:
        draw("\r\x1b[K")


def _run(path: Path, parameters: dict[str, Any]) -> tuple[Execution, Model | Path | None]:
    """A run and the model that it is of, where that is not where the run says."""
    if path.suffix.lower() == ".npz":
        from hsdsl.store import load

        run = load(path)
        return run, _model_beside(path, run)
    from hsdsl.model import load as load_model

    model = load_model(path)  # read once: it may come through a pipe
    return model.simulate(parameters=parameters), model


def _model_beside(path: Path, run: Execution) -> Path | None:
    """Return where the model is: where the run says, or else in the folder of the saved run."""
    beside = path.parent / Path(run.model).name
    return beside if not Path(run.model).exists() and beside.exists() else None
