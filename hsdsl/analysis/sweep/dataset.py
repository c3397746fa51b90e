# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false, reportUnknownArgumentType=false
"""A sweep's dataset: a folder with a manifest, and a Parquet file for each finished chunk of rows.

Each file appears complete, under its final name, and has the tag of its manifest. Its pages have checksums. Processes
of this machine make chunks, each written as soon as it is there.

A picture of a column of lists is a bifurcation diagram over one name; samples give curves over time. A column of
numbers or words gives a curve over one name, a map over two. More names are refused: their rows would lie on each
other.
"""

from __future__ import annotations

import math
import os
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from hsdsl.analysis.sweep import manifest as manifests
from hsdsl.analysis.sweep.manifest import LISTS, TAG, Manifest, column_of, library, schema
from hsdsl.base.atomic import replacing
from hsdsl.base.errors import WARNINGS, UsageError
from hsdsl.base.names import SINCE, called, checks_arguments, checks_methods, counted, did_you_mean, shown, visible
from hsdsl.base.processes import Lost, in_processes
from hsdsl.engine.execution import Array

if TYPE_CHECKING:
    from hsdsl.analysis.plot.analyses import Axis


@checks_methods
@dataclass(frozen=True, eq=False)
class Sweep:
    """The dataset of a sweep in a folder, with all rows or with the finished ones.

    Any reader of Parquet opens the folder. Columns are listed in `hsdsl.analysis.sweep.manifest`.
    """

    folder: Path
    manifest: Manifest

    def __repr__(self) -> str:
        of = visible(called(self.manifest.title, self.manifest.model))
        return f"<Sweep of {of} in {self.folder}: {self.done:,} of {self.rows:,} rows>"

    def _repr_html_(self) -> str:
        """Show the varied values and the ends of the runs in notebooks."""
        from hsdsl.analysis.plot.notebook import lines_html

        return lines_html(self.summary)

    @property
    def rows(self) -> int:
        """The number of rows of the complete dataset."""
        return self.manifest.variation.rows

    @cached_property
    def chunks(self) -> dict[int, Path]:
        """The existing files, by the number of the chunk."""
        there = {path.name: path for path in self.folder.iterdir()}
        named = ((chunk, path_of(self.folder, chunk).name) for chunk in range(self.manifest.chunks))
        return {chunk: there[name] for chunk, name in named if name in there}

    @property
    def done(self) -> int:
        """The number of finished rows."""
        spans = (self.manifest.rows_of(chunk) for chunk in self.chunks)
        return sum(last - first for first, last in spans)

    @property
    def complete(self) -> bool:
        """Whether all rows are finished."""
        return self.done == self.rows

    @property
    def columns(self) -> list[str]:
        """The names of the columns."""
        return list(schema(self.manifest).names)

    def batches(self, columns: Sequence[str] | None = None) -> Iterator[Any]:
        """Read the finished rows in their order, one chunk at a time.

        Raises UsageError: no such column, or a file that is damaged.
        """
        for name in columns or ():
            if name not in self.columns:
                raise UsageError(f"the sweep has no column '{name}'", did_you_mean(name, self.columns))
        for chunk, path in sorted(self.chunks.items()):
            try:
                yield read_chunk(path, self.manifest, chunk, columns)
            except (OSError, ValueError) as error:
                raise UsageError(
                    f"{path} is damaged: {error}", "the command that made the sweep makes it again"
                ) from None

    def table(self, columns: Sequence[str] | None = None) -> Any:
        """Read the dataset as one Arrow table."""
        arrow, tables = library(), list(self.batches(columns))
        if tables:
            return arrow.concat_tables(tables)
        empty = schema(self.manifest).empty_table()
        return empty if columns is None else empty.select(list(columns))

    def to_pandas(self, columns: Sequence[str] | None = None) -> Any:
        """Read the dataset as a pandas DataFrame."""
        return self.table(columns).to_pandas()

    def __getitem__(self, name: str) -> Array:
        """Return the values of a column without lists."""
        column = self.table([column_of(name) if name in self.manifest.variation.names else name])
        return column.column(0).to_numpy()

    @cached_property
    def reasons(self) -> dict[str, int]:
        """The number of runs for each reason of the end."""
        counts = Counter[str]()
        for table in self.batches(["stop"]):
            counts.update(table.column(0).to_pylist())
        return dict(counts.most_common())

    @cached_property
    def warning_counts(self) -> dict[str, int]:
        """The number of runs for each code of a warning."""
        counts = Counter[str]()
        for table in self.batches(["warnings"] if "warnings" in self.columns else []):
            counts.update(
                code for codes in table.columns for text in codes.to_pylist() for code in (text or "").split()
            )
        return dict(counts.most_common())

    def plot(
        self, path: str | os.PathLike[str], of: str | None = None, *, tail: float = 0.5, over: str | None = None
    ) -> None:
        """Draw a column over the varied names to a .png or .svg file: a curve, a map, or a bifurcation diagram.

        Parameters
        ----------
        path : path
        of : str, optional
            A column; a column of lists, such as ``before.v``, gives a bifurcation diagram. If transitions were recorded
            over one name, the default is the state that they change most, before transitions; otherwise it is
            ``transitions``.
        tail : float
            The drawn fraction at the end of each run, for transitions and samples.
        over : {"time"}, optional
            Whether to draw a column of samples, such as ``sample.x``, over time: a curve for each row, coloured by the
            varied value.

        Raises UsageError: no such column, or more names that vary than a picture has axes.
        """
        draw(self, path, of, tail, over)

    def as_json(self) -> dict[str, Any]:
        """Return the numbers of the dataset, and its folder."""
        described = self.manifest.plain()
        vary: list[dict[str, Any]] = described["vary"]
        for item in vary:
            if "values" in item:
                values = item.pop("values")
                item |= {"from": values[0], "to": values[-1], "count": len(values)}
        counts = {"done": self.done, "complete": self.complete, "stops": self.reasons, "warnings": self.warning_counts}
        return {"folder": str(self.folder)} | {key: described[key] for key in KEPT} | {"vary": vary} | counts

    @property
    def summary(self) -> str:
        """The model, the progress, the ends of the runs, and the range of each number, as text."""
        return "\n".join(self._lines())

    def _lines(self) -> Iterator[str]:
        manifest, variation = self.manifest, self.manifest.variation
        yield visible(called(manifest.title, manifest.model))
        for grid in variation.grids:
            span = f"from {grid.values[0]:.6g} to {grid.values[-1]:.6g}"
            yield f"  {grid.name}: {counted(len(grid.values), 'value')} {span}"
        for each in variation.draws:
            yield f"  {each.name}: {each.distribution}({', '.join(f'{a:.6g}' for a in each.arguments)})"
        if variation.draws:
            yield f"  {variation.random:,} draws with seed {variation.seed}"
        share = f"  {self.done:,} of {self.rows:,} rows in {len(self.chunks)} of {manifest.chunks} files"
        yield share + ("" if self.complete else "; the command that made it goes on")
        yield "stops  " + ", ".join(f"{count:,} {reason}" for reason, count in self.reasons.items())
        yield from _failures(self)
        for code, count in self.warning_counts.items():
            yield f"  {code} in {counted(count, 'row')}: {WARNINGS.get(code, 'of another version')}"
        yield from _ranges(self)


