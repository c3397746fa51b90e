"""``Model.sweep``: chunks of rows, each an ensemble, made here or at a cluster, and gathered in a dataset."""

from __future__ import annotations

import math
import re
import time
from collections.abc import Callable, Generator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from hsdsl.analysis.sweep import Recording, Sweep, variation
from hsdsl.analysis.sweep import manifest as manifests
from hsdsl.analysis.sweep.dataset import Run, damaged, encoded, run_here, write_chunk
from hsdsl.analysis.sweep.manifest import Manifest, library, refused, table
from hsdsl.base.errors import UsageError
from hsdsl.base.limits import cores
from hsdsl.base.names import INITIAL, without_memory
from hsdsl.base.parts import meant, of_all
from hsdsl.base.processes import can_fork
from hsdsl.engine.preparation.options import KEYS, as_written, check_arguments, overrides_of
from hsdsl.engine.preparation.values import Values
from hsdsl.interface.model.ensemble import NothingToRunError, Progress, run_ensemble

if TYPE_CHECKING:
    from hsdsl.interface.model.runs import Runs


def sweep(
    model: Runs,
    folder: Path,
    cluster: str | None,
    processes: int | None,
    chunk: int | None,
    progress: Progress | None,
    check: Callable[[Manifest], None] | None = None,
    **asked: Any,
) -> Sweep:
    """Run a sweep, or what is missing of it; what is ``asked`` for is in its manifest, which ``check`` may refuse."""
    library("pyarrow.parquet")
    model = model if asked["outputs"] is None else model.only(asked["outputs"])
    planned = _planned(model, chunk, **asked)
    if check is not None:
        check(planned)
    with _place(cluster, processes or cores()) as run:
        work, missing = _begun(model, planned, folder, chunk, processes or cores(), cluster is None)
        found = Sweep(folder, work.manifest)
        done = found.rows - sum(last - first for first, last in map(work.manifest.rows_of, missing))

        def write(number: int, content: bytes) -> None:
            nonlocal done
            write_chunk(folder, number, content)
            first, last = work.manifest.rows_of(number)
            done += last - first
            if progress is not None:
                progress(done, found.rows)

        if progress is not None:
            progress(done, found.rows)
        if missing:
            run(work, missing, write)
    return Sweep(folder, work.manifest)


@contextmanager
def _place(cluster: str | None, processes: int) -> Generator[Run]:
    """What makes chunks: processes here, or a cluster."""
    if cluster is None:
        yield partial(run_here, processes=processes if can_fork() else 1)
        return
    from hsdsl.engine.execution.records import optional

    optional("distributed", "a sweep on a cluster", "cluster")
    from hsdsl.analysis.sweep.cluster import connected

    with connected(cluster) as run:
        yield run


def _planned(
    model: Runs,
    chunk: int | None,
    vary: Sequence[str] | Mapping[str, Any],
    random: int | None,
    seed: int,
    record: str | Sequence[str],
    outputs: Sequence[str] | None,
    arguments: Mapping[str, Any],
) -> Manifest:
    """The manifest of a sweep that is still to be measured."""
    given = {
        name: value
        for name, value in arguments.items()
        if value not in (None, {}) and (name, value) != ("engine", "auto")
    }
    check_arguments(given, "a sweep", without=("samples", "precision"))
    fixed: dict[str, Mapping[str, Any]] = {group: given.get(group) or {} for group in ("parameters", "initial")}
    values = model.pipeline.values(parameters=overrides_of(given, "parameters", model.program))
    vary = _with_ranges(values, vary, given.get("initial") or {})
    varied = variation.read(vary, random, seed, lambda value, where: float(values.number(value, where)))
    _check_names(model, varied.names, fixed)
    if chunk is not None and chunk < 1:
        raise UsageError(f"--chunk: expected at least 1 row, got {chunk}")
    program = model.program
    states = without_memory(program.all_states)
    kept = {name for name in (*states, *program.outputs) if outputs is None or name in outputs}
    return manifests.new(
        model=program.path,
        digest=program.digest,
        title=program.title,
        units=program.units,
        variation=varied,
        recording=Recording.read(record),
        arguments={name: _as_data(value) for name, value in given.items()},
        states=tuple(name for name in states if name in kept),
        outputs=tuple(name for name in program.outputs if name in kept),
        chunk=chunk or 1,
    )


def _with_ranges(values: Values, vary: Sequence[str] | Mapping[str, Any], fixed: Mapping[str, Any]) -> Any:
    """What varies, and the initial values that have a range and are neither varied nor given: draws from it."""
    names = values.program.ranges
    if not names:
        return vary
    ends = zip(names, values.constant("least"), values.constant("most"), strict=True)
    if isinstance(vary, str):
        vary = [vary]
    given = [re.split("[=~]", entry)[0].strip() for entry in vary]
    draws = {
        f"{INITIAL}{name}": f"~uniform({float(low)!r}, {float(high)!r})"
        for name, low, high in ends
        if low < high and name not in fixed and f"{INITIAL}{name}" not in given
    }
    return {**vary, **draws} if isinstance(vary, Mapping) else [*vary, *(n + draw for n, draw in draws.items())]


