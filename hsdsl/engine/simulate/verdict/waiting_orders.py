"""Executions that wait whose order is within the error: they are made in the order of times that an error may change.

A delay that is the same for all keeps the order in which they began, whatever the error is.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

from hsdsl.engine.simulate.stops import show
from hsdsl.engine.simulate.verdict.agreement import SAFE
from hsdsl.engine.simulate.verdict.run_view import RunView
from hsdsl.mathematics.program import ModeProgram, Program, Queue

TIES = 4  # how much delays that are the same may differ by


def keep_values(program: Program) -> bool:
    """Whether executions that wait have values of their own."""
    return any(len(queue.values) > 1 for mode in program.modes for queue in mode.queues)


def waiting_orders(run: RunView) -> Iterator[str]:
    """Say which executions of an event, of different values, may have another order."""
    for mode in run.problem.program.modes:
        for queue in mode.queues:
            if len(queue.values) > 1:
                yield from _of_queue(run, mode, queue)


def _of_queue(run: RunView, mode: ModeProgram, queue: Queue) -> Iterator[str]:
    values = [mode.states[i] for i in queue.values[1:]]
    changing = {edge.name: edge.changes for edge in mode.edges if queue.waiting in edge.changes}
    begins = {name for name, changes in changing.items() if queue.values[0] in changes}
    own = [made for made in run.transitions if made.source == mode.name and made.edge in changing]
    began = [made.time for made in own if made.edge in begins]
    ends = [made for made in own if made.edge not in begins]
    delays = [end.time - begin for end, begin in zip(ends, began, strict=False)]
    for k, (one, other) in enumerate(pairwise(ends)):
        tie, apart = run.tie(other.time), other.time - one.time
        if not apart > tie or all(one.before[name] == other.before[name] for name in values):
            continue
        alike = k + 1 < len(delays) and abs(delays[k] - delays[k + 1]) <= TIES * tie
        if not alike and run.errors is not None and apart <= SAFE * run.errors.time_error_at(other.time):
            yield f"the order of executions of {one.edge} that wait until t = {show(one.time)} is within the error"
            return
