# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false, reportUnknownArgumentType=false
"""What a picture of a sweep is of: which columns, over which of the names that vary.

A column of lists gives a bifurcation diagram over one name, and samples curves over time. A column of numbers or words
gives a curve over one name, a map over two. More names are refused: their rows would lie on each other.
"""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Any

import numpy as np

from hsdsl.analysis.sweep.manifest import Manifest
from hsdsl.analysis.sweep.rows import LISTS, column_of
from hsdsl.base.errors import UsageError
from hsdsl.base.names import SINCE, called, did_you_mean, shown

if TYPE_CHECKING:
    from hsdsl.analysis.plot.sweep import Axis
    from hsdsl.analysis.sweep.dataset import Sweep
    from hsdsl.engine.execution import Array

TIME, SAMPLED = "time", "sample.time"
TIMES = {"transition": "transition.time", "before": "transition.time", "after": "transition.time"}


def draw(sweep: Sweep, path: str | os.PathLike[str], of: str | None, tail: float, over: str | None = None) -> None:
    """Draw a column of a sweep; left out, the one of :func:`telling`. ``over`` may be ``time``, for samples.

    Raises UsageError: no such column, one that cannot be drawn, or more than two names that vary.
    """
    from hsdsl.analysis.plot import sweep as plots

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
        most = "a bifurcation diagram has one name that varies" if listed else "a map has two"
        raise UsageError(f"{most}, and here {', '.join(names)} vary", "read the dataset with pandas, and draw a part")
    if not 0 < tail <= 1:
        raise UsageError(f"--tail: expected a share above 0 and up to 1, got {tail:g}")
    title, unit = (
        called(sweep.manifest.title, sweep.manifest.model),
        sweep.manifest.units.get(column.rpartition(".")[2]),
    )
    unit = sweep.manifest.units.get("t") if column.endswith(".time") else unit
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
    quantity = plots.Quantity(label, _numbers(sweep, column))
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
    from hsdsl.analysis.plot.sweep import Axis

    manifest: Manifest = sweep.manifest
    grid = next((grid for grid in manifest.variation.grids if grid.name == name), None)
    drawn = next((each for each in manifest.variation.draws if each.name == name), None)
    unit = manifest.units.get(name.removeprefix("initial."))
    logarithmic = grid.logarithmic if grid else drawn is not None and drawn.distribution.startswith("log")
    label = f"{name} [{unit}]" if unit else name
    return Axis(label, sweep[name], grid and grid.values, logarithmic)


def _numbers(sweep: Sweep, column: str) -> Array:
    """A column as numbers, or as words."""
    values = sweep[column]
    return values if values.dtype == object else values.astype(float)


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
