# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false, reportUnknownArgumentType=false
"""A sweep's dataset: a folder with a manifest, and a Parquet file for each chunk of rows that was run.

Each file appears whole, under its final name, and carries the tag of its manifest. Its pages have checksums.
"""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from io import BytesIO
from pathlib import Path
from typing import Any

from hsdsl.analysis.sweep import manifest as manifests
from hsdsl.analysis.sweep.manifest import Manifest
from hsdsl.analysis.sweep.rows import TAG, column_of, library, schema
from hsdsl.base.atomic import replacing
from hsdsl.base.errors import UsageError
from hsdsl.base.names import called, checks_arguments, checks_methods, did_you_mean, visible
from hsdsl.engine.execution import Array


@checks_methods
@dataclass(frozen=True, eq=False)
class Sweep:
    """The dataset in a folder, of all rows or of those that have been run.

    Any reader of Parquet opens the folder. Columns are listed in `hsdsl.analysis.sweep.rows`.
    """

    folder: Path
    manifest: Manifest

    def __repr__(self) -> str:
        of = visible(called(self.manifest.title, self.manifest.model))
        return f"<Sweep of {of} in {self.folder}: {self.done:,} of {self.rows:,} rows>"

    def _repr_html_(self) -> str:
        """Show what was varied and how the runs ended in notebooks."""
        from hsdsl.analysis.plot.notebook import lines_html
        from hsdsl.analysis.sweep.summary import summary

        return lines_html(summary(self))

    @property
    def rows(self) -> int:
        """How many rows it has when it is complete."""
        return self.manifest.variation.rows

    @cached_property
    def chunks(self) -> dict[int, Path]:
        """The files there are, by the number of the chunk."""
        there = {path.name: path for path in self.folder.iterdir()}
        named = ((chunk, path_of(self.folder, chunk).name) for chunk in range(self.manifest.chunks))
        return {chunk: there[name] for chunk, name in named if name in there}

    @property
    def done(self) -> int:
        """How many rows there are."""
        spans = (self.manifest.rows_of(chunk) for chunk in self.chunks)
        return sum(last - first for first, last in spans)

    @property
    def complete(self) -> bool:
        """Whether all rows are there."""
        return self.done == self.rows

    @property
    def columns(self) -> list[str]:
        """The names of its columns."""
        return list(schema(self.manifest).names)

    def batches(self, columns: Sequence[str] | None = None) -> Iterator[Any]:
        """Read the rows that there are, a chunk at a time, in their order.

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
        """Read it as one Arrow table."""
        arrow, tables = library(), list(self.batches(columns))
        if tables:
            return arrow.concat_tables(tables)
        empty = schema(self.manifest).empty_table()
        return empty if columns is None else empty.select(list(columns))

    def to_pandas(self, columns: Sequence[str] | None = None) -> Any:
        """Read it as a pandas DataFrame."""
        return self.table(columns).to_pandas()

    def __getitem__(self, name: str) -> Array:
        """The values of a column that has no lists."""
        column = self.table([column_of(name) if name in self.manifest.variation.names else name])
        return column.column(0).to_numpy()

    @cached_property
    def reasons(self) -> dict[str, int]:
        """How many runs ended for which reason."""
        counts = Counter[str]()
        for table in self.batches(["stop"]):
            counts.update(table.column(0).to_pylist())
        return dict(counts.most_common())

    @cached_property
    def warning_counts(self) -> dict[str, int]:
        """How many runs have which warning, by its code."""
        counts = Counter[str]()
        for table in self.batches(["warnings"] if "warnings" in self.columns else []):
            counts.update(
                code for codes in table.columns for text in codes.to_pylist() for code in (text or "").split()
            )
        return dict(counts.most_common())

    def plot(
        self, path: str | os.PathLike[str], of: str | None = None, *, tail: float = 0.5, over: str | None = None
    ) -> None:
        """Draw a column over what varies, to a .png or .svg file: a curve, a map, or a bifurcation diagram.

        Parameters
        ----------
        path : path
        of : str, optional
            A column; one of lists, such as ``before.v``, gives a bifurcation diagram. Left out: where transitions were
            recorded over one name, the state before them that they change most, else ``transitions``.
        tail : float
            The share of each run, at its end, whose transitions and samples are drawn there.
        over : {"time"}, optional
            Draw a column of samples, such as ``sample.x``, over time: a curve for each row, in colours of what varies.

        Raises UsageError: no such column, or more names that vary than a picture has axes.
        """
        from hsdsl.analysis.sweep.picture import draw

        draw(self, path, of, tail, over)

    def as_json(self) -> dict[str, Any]:
        """Its numbers, and where it is."""
        from hsdsl.analysis.sweep.summary import as_json

        return as_json(self)

    @property
    def summary(self) -> str:
        """What it is of, how far it is, how its runs ended, and the range of each number."""
        from hsdsl.analysis.sweep.summary import summary

        return summary(self)


def path_of(folder: Path, chunk: int) -> Path:
    """The file of a chunk."""
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
    """A table as the bytes of a file."""
    target = BytesIO()
    library("pyarrow.parquet").write_table(table, target, compression="zstd", write_page_checksum=True)
    return target.getvalue()


def write_chunk(folder: Path, chunk: int, content: bytes) -> None:
    """Write the file of a chunk, under another name that is changed when it is whole."""
    with replacing(path_of(folder, chunk)) as file:
        file.write(content)


def read_chunk(path: Path, manifest: Manifest, chunk: int, columns: Sequence[str] | None = None) -> Any:
    """Read a file; OSError or ValueError where it is damaged, or not a chunk of this sweep."""
    first, last = manifest.rows_of(chunk)
    with library("pyarrow.parquet").ParquetFile(path, page_checksum_verification=True) as file:
        if (file.schema_arrow.metadata or {}).get(TAG) != manifest.tag.encode():
            raise ValueError("it belongs to another sweep")
        if file.metadata.num_rows != last - first:
            raise ValueError(f"it has {file.metadata.num_rows} rows, not {last - first}")
        return file.read(None if columns is None else list(columns))


def damaged(sweep: Sweep) -> Iterator[int]:
    """The chunks whose files cannot be read, or are not of this sweep."""
    for chunk, path in sorted(sweep.chunks.items()):
        whole = False
        with suppress(OSError, ValueError):
            read_chunk(path, sweep.manifest, chunk)
            whole = True
        if not whole:
            yield chunk
