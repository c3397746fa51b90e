"""Exports for MATLAB, run by GNU Octave."""

from __future__ import annotations

import subprocess
from pathlib import Path
from shutil import which
from typing import Any

from hsdsl.export import files_of, source_of, write

OCTAVE = which("octave-cli")


def exported(model: Any, folder: Path, **arguments: Any) -> str:
    """Export a model to a folder; return the name that its functions begin with."""
    source = source_of(model, arguments)
    write(files_of(source, "matlab"), folder, force=True)
    return next(path.name.removesuffix("_model.m") for path in folder.glob("*_model.m"))


def evaluated(folder: Path, text: str, timeout: float = 300) -> str:
    """The standard output of statements."""
    assert OCTAVE is not None
    command = [OCTAVE, "--norc", "--no-history", "--eval", text]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=timeout)
    assert done.returncode == 0, done.stderr[-2000:] + done.stdout[-500:]
    assert "warning" not in done.stderr, done.stderr[:2000]
    return done.stdout
