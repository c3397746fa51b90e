"""Exports for MATLAB, run by GNU Octave."""

from __future__ import annotations

import subprocess
from dataclasses import dataclass
from pathlib import Path
from shutil import which
from typing import Any

from hsdsl.export import files_of, source_of, write

OCTAVE = which("octave-cli")
PRINT = """
for k = 1:numel(r.transitions)
  e = r.transitions(k);
  fprintf('T %.17g %.17g\\t%s\\t%s\\t%s\\t', e.time, e.resumed, e.edge, e.source, e.target);
  fprintf('%.17g ', e.before);
  fprintf('\\t');
  fprintf('%.17g ', e.after);
  fprintf('\\n');
end
fprintf('E %s %.17g\\t', r.stop, r.t(end));
fprintf('%.17g ', r.x(end, :));
fprintf('\\n');
"""


@dataclass(frozen=True)
class Made:
    """A transition as Octave printed it."""

    time: float
    resumed: float
    edge: str
    source: str
    target: str
    before: list[float]
    after: list[float]


@dataclass(frozen=True)
class Ran:
    """What Octave printed: transitions, why the run ended and when, mode and states."""

    transitions: list[Made]
    stop: str
    time: float
    x: list[float]


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


def ran(folder: Path, statement: str, timeout: float = 300) -> Ran:
    """Run a statement that makes ``r``, and read what it has."""
    made: list[Made] = []
    for line in evaluated(folder, statement + PRINT, timeout).splitlines():
        first, *parts = line.split("\t")
        if line.startswith("T "):
            time, resumed = map(float, first.split()[1:])
            before, after = ([float(v) for v in part.split()] for part in parts[3:])
            made.append(Made(time, resumed, parts[0], parts[1], parts[2], before, after))
        elif line.startswith("E "):
            _, stop, time = first.split()
            return Ran(made, stop, float(time), [float(v) for v in parts[0].split()])
    raise AssertionError("the run has no end")
