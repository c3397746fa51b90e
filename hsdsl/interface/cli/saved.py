"""Runs that a command names: saved ones, or models, which are run as their own experiments say."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from hsdsl.base.errors import ModelError, UsageError
from hsdsl.interface.cli.console import say

if TYPE_CHECKING:
    from hsdsl.engine.execution import Execution
    from hsdsl.interface.model import Model


def run_of(path: Path, parameters: dict[str, Any]) -> tuple[Execution, Model | Path | None]:
    """Return a run, and its model where its path is not the recorded one."""
    if path.suffix.lower() == ".npz":
        from hsdsl.analysis.store import load

        run = load(path)
        neighbour = path.parent / Path(run.model).name
        return run, neighbour if not Path(run.model).exists() and neighbour.exists() else None
    if path.suffix.lower() in (".csv", ".parquet"):
        raise UsageError(f"{path} is a table: expected a run", "save runs with --out RUN.npz, which loses nothing")
    from hsdsl.interface.model import load as load_model

    model = load_model(path)  # read once: it may come through a pipe
    return model.simulate(parameters=parameters), model


def drawn(path: Path, model: Model | None, columns: list[str] | None) -> Execution:
    """Return a run with its outputs between rows, as far as ``columns`` has some, or is None.

    Those of a saved run are computed by its model. Where that is not known, a message says that they are straight.
    """
    run, other = run_of(path, {})
    outputs = run.output_names if columns is None else set(columns) & set(run.output_names)
    if run.output_function is not None or not outputs:
        return run
    try:
        return (model or _recorded(run.model, other)).with_outputs(run)
    except (UsageError, ModelError) as error:
        first = str(error).splitlines()[0]
        say(f"hsdsl: {path}: outputs are drawn straight from row to row: {first}; give its model with --model")
        return run


def _recorded(path: str, other: Model | Path | None) -> Model:
    from hsdsl.interface.model import load

    return load(other if isinstance(other, Path) else path)
