"""``hsdsl run --every K``: a run that goes to its file while it runs."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hsdsl.cli.console import progress, say
from hsdsl.names import visible

if TYPE_CHECKING:
    from hsdsl.execution import Stop
    from hsdsl.model.stream import Streamed


def streamed(
    path: Path,
    overrides: Sequence[str],
    asked: dict[str, Any],
    outputs: str | None,
    out: Path,
    every: int,
    json: bool,
    quiet: bool,
) -> Stop:
    """Run a model, its rows going to ``out``, and say what happened."""
    from hsdsl.cli.run import chosen_names
    from hsdsl.model import load, split_overrides
    from hsdsl.report import dumps

    model = load(path)
    parameters, initial, settings = split_overrides(overrides)
    asked = {name: value for name, value in asked.items() if value is not None and name != "precision"}
    asked |= {"parameters": parameters, "initial": initial, "settings": settings}
    with progress(quiet or json) as watch:
        run = model.stream(out, every=every, columns=chosen_names(outputs, model.columns), watch=watch, **asked)
    if json:
        print(dumps({"model": str(path), **as_json(run)}))
    elif not quiet:
        stop = f"{run.stop.reason}: {run.stop.message}"
        print(f"{run.rows} of {run.steps} rows written to {visible(str(run.path))}")
        print(f"stop      {stop}\ntransitions {run.transitions}")
    if not run.stop.complete and not json:
        say(f"hsdsl: stopped ({run.stop.reason}): {run.stop.message}")
    return run.stop


def as_json(run: Streamed) -> dict[str, Any]:
    """Return what is known of a streamed run; its transitions are in the file, so they are only counted."""
    final = run.final
    there = [name for name, present in zip(final.states, final.present[0], strict=True) if present]
    return {
        "engine": run.engine,
        "scheme": run.scheme,
        "method": run.method,
        "overrides": run.overrides,
        "stop": {"reason": run.stop.reason, "time": run.stop.time, "message": run.stop.message},
        "transition_count": run.transitions,
        "out": {"file": str(run.path), "rows": run.rows, "steps": run.steps},
        "final": {
            "time": float(final.time[0]),
            "mode": str(final.mode[0]),
            "state": {name: float(final[name][0]) for name in there},
            "outputs": {name: float(final[name][0]) for name in final.outputs},
        },
        "seconds": {"simulate": run.seconds},
    }