def path_of(folder: Path, chunk: int) -> Path:
    """Return the file of a chunk."""
    return folder / f"chunk-{chunk:06}.parquet"


@checks_arguments
def load(folder: str | os.PathLike[str]) -> Sweep:
    """Open the dataset in a folder.

    Raises UsageError: there is none, it is damaged, or a later version of hsdsl wrote it.
    """
    library("pyarrow.parquet")
    place = Path(folder)
    return Sweep(place, manifests.read(place))


def encoded(table: Any) -> bytes:
    """Encode a table as the bytes of a file."""
    target, types = BytesIO(), library().types
    lists = {field.name: types.is_list(field.type) for field in table.schema if "string" in str(field.type)}
    words = [f"{name}.list.element" if nested else name for name, nested in lists.items()]  # numbers seldom repeat
    how = {"compression": "zstd", "use_dictionary": words, "write_page_checksum": True}
    library("pyarrow.parquet").write_table(table, target, **how)
    return target.getvalue()


def write_chunk(folder: Path, chunk: int, content: bytes) -> None:
    """Write the file of a chunk under a temporary name, and rename it when it is complete."""
    with replacing(path_of(folder, chunk)) as file:
        file.write(content)


def read_chunk(path: Path, manifest: Manifest, chunk: int, columns: Sequence[str] | None = None) -> Any:
    """Read a file; raise OSError or ValueError if it is damaged, or no chunk of this sweep."""
    first, last = manifest.rows_of(chunk)
    with library("pyarrow.parquet").ParquetFile(path, page_checksum_verification=True) as file:
        if (file.schema_arrow.metadata or {}).get(TAG) != manifest.tag.encode():
            raise ValueError("it belongs to another sweep")
        if file.metadata.num_rows != last - first:
            raise ValueError(f"it has {file.metadata.num_rows} rows, not {last - first}")
        return file.read(None if columns is None else list(columns))


