"""Chunks of a sweep: an ensemble for each, and how many rows one should have."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from hsdsl.analysis.sweep.dataset import encoded
from hsdsl.analysis.sweep.manifest import Manifest, library, refused, table
from hsdsl.base.errors import UsageError
from hsdsl.base.names import INITIAL
from hsdsl.interface.model.ensemble import NothingToRunError

if TYPE_CHECKING:
    from hsdsl.interface.model import Model

PROBES, BYTES, MOST_ROWS = 16, 64e6, 100_000
SECONDS, LEAST_SECONDS = 2.0, 0.1  # of a chunk
CHUNKS_A_CORE = 16  # so that no core waits long for the last chunk


@dataclass(frozen=True, eq=False)
class ChunkWork:
    """What makes a chunk: it can be sent to other processes and machines."""

    model: Model
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
            return table(self.manifest, first, self._ensemble(first, last))
        except UsageError as error:
            if last - first == 1:
                why = error.why if isinstance(error, NothingToRunError) else str(error)
                return refused(self.manifest, first, last, why)
        middle = (first + last) // 2
        return library().concat_tables([self.rows(first, middle), self.rows(middle, last)])

    def _ensemble(self, first: int, last: int) -> Any:
        call: dict[str, Any] = dict(self.manifest.arguments)
        groups = {group: dict(call.pop(group, {})) for group in ("parameters", "initial")}
        for name, values in self.manifest.variation.values(first, last).items():
            groups["initial" if name.startswith(INITIAL) else "parameters"][name.removeprefix(INITIAL)] = values
        kept = self.manifest.recording
        call |= groups | {"samples": kept.samples, "every_transition": kept.transitions}
        found = self.model.ensemble(**call, threads=self.threads)
        if "interrupted" in found.reasons:
            raise KeyboardInterrupt
        return found

    def check(self, rows: Sequence[int]) -> None:
        """Refuse a sweep of which no row can be run, all for one reason: a setting is wrong.

        Raises UsageError: the reason.
        """
        refusals: list[UsageError] = []
        for k in rows:
            try:
                self._ensemble(k, k + 1)
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
    work.rows(first, first + 1)  # what is imported and compiled only once does not count
    count, seconds, size = 1, 0.0, 0.0
    while seconds < LEAST_SECONDS and 2 * count <= rows - first:
        count *= 2
        began = time.perf_counter()
        size = work.rows(first, first + count).nbytes / count
        seconds = time.perf_counter() - began
    pace = count / max(seconds, 1e-6)
    shared = max(shared, min(LEAST_SECONDS * pace, rows / processes))
    return max(1, int(min(BYTES / max(1.0, size), SECONDS * pace, shared, MOST_ROWS)))
