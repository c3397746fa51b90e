"""Executions that wait where a run starts: those of the `run.final.state` that it goes on from, beyond the first."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

from hsdsl.base.errors import UsageError
from hsdsl.base.names import nth_memory
from hsdsl.base.numbers.arithmetic import Number
from hsdsl.engine.execution import Array
from hsdsl.engine.integrators.stepper import State
from hsdsl.engine.preparation.values import Values
from hsdsl.engine.simulate.transitions import Waits
from hsdsl.mathematics.program import ModeProgram, Program

_NUMBERED = re.compile(r"(.+@.+)\[(\d+)\]")


def waiting_apart(program: Program, initial: Mapping[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]:
    """Initial values of states, and those of executions that wait behind the first of their event."""
    known = {mode.states[i] for mode in program.modes for queue in mode.queues for i in queue.values}
    waits = {name for name in initial if (found := _NUMBERED.fullmatch(name)) and found[1] in known}
    apart = {name: value for name, value in initial.items() if name not in waits}
    return apart, {name: initial[name] for name in waits}


def initial_waits(
    values: Values, mode: ModeProgram, x: State, given: Mapping[str, Any]
) -> dict[str, tuple[Waits, ...]]:
    """The executions that wait behind the first of each queue where a run starts, in the order in which they are made.

    Raises UsageError: not as many are given as the number that wait says.
    """
    rest, found = dict(given), dict[str, tuple[Waits, ...]]()
    for queue in mode.queues:
        count = int(x[queue.waiting]) if len(x) == len(mode.states) else 0
        rows: list[Waits] = []
        for k in range(2, count + 1):
            names = [nth_memory(mode.states[i], k) for i in queue.values]
            if missing := [name for name in names if name not in rest]:
                raise UsageError(f"{queue.name} is {count}, but no value is given for {missing[0]}")
            rows.append(tuple(_number(values, name, rest.pop(name)) for name in names))
        if rows:
            found[queue.name] = tuple(sorted(rows, key=lambda row: row[0]))
    if rest:
        raise UsageError(f"fewer executions wait than have values: {min(rest)} is one too many")
    return found


def check_alone(mode: ModeProgram, start: Array) -> None:
    """Refuse starts of many instances, by states, in which others than the first of a queue wait.

    Raises UsageError: one does.
    """
    for queue in mode.queues if len(start) == len(mode.states) else ():
        if (start[queue.waiting] > 1).any():
            raise UsageError(
                f"{queue.name} is above 1, and many instances start with one execution that waits, or none"
            )


def _number(values: Values, name: str, given: Any) -> Number:
    return values.number(given, f"initial.{name}")
