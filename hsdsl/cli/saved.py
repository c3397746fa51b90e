"""Runs that a command names: saved ones, or models, which are run as their own experiments say."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from hsdsl.errors import UsageError

if TYPE_CHECKING:
    from hsdsl.execution import Execution
    from hsdsl.model import Model


def run_of(path: Path, parameters: dict[str, Any]) -> tuple[Execution, Model | Path | None]:
    """Return a run, and its model where its path is not the recorded one."""
    if path.suffix.lower() == ".npz":
        from hsdsl.store import load

        run = load(path)
        neighbour = path.parent / Path(run.model).name
        return run, neighbour if not Path(run.model).exists() and neighbour.exists() else None
    if path.suffix.lower() in (".csv", ".parquet"):
        raise UsageError(f"{path} is a table: expected a run", "save runs with --out RUN.npz, which loses nothing")
    from hsdsl.model import load as load_model

    model = load_model(path)  # read once: it may come through a pipe
    return model.simulate(parameters=parameters), model
