# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false, reportUnknownArgumentType=false
"""A sweep's dataset: a folder with a manifest, and a Parquet file for each finished chunk of rows.

Each file appears complete, under its final name, and has the tag of its manifest. Its pages have checksums. Processes
of this machine make chunks, each written as soon as it is there.
"""

from __future__ import annotations

import math
import os
import shlex
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from hsdsl.analysis.sweep import manifest as manifests
from hsdsl.analysis.sweep.manifest import TAG, Manifest, column_of, library, schema
from hsdsl.base.atomic import replacing
from hsdsl.base.errors import WARNINGS, UsageError
from hsdsl.base.names import INITIAL, called, checks_arguments, checks_methods, counted, did_you_mean, shown, visible
from hsdsl.base.processes import Lost, in_processes
from hsdsl.engine.execution import Array
from hsdsl.engine.preparation.values import whole


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
        self,
        path: str | os.PathLike[str],
        of: str | None = None,
        *,
        tail: float = 0.5,
        over: str | None = None,
        at: Mapping[str, float] | None = None,
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
        at : mapping, optional
            A slice: only the rows in which these names have the values of their grids that are nearest to those given.

        Raises UsageError: no such column, or more names that vary than a picture has axes.
        """
        from hsdsl.analysis.sweep.picture import Picture

        Picture(of, tail, over, at or {}).draw(self, path)

    def worst(self, of: str, count: int = 10) -> list[dict[str, Any]]:
        """Return the rows with the largest numbers in a column, the largest first; :meth:`best` has the least.

        Parameters
        ----------
        of : str
            A column of numbers, such as ``final.J``, a criterion to minimise.
        count : int
            How many rows.

        Returns
        -------
        list of dict
            ``row``, the varied names, ``stop``, and the number. Rows without a number are left out.

        Raises UsageError: no such column, or one without numbers.
        """
        return extreme_rows(self, of, -1, count)

    def best(self, of: str, count: int = 10) -> list[dict[str, Any]]:
        """Return the rows with the least numbers in a column; see :meth:`worst`."""
        return extreme_rows(self, of, 1, count)

    def command(self, row: int) -> str:
        """The command that runs a row by itself."""
        varied = {name: float(column[0]) for name, column in self.manifest.variation.values(row, row + 1).items()}
        shared = self.manifest.arguments
        groups = {"parameters": "", "initial": INITIAL, "settings": "experiment."}
        sets = {
            prefix + k: v for group, prefix in groups.items() for k, v in (shared.get(group) or {}).items()
        } | varied
        words = [f"--{k}={v}" for k, v in shared.items() if k not in groups and v is not None]
        words += [part for k, v in sets.items() for part in ("--set", f"{k}={v}")]
        return shlex.join(["hsdsl", "run", self.manifest.model, *words])

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
        messages: dict[str, str] = {}
        for table in self.batches(["stop", "message"]):
            for reason, message in zip(*(table.column(k).to_pylist() for k in range(2)), strict=True):
                if message is not None:
                    messages.setdefault(reason, message)
        for reason, message in messages.items():
            more = ", the first of them" if self.reasons[reason] > 1 else ""
            yield f"  {reason}{more}: {visible(message)}"
        for code, count in self.warning_counts.items():
            yield f"  {code} in {counted(count, 'row')}: {WARNINGS.get(code, 'of another version')}"
        names = ["transitions", "time", *(name for name in self.columns if name.startswith("final."))]
        found: dict[str, list[Array]] = {name: [] for name in names}
        for table in self.batches(names):
            for name in names:
                values = table.column(name).to_numpy().astype(float)
                values = values[np.isfinite(values)]
                found[name] += (
                    [np.array([values.min(), values.max(), values.sum(), len(values)])] if len(values) else []
                )
        wide = max(map(len, names))
        for name, parts in found.items():
            if parts:
                low, high, total, count = np.transpose(parts)
                span = f"{low.min():<12.6g} to {high.max():<12.6g}"
                yield f"{visible(name):{wide}} {span} mean {total.sum() / count.sum():.6g}"


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


def extreme_rows(sweep: Sweep, of: str, sign: int, count: int) -> list[dict[str, Any]]:
    """The rows of the least (``sign`` 1) or the largest (-1) numbers."""
    check_ranked(sweep.manifest, of)
    numbers, names = sweep[of].astype(float), sweep.manifest.variation.names
    first = [k for k in np.argsort(sign * numbers, kind="stable").tolist() if np.isfinite(numbers[k])]
    kept = list(dict.fromkeys(["row", *map(column_of, names), "stop", of]))
    return sweep.table(kept).take(first[: whole(count, "count", least=1)]).to_pylist()


def check_ranked(manifest: Manifest, of: str) -> None:
    """Refuse a column that is none, or has no numbers."""
    columns = {field.name: str(field.type) for field in schema(manifest)}
    if columns.get(of) not in ("double", "int64") or of == "row":
        known = [name for name, kind in columns.items() if kind in ("double", "int64") and name != "row"]
        reason = "has no numbers" if of in columns else "is no column of the sweep"
        raise UsageError(f"'{shown(of)}' {reason}", did_you_mean(of, known) or f"known here: {', '.join(known)}")


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
