"""Completions of model files, names of ``--set``, and rule codes, for shells."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from typer import Context

from hsdsl.base.errors import CODES, WARNINGS, ModelError, UsageError
from hsdsl.base.names import without_memory

SUFFIXES = (".yaml", ".yml")


def model_files(incomplete: str) -> list[str]:
    """Model files, and folders; the content of a folder where it is the only candidate."""
    while True:
        head, _, start = incomplete.rpartition("/")
        prefix = incomplete[: len(incomplete) - len(start)]
        folder = Path(head or ("/" if prefix else "."))
        candidates = sorted(
            f"{prefix}{path.name}{'/' * path.is_dir()}"
            for path in (folder.iterdir() if folder.is_dir() else ())
            if path.name.startswith(start) and (path.is_dir() or path.suffix in SUFFIXES)
            if start.startswith(".") or not path.name.startswith(".")
        )
        if len(candidates) != 1 or not candidates[0].endswith("/"):
            return candidates
        incomplete = candidates[0]


def override_names(ctx: Context, incomplete: str) -> list[str]:
    """Names for ``--set`` of the model on the command line, with ``=``."""
    try:  # the option has no value yet, so the words before it are not assigned to arguments
        return [f"{name}=" for word in ctx.args[:1] for name in _names(Path(word)) if name.startswith(incomplete)]
    except (ModelError, UsageError):
        return []


def _names(path: Path) -> Iterator[str]:
    from hsdsl.engine.preparation.options import KEYS
    from hsdsl.interface.model import load

    program = load(path).program
    states = without_memory(program.modes[program.initial_mode].states)
    yield from program.parameters
    yield from ("initial.mode", *(f"initial.{state}" for state in states))
    yield from (f"experiment.{name}" for name in KEYS)


def rule_codes(incomplete: str) -> list[tuple[str, str]]:
    """Codes of lint rules with their titles, after the last comma."""
    listed, comma, _ = incomplete.rpartition(",")
    return [(f"{listed}{comma}{code}", title) for code, title in codes() if code not in {*CODES, *WARNINGS}]


def codes() -> list[tuple[str, str]]:
    """Codes of errors, warnings of runs and lint rules with their titles."""
    from hsdsl.analysis.lint.pages import titles

    return list(titles().items())
