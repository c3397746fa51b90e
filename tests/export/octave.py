"""Exports for MATLAB, run by GNU Octave, and compared with runs."""

from __future__ import annotations

import os
import subprocess
from collections.abc import Sequence
from math import isnan
from pathlib import Path
from shutil import which
from typing import Any

from export.c_builds import cached_compiler

from hsdsl.export import files_of, source_of, write

OCTAVE = which("octave-cli")
PRINT = """
line = @(name, x) fprintf('%s\\t%s\\n', name, sprintf('%.17g ', x));
for k = 1:numel(r.transitions)
  e = r.transitions(k);
  fprintf('%s\\t%s\\t%s\\n', e.edge, e.source, e.target);
  line('numbers', [e.time, e.resumed, e.entry]);
  line('before', e.before);
  line('after', e.after);
end
fprintf('%s\\n', r.stop);
line('t', r.t);
line('j', r.j);
line('x', r.x(end, 2:end));
"""


def exported(model: Any, folder: Path, **arguments: Any) -> str:
    """Export a model to a folder; return the name that its functions begin with."""
    source = source_of(model, arguments)
    write(files_of(source, "matlab"), folder, force=True)
    return next(path.name.removesuffix("_model.m") for path in folder.glob("*_model.m"))


def evaluated(folder: Path, text: str, **environment: str) -> str:
    """The standard output of statements."""
    assert OCTAVE is not None
    command, given = [OCTAVE, "--norc", "--no-history", "--eval", text], {"CC": cached_compiler(), **environment}
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=300, env={**os.environ, **given})
    assert done.returncode == 0, done.stderr[-2000:] + done.stdout[-500:]
    assert "warning" not in done.stderr, done.stderr[:2000]
    return done.stdout


def assert_runs(model: Any, folder: Path, statement: str = "", given: Any = None, **arguments: Any) -> Any:
    """A run and what an export gives, which must be equal; ``statement`` makes ``r``, ``given`` is what it sets."""
    name = exported(model, folder, **arguments)
    run = model.simulate(**{**arguments, **(given or {}), "engine": "c"})
    program = source_of(model, arguments).problem.program
    text = (statement or "r = NAME_run();").replace("NAME", name) + PRINT
    *lines, stop, times, jumps, last = evaluated(folder, text).splitlines()
    assert stop == run.stop.reason
    assert numbers(times) == run.times.tolist()
    assert numbers(jumps) == [arc.jump for arc in run.arcs for _ in range(arc.first, arc.last + 1)]
    states: Sequence[str] = source_of(model, arguments).problem.states
    assert len(lines) == 4 * len(run.transitions)
    for made, (names, *rest) in zip(run.transitions, zip(*(lines[k::4] for k in range(4)), strict=True), strict=True):
        found, before, after = map(numbers, rest)
        assert names.split("\t") == [made.edge, made.source, made.target]
        mode = program.modes[0 if program.parts else program.mode_names.index(made.source)]
        assert same(made.before, mode.states, before)
        assert found[0::2] == [made.time, made.entry]
        if made.resumed is None:
            assert isnan(found[1])
            continue
        assert found[1] == made.resumed
        states = next(edge.target_states for edge in mode.edges if edge.name == made.edge)
        assert same(made.after, states, after)
    assert same(run.final.state, states, numbers(last))
    return run


def numbers(line: str) -> list[float]:
    """The numbers of a line, behind its name."""
    return [float(word) for word in line.partition("\t")[2].split()]


def same(ours: Any, names: Sequence[str], theirs: Sequence[float]) -> bool:
    """Whether the states by name are those numbers; of a system of parts a mode has some of them."""
    found = dict(zip(names, theirs, strict=False))
    return {name: found[name] for name in ours} == {name: float(value) for name, value in ours.items()}