def damaged(sweep: Sweep) -> Iterator[int]:
    """Return the chunks whose files are unreadable, or belong to another sweep."""
    for chunk, path in sorted(sweep.chunks.items()):
        whole = False
        with suppress(OSError, ValueError):
            read_chunk(path, sweep.manifest, chunk)
            whole = True
        if not whole:
            yield chunk


KEPT = ("model", "sha256", "title", "random", "seed", "record", "settings", "rows", "chunk", "hsdsl")


def _failures(sweep: Sweep) -> Iterator[str]:
    """The first message of each reason why runs did not get to their end."""
    messages: dict[str, str] = {}
    for table in sweep.batches(["stop", "message"]):
        for reason, message in zip(*(table.column(k).to_pylist() for k in range(2)), strict=True):
            if message is not None:
                messages.setdefault(reason, message)
    for reason, message in messages.items():
        more = ", the first of them" if sweep.reasons[reason] > 1 else ""
        yield f"  {reason}{more}: {visible(message)}"


def _ranges(sweep: Sweep) -> Iterator[str]:
    """The least, the largest and the mean of each column of numbers."""
    names = ["transitions", "time", *(name for name in sweep.columns if name.startswith("final."))]
    found: dict[str, list[Array]] = {name: [] for name in names}
    for table in sweep.batches(names):
        for name in names:
            values = table.column(name).to_numpy().astype(float)
            values = values[np.isfinite(values)]
            found[name] += [np.array([values.min(), values.max(), values.sum(), len(values)])] if len(values) else []
    wide = max(map(len, names))
    for name, parts in found.items():
        if parts:
            low, high, total, count = np.transpose(parts)
            span = f"{low.min():<12.6g} to {high.max():<12.6g}"
            yield f"{visible(name):{wide}} {span} mean {total.sum() / count.sum():.6g}"


TIME, SAMPLED = "time", "sample.time"
TIMES = {"transition": "transition.time", "before": "transition.time", "after": "transition.time"}


def draw(sweep: Sweep, path: str | os.PathLike[str], of: str | None, tail: float, over: str | None = None) -> None:
    """Draw a column of a sweep; left out, the one of :func:`telling`. ``over`` may be ``time``, for samples.

    Raises UsageError: no such column, one that cannot be drawn, or more than two names that vary.
    """
    from hsdsl.analysis.plot import analyses as plots

    if over not in (None, TIME):
        raise UsageError(f"--over: expected {TIME}, got '{shown(over)}'", "pictures are over what varies without it")
    column = of or (next((c for c in sweep.columns if _is_sampled(c)), "sample.x") if over else telling(sweep))
    names = sweep.manifest.variation.names
    if column not in sweep.columns or column in ("row", "message", "verdict.reasons", *map(column_of, names)):
        raise UsageError(f"--of: the sweep has no column '{column}' to draw", _hint(sweep, column))
    listed = column.partition(".")[0] in LISTS
    if over and not _is_sampled(column):
        raise UsageError(f"--over {TIME}: '{column}' has no samples", "choose one with --of sample.NAME")
    if not over and len(names) > (1 if listed else 2):
        most = "a bifurcation diagram shows one varied name" if listed else "a map shows two varied names"
        raise UsageError(f"{most}, got {', '.join(names)}", "read the dataset with pandas, and draw a part")
    if not 0 < tail <= 1:
        raise UsageError(f"--tail: expected a share above 0 and up to 1, got {tail:g}")
    title = called(sweep.manifest.title, sweep.manifest.model)
    unit = sweep.manifest.units.get("t" if column.endswith(".time") else column.rpartition(".")[2])
    label = f"{column} [{unit}]" if unit else column
    axes = [_axis(sweep, name) for name in names]
    if over:
        plots.plot_family(path, _curves(sweep, column), axes[0], label, title)
        return
    if listed:
        values, where = _dots(sweep, column, tail)
        if not len(values):
            hint = "draw whole runs with --tail 1" if tail < 1 else ""
            raise UsageError(f"--of {column}: there is none in the last {tail:g} of each run", hint)
        plots.plot_dots(path, axes[0], plots.Quantity(label, values), where, title)
        return
    numbers = sweep[column]
    quantity = plots.Quantity(label, numbers if numbers.dtype == object else numbers.astype(float))
    if len(axes) == 1:
        plots.plot_curve(path, axes[0], quantity, title)
    else:
        plots.plot_map(path, axes[0], axes[1], quantity, title)


