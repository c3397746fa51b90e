# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false, reportUnknownArgumentType=false
"""A sweep's dataset: a folder with a manifest, and a Parquet file for each finished chunk of rows.

Each file appears complete, under its final name, and has the tag of its manifest. Its pages have checksums.
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
from hsdsl.base.calls import checks_arguments, checks_methods
from hsdsl.base.errors import UsageError
from hsdsl.base.names import called, did_you_mean, visible
from hsdsl.engine.execution import Array


@checks_methods
@dataclass(frozen=True, eq=False)
class Sweep:
    """The dataset of a sweep in a folder, with all rows or with the finished ones.

    Every Parquet reader opens the folder. `hsdsl.analysis.sweep.rows` lists the columns.
    """

    folder: Path
    manifest: Manifest

    def __repr__(self) -> str:
        of = visible(called(self.manifest.title, self.manifest.model))
        return f"<Sweep of {of} in {self.folder}: {self.done:,} of {self.rows:,} rows>"

    def _repr_html_(self) -> str:
        """Show the varied values and the ends of the runs in notebooks."""
        from hsdsl.analysis.plot.notebook import lines_html
        from hsdsl.analysis.sweep.summary import summary

        return lines_html(summary(self))

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
        from hsdsl.analysis.sweep.picture import draw

        draw(self, path, of, tail, over)

    def as_json(self) -> dict[str, Any]:
        """Return the numbers of the dataset, and its folder."""
        from hsdsl.analysis.sweep.summary import as_json

        return as_json(self)

    @property
    def summary(self) -> str:
        """The model, the progress, the ends of the runs, and the range of each number, as text."""
        from hsdsl.analysis.sweep.summary import summary

        return summary(self)


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
    target = BytesIO()
    library("pyarrow.parquet").write_table(table, target, compression="zstd", write_page_checksum=True)
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
