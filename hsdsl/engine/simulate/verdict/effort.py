"""Steps that crowd: a run that makes thousands of them within a millionth of its length says where, and why."""

from __future__ import annotations

import numpy as np

from hsdsl.engine.execution import Execution
from hsdsl.engine.simulate.problem import Problem
from hsdsl.engine.simulate.stalls import SHORT
from hsdsl.engine.simulate.stops import show

MANY = 10_000  # steps


def crowded_steps(problem: Problem, execution: Execution) -> list[str]:
    """The sentence on the steps of a run that are closest to each other, where these are so close."""
    times = execution.times
    if problem.settings.tolerance is None or len(times) <= MANY:
        return []
    rows = np.flatnonzero(times[1:] > times[:-1])
    late = times[rows[MANY:] + 1] - times[rows[:-MANY]] if len(rows) > MANY else np.array([np.inf])
    first = int(np.argmin(late))
    if not late[first] < SHORT * problem.settings.until:
        return []
    start, end = int(rows[first]), int(rows[first + MANY])
    arc = execution.arcs[int(np.searchsorted(execution.arc_table.first, start, "right")) - 1]
    values = execution.values[start : min(end, arc.last) + 1, : len(arc.states)].astype(float)
    sizes = np.abs(values).max(axis=0, initial=0.0)
    moved = np.abs(np.diff(values, axis=0)).sum(axis=0) / np.where(sizes > 0, sizes, 1.0)
    most = f", where {arc.states[int(np.argmax(moved))]} of {arc.mode} moves most" if len(arc.states) else ""
    return [f"{MANY} steps from t = {show(times[start])} on are within a millionth of the run{most}"]