def telling(sweep: Sweep) -> str:
    """The column that is drawn where none is named.

    Where transitions were recorded over one name, it is the state before them that they change most, relative to its
    size, but no time in a mode, and none of whole numbers, as of modes and counters; else the number of transitions.
    """
    states = [name for name in sweep.manifest.states if name.rpartition(".")[2] != SINCE]
    if not (sweep.manifest.recording.transitions and len(sweep.manifest.variation.names) == 1 and states):
        return "transitions"
    changes, whole = np.zeros(len(states)), np.ones(len(states), dtype=bool)
    for table in sweep.batches([f"{side}.{state}" for state in states for side in ("before", "after")]):
        for k, state in enumerate(states):
            before, after = (_flat(table, f"{side}.{state}") for side in ("before", "after"))
            known = np.isfinite(before) & np.isfinite(after) & (before != after)
            whole[k] &= bool((before[known] % 1 == 0).all() and (after[known] % 1 == 0).all())
            before, after = before[known], after[known]
            changes[k] += (np.abs(after - before) / np.maximum(np.abs(before), np.abs(after))).sum()
    changes[whole] = 0.0
    return f"before.{states[int(np.argmax(changes))]}" if changes.any() else "transitions"


def _flat(table: Any, column: str) -> Array:
    """The numbers in all lists of a column."""
    return table.column(column).combine_chunks().flatten().to_numpy(zero_copy_only=False)


def _hint(sweep: Sweep, column: str) -> str | None:
    first = column.partition(".")[0]
    if first in LISTS:
        return f"record it: --record {'outputs:every=TIME' if first == 'sample' else 'transitions'}"
    return did_you_mean(column, sweep.columns)


def _axis(sweep: Sweep, name: str) -> Axis:
    from hsdsl.analysis.plot.analyses import Axis

    manifest: Manifest = sweep.manifest
    grid = next((grid for grid in manifest.variation.grids if grid.name == name), None)
    drawn = next((each for each in manifest.variation.draws if each.name == name), None)
    unit = manifest.units.get(name.removeprefix("initial."))
    logarithmic = grid.logarithmic if grid else drawn is not None and drawn.distribution.startswith("log")
    label = f"{name} [{unit}]" if unit else name
    return Axis(label, sweep[name], grid and grid.values, logarithmic)


def _is_sampled(column: str) -> bool:
    return column.startswith("sample.") and column != SAMPLED


def _curves(sweep: Sweep, column: str) -> list[tuple[Array, Array]]:
    """The times and the values of the samples of each row."""
    found: list[tuple[Array, Array]] = []
    for table in sweep.batches([SAMPLED, column]):
        counts = table.column(SAMPLED).combine_chunks().value_lengths().fill_null(0).to_numpy().astype(int)
        ends = np.cumsum(counts)[:-1]
        found += zip(np.split(_flat(table, SAMPLED), ends), np.split(_flat(table, column), ends), strict=True)
    return found


def _dots(sweep: Sweep, column: str, tail: float) -> tuple[Array, Array]:
    """The numbers of lists in the last part of each run, and the row of each among those that there are."""
    times = TIMES.get(column.partition(".")[0], SAMPLED)
    values: list[Any] = [np.empty(0)]
    where, rows = [np.empty(0, int)], 0
    for table in sweep.batches(list(dict.fromkeys([column, times, "time"]))):
        counts = table.column(times).combine_chunks().value_lengths().fill_null(0).to_numpy().astype(int)
        row, ends = np.repeat(np.arange(table.num_rows), counts), table.column("time").to_numpy()
        late = _flat(table, times) >= (1 - tail) * ends[row]
        values.append(_flat(table, column)[late])
        where.append(row[late] + rows)
        rows += table.num_rows
    return np.concatenate(values), np.concatenate(where)


Work = Callable[[int], bytes]
Write = Callable[[int, bytes], None]
Run = Callable[[Work, Sequence[int], Write], None]
TRIES = 3


def run_here(work: Work, chunks: Sequence[int], write: Write, processes: int) -> None:
    """Make chunks in so many processes; one alone works in this process.

    A process that dies loses its chunk only, which another one makes again.

    Raises UsageError: processes died over the same chunk three times.
    """
    waiting, deaths = list(chunks), Counter[int]()
    while waiting and processes > 1:
        lost: list[int] = []
        for index, answer in in_processes(work, waiting, min(processes, len(waiting)), math.inf):
            if isinstance(answer, Lost):
                lost.append(waiting[index])
            else:
                write(waiting[index], answer)
        deaths.update(lost)
        refuse_deadly(deaths)
        waiting = lost
    for chunk in waiting:
        write(chunk, work(chunk))


def refuse_deadly(deaths: Counter[int]) -> None:
    """End a sweep of which one chunk has been lost too often."""
    for chunk, count in deaths.items():
        if count >= TRIES:
            raise UsageError(
                f"{count} workers died while they ran chunk {chunk} of the sweep; what was done is kept",
                "is there too little memory? take smaller chunks, with --chunk ROWS in a new folder",
            )
