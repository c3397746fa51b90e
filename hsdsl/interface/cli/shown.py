"""What ``hsdsl run`` draws of a run: columns, pairs, a film; refused before the run where it cannot be drawn."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from hsdsl.base.errors import UsageError
from hsdsl.base.progress import counted
from hsdsl.interface.cli.console import progress, say

if TYPE_CHECKING:
    from hsdsl.interface.model import Model


def shown_of(
    model: Model,
    names: list[str] | None,
    pairs: list[tuple[str, str]] | None,
    plot: Path | None,
    animate: Path | None,
    speed: float | None,
) -> dict[str, Any]:
    """What of the run is shown; refuse what cannot be drawn before the run."""
    if pairs is not None and plot is None:
        raise UsageError("--phase is for a picture: give --plot FILE too")
    if speed is not None and animate is None:
        raise UsageError("--speed is of a film: give --animate FILE too")
    if animate is not None:
        from hsdsl.analysis.plot.animation import check

        check(animate)
        model.check_scene()
    return {"columns": names, "phases": pairs}


def needed(shown: dict[str, Any]) -> list[str] | None:
    """The states and outputs that files and pictures need; None for all."""
    if shown["columns"] is None:
        return None
    return [*shown["columns"], *(name for pair in shown["phases"] or () for name in pair)]


def write_film(model: Model, path: Path, speed: float | None, settings: dict[str, Any], quiet: bool) -> None:
    """Write the film."""
    with progress(quiet) as show:
        model.animate(path, speed=speed, progress=counted(show, "frames"), **(settings | {"watch": None}))
    say(f"wrote {path}")
