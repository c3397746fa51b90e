"""``Model.stream``: a run of any length that writes its rows to a file, in constant memory."""

from __future__ import annotations

import io
import os
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from hsdsl.analysis.store.table import forget_sidecar, write_csv
from hsdsl.base.errors import UsageError
from hsdsl.base.names import without_memory
from hsdsl.engine.execution import Array, RunWarning, Samples, Stop
from hsdsl.engine.execution.records import split
from hsdsl.engine.execution.run import columns_by_name
from hsdsl.engine.preparation.options import check_arguments
from hsdsl.engine.preparation.values import whole
from hsdsl.engine.simulate.columns import StateLayouts
from hsdsl.engine.simulate.plan import Prepared, Watch
from hsdsl.engine.simulate.stops import loop_remarks, warnings_of
from hsdsl.mathematics.program import Program

if TYPE_CHECKING:
    from hsdsl.interface.model.runs import Runs


@dataclass(frozen=True)
class Streamed:
    """A run with its rows in a file: the numbers of rows, steps and transitions, and the last row.

    ``warnings`` has those of the loop itself; states beyond surfaces with an `if` (HS708) are not searched.
    """

    path: Path
    rows: int
    steps: int
    transitions: int
    stop: Stop
    warnings: tuple[RunWarning, ...]
    final: Samples
    engine: str
    scheme: str
    method: str
    seconds: float
    overrides: dict[str, Any]


class Rows:
    """Writer of the chunks of a run: the first row, every k-th, both rows of each jump and the last."""

    def __init__(
        self,
        program: Program,
        states: tuple[str, ...],
        every: int,
        columns: Sequence[str] | None,
        write: Callable[[bytes], None],
    ) -> None:
        self._program, self._every, self._write = program, every, write
        self._names = tuple(dict.fromkeys((*states, *program.all_states)))
        self._columns = (*without_memory(self._names), *program.outputs) if columns is None else columns
        self._layouts = StateLayouts(program, states)
        self._arc = 0, 0, 0  # the last one's mode, jump and layout
        self._held: dict[str, Array] | None = None  # the last row: whether a jump follows it is not known yet
        self.written = self.steps = 0

    def take(self, chunk: dict[str, Array], at_end: bool = False) -> Samples | None:
        """Write the due rows of a chunk; at the end of the run returns its last row."""
        arcs, count = chunk["arc"], len(chunk["times"])
        number = self.steps + np.arange(count)
        self.steps += count
        layout = self._layouts.of_arcs(arcs["mode"], before=self._arc[2]).astype(int)
        which = np.searchsorted(arcs["first"], number, side="right")
        columns = (arcs["mode"].astype(int), arcs["jump"].astype(int), layout)
        mode, jump, kind = (np.append(last, own) for last, own in zip(self._arc, columns, strict=True))
        self._arc = int(mode[-1]), int(jump[-1]), int(kind[-1])
        places = {"mode": mode[which], "jump": jump[which], "kind": kind[which], "due": number % self._every == 0}
        rows = {name: chunk[name].copy() for name in ("times", "values", "outputs")} | places
        if self._held is not None:
            rows = {name: np.concatenate([self._held[name], column]) for name, column in rows.items()}
        if not len(rows["times"]):
            return None
        due, jumps = rows["due"], np.flatnonzero(np.diff(rows["jump"]))
        due[jumps] = due[jumps + 1] = True
        self._held = {name: column[-1:].copy() for name, column in rows.items()}
        due[-1] = at_end
        table = self._table({name: column[due] for name, column in rows.items()}).only(self._columns)
        text = io.BytesIO()
        write_csv(table, text, header=self.written == 0)
        self._write(text.getvalue())
        self.written += len(table)
        return self._table(self._held) if at_end else None

    def _table(self, rows: dict[str, Array]) -> Samples:
        columns, present = columns_by_name(rows["values"], rows["kind"], self._layouts.kinds, self._names)
        return Samples(
            time=rows["times"],
            mode=np.array(self._program.mode_names)[rows["mode"]],
            jump=rows["jump"],
            kind=np.full(len(columns), "flow"),
            states=self._names,
            outputs=self._program.outputs,
            state_columns=columns,
            output_columns=rows["outputs"],
            present=present,
        )


def check(
    path: str | os.PathLike[str], every: int, columns: Sequence[str] | None, arguments: Mapping[str, Any], model: Runs
) -> Path:
    """Refuse arguments that a streamed run does not take, and return the path of its rows."""
    check_arguments(arguments, "a streamed run", without=("samples", "precision"))
    if arguments.get("engine") == "python":
        raise UsageError("only the compiled engine streams", "leave out the engine, or what is to be streamed")
    target = Path(path)
    if target.suffix.lower() != ".csv":
        raise UsageError(f"{target} should end in .csv: only such a file can be written while a run goes on")
    whole(every, "every", least=1)
    if columns is not None:
        split(columns, tuple(model.columns), model.program.outputs)
    return target


def stream(prepared: Prepared, path: Path, every: int, columns: Sequence[str] | None, watch: Watch | None) -> Streamed:
    """Run to the end, rows going to a CSV file; from the start where it comes to a stiff stretch.

    Raises UsageError: the file cannot be written, or not on to its end (a full disk); what was written stays.
    """
    plan, settings = prepared.plan, prepared.settings
    assert plan is not None and settings.method is not None
    began = time.perf_counter()
    try:
        forget_sidecar(path)  # it describes what is written over
        file = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC | getattr(os, "O_BINARY", 0), 0o666)
        try:
            rows = Rows(prepared.program, prepared.states, every, columns, lambda text: _write_all(file, text))
            made, finding = prepared.stream(rows.take, watch)
            final = made and rows.take(made[2], at_end=True)
        finally:
            os.close(file)
    except OSError as error:
        raise UsageError(f"cannot write {path}: {error.strerror or error}") from None
    if made is None:
        return stream(prepared.by_stiff_method(finding), path, every, columns, watch)
    stop, run, _ = made
    assert final is not None
    return Streamed(
        path=path,
        rows=rows.written,
        steps=rows.steps,
        transitions=run.made,
        stop=stop,
        warnings=warnings_of(loop_remarks(prepared.program, run.diagnostics, stop), prepared.program),
        final=final,
        engine="c",
        scheme=settings.scheme,
        method=settings.method.name,
        seconds=time.perf_counter() - began,
        overrides=dict(settings.overrides),
    )


def _write_all(file: int, text: bytes) -> None:
    """Write whole lines in one call where the system takes them so: a process that is killed leaves no half of one."""
    left = memoryview(text)
    while left:
        left = left[os.write(file, left) :]