def _as_data(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {name: as_written(item) for name, item in cast("Mapping[str, Any]", value).items()}
    return as_written(value)


def _check_names(model: Runs, names: Sequence[str], fixed: Mapping[str, Mapping[str, Any]]) -> None:
    """Refuse what cannot be varied, and what is given as well."""
    program = model.program
    known = [*program.parameters, *(f"{INITIAL}{state}" for state in program.all_states)]
    for name in names:
        if name not in known and name not in map(of_all, known):
            settings = name.removeprefix("experiment.") in KEYS
            hint = "until and relaxation may be expressions of a parameter that varies" if settings else None
            message = f"--vary: the model has no parameter or initial value '{name}'"
            raise UsageError(message, hint or meant(name, known))
        group = "initial" if name.startswith(INITIAL) else "parameters"
        if name.removeprefix(INITIAL) in fixed[group]:
            raise UsageError(f"{name} is both set and varied", "leave one of them out")


def _begun(
    model: Runs, planned: Manifest, folder: Path, chunk: int | None, processes: int, here: bool
) -> tuple[ChunkWork, list[int]]:
    """The work of a sweep that goes on in a folder, or begins there, and the chunks that are missing."""
    threads = processes if here and not can_fork() else 1
    if (folder / manifests.FILE).exists():
        there = manifests.read(folder)
        there.check_same(planned, folder)
        if chunk not in (None, there.chunk):
            raise UsageError(f"{folder} has chunks of {there.chunk} rows, not {chunk}", "leave --chunk out to go on")
        found = Sweep(folder, there)
        broken = set(damaged(found))
        return ChunkWork(model, there, threads), [
            k for k in range(there.chunks) if k in broken or k not in found.chunks
        ]
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise UsageError(f"{folder} is not an empty folder", "choose another one")
    work = ChunkWork(model, planned)
    size = chunk_size(work, processes)
    manifest = replace(planned, chunk=chunk or size)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UsageError(f"{folder} cannot be made: {error.strerror or error}") from None
    manifest.write(folder)
    return ChunkWork(model, manifest, threads), list(range(manifest.chunks))


PROBES, BYTES, MOST_ROWS = 16, 64e6, 100_000
SECONDS, LEAST_SECONDS = 2.0, 0.25  # of a chunk, which takes 0.01 s besides its rows
PROBED, GROWTH = 0.004, 8  # seconds that tell how long a row takes, and by how much more rows are tried for them
CHUNKS_A_CORE = 16  # so that no core waits long for the last chunk


@dataclass(frozen=True, eq=False)
class ChunkWork:
    """What makes a chunk: it can be sent to other processes and machines."""

    model: Runs
    manifest: Manifest
    threads: int = 1

    def __call__(self, chunk: int) -> bytes:
        """The bytes of a chunk's file."""
        return encoded(self.rows(*self.manifest.rows_of(chunk)))

    def prepare(self) -> None:
        """Compile what the first chunk needs."""
        self.rows(0, 1)

    def rows(self, first: int, last: int) -> Any:
        """The rows from ``first`` up to ``last`` as a table.

        A row that stops all others from being run is found by halves, and is refused by itself.
        """
        try:
            return self._made(first, last)
        except UsageError as error:
            if last - first == 1:
                why = error.why if isinstance(error, NothingToRunError) else str(error)
                return refused(self.manifest, first, last, why)
        middle = (first + last) // 2
        return library().concat_tables([self.rows(first, middle), self.rows(middle, last)])

    def _made(self, first: int, last: int) -> Any:
        varied = self.manifest.variation.values(first, last)
        call: dict[str, Any] = dict(self.manifest.arguments)
        groups = {group: dict(call.pop(group, {})) for group in ("parameters", "initial")}
        for name, values in varied.items():
            groups["initial" if name.startswith(INITIAL) else "parameters"][name.removeprefix(INITIAL)] = values
        kept = self.manifest.recording
        found = run_ensemble(self.model, call | groups, kept.samples, 0, self.threads, None, kept.transitions)
        if (found.stop == "interrupted").any():
            raise KeyboardInterrupt
        return table(self.manifest, first, varied, found)

    def check(self, rows: Sequence[int]) -> None:
        """Refuse a sweep of which no row can be run, all for one reason: a setting is wrong.

        Raises UsageError: the reason.
        """
        refusals: list[UsageError] = []
        for k in rows:
            try:
                self._made(k, k + 1)
                return
            except UsageError as error:
                refusals.append(error)
        if len({str(error) for error in refusals}) == 1:
            raise refusals[0]


def chunk_size(work: ChunkWork, processes: int) -> int:
    """How many rows a chunk should have: some seconds of work, little memory, and enough chunks for every process.

    A few rows are run for that. What they refuse for another reason than their own values is refused here.
    """
    rows = work.manifest.variation.rows
    work.check(np.unique(np.linspace(0, rows - 1, min(rows, PROBES)).astype(int)).tolist())
    first, shared = rows // 2, math.ceil(rows / (CHUNKS_A_CORE * processes))

    def timed(count: int) -> tuple[float, float]:
        """Processor seconds for a number of rows, and the bytes of one row."""
        began = time.process_time()
        size = work.rows(first, first + count).nbytes / count
        return time.process_time() - began, size

    alone, size = timed(1)  # what is imported and compiled only once does not count: it was, for the check
    count, seconds = 1, 0.0
    while seconds < PROBED and count < rows - first:
        count = min(GROWTH * count, rows - first)
        seconds, size = timed(count)
        seconds -= alone  # so that what a chunk takes besides its rows does not count
    pace = max(1, count - 1) / max(seconds, 1e-6)
    shared = max(shared, min(LEAST_SECONDS * pace, rows / processes))
    most = max(1, int(min(BYTES / max(1.0, size), SECONDS * pace, shared, MOST_ROWS)))
    return -(-rows // (processes * -(-rows // (most * processes))))  # as many for every process
