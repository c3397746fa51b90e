"""Where the compiled loop works: its task and all of its memory, used again by the next run.

To fetch fresh memory from the system costs more than a short run.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from types import FrameType
from typing import Any
from weakref import WeakValueDictionary

import numpy as np

from hsdsl.base.numbers.arithmetic import Number
from hsdsl.engine.execution import Array
from hsdsl.engine.runtime import structures
from hsdsl.engine.runtime.kernel import CompiledModel, runtime
from hsdsl.engine.simulate.columns import Shape
from hsdsl.engine.simulate.output_buffers import OutputBuffers, grown
from hsdsl.engine.simulate.problem import Waits
from hsdsl.engine.simulate.review import Review

VISITED = 64
MOST_KEPT = 4  # workspaces of one model and method


class Workspace:
    """One task with its memory. One run works there at a time.

    ``simulate()`` runs the task to its end, the interpreter being free meanwhile: how many numbers it has written.
    ``pack`` copies them to an address.
    """

    def __init__(self, task: Any, compiled: CompiledModel, method: Any, scheme: str, shape: Shape) -> None:
        model = compiled.table
        self.task: Any = task
        self.degree = shape.degree
        self.pressed, self.failed = False, list[BaseException]()
        self.plan: object = None  # the plan that the task is filled in from
        self.chunks = OutputBuffers(self.task.chunk, shape)
        self._width = model.width
        self._workspace = np.empty(compiled.workspace(method, scheme))
        self._x, self._slope, self._scales = (np.empty(self._width) for _ in range(3))
        self._visited = [grown(self.task.visited, VISITED, self._width)]  # the last is in use
        self._queued, self.tails = model.queued, (structures.Tail * max(1, model.queues))()
        self._waits: list[Array] = []  # of all tails, those in use and those before
        self.task.tail = ctypes.addressof(self.tails)
        self.task.model, self.task.method = (structures.address(ctypes.pointer(each)) for each in (model, method))
        self.task.workspace = self._workspace.ctypes.data
        self.task.stop.x, self.task.stop.slope = self._x.ctypes.data, self._slope.ctypes.data
        self.task.stop.scales = self._scales.ctypes.data
        self.task.flush, self.task.poll, self.task.grow, self.task.lengthen = _flush, _poll, _grow, _lengthen
        where, library = ctypes.addressof(self.task), runtime()
        self.simulate: Callable[[], int] = partial(library.hs_run_whole, where)
        self.pack: Callable[[int], int] = partial(library.hs_pack, where)
        _workspaces[where] = self

    def clear(self, rows: float, memory: int, review: Review | None = None) -> None:
        """Make ready for a run that may write about so many rows, and keep so many bytes of them."""
        if self._queued:
            for tail in self.tails:
                tail.first = tail.count = 0
        self.pressed = False
        if self.failed:
            self.failed = []
        self.chunks.clear(rows, memory, review)
        if len(self._visited) > 1:  # a large set takes long to forget
            self._visited = [grown(self.task.visited, VISITED, self._width)]

    def move_by(self, formulas: Any) -> None:
        """Let round-off move runs by these `FormulaTables`; by none where that is None."""
        self._moves, self.task.moves = None, None
        if formulas is not None:
            registers = np.empty((formulas.registers, 3))
            moves = (structures.Moves * 1)((ctypes.addressof(formulas.table), registers.ctypes.data))
            self._moves, self.task.moves = (moves, registers), ctypes.addressof(moves)

    def press(self, number: int, frame: FrameType | None) -> None:
        """Ctrl-C: the run is to stop."""
        self.pressed = True

    @property
    def stopped(self) -> tuple[Array, Array, Array]:
        """The state that the run stopped at, the flow there, and the scales of the states."""
        return self._x, self._slope, self._scales

    def more_rows(self) -> int:
        """Make room in the chunk; what `flush` answers."""
        try:
            self.chunks.flush()
        except BaseException as error:  # none can pass through C
            self.failed.append(error)
            return 2
        return int(self.pressed or self.chunks.full)

    def more_visited(self, larger: Any) -> int:
        """Make room for twice as many visited states."""
        try:
            self._visited.append(grown(larger, 2 * self.task.visited.room, self._width))
        except BaseException as error:
            self.failed.append(error)
            return 1
        return 0

    def longer(self, tail: Any) -> int:
        """Make room for as many that wait as a tail says."""
        try:
            room: int = tail.room * self._queued
            self._waits.append(np.empty(room))
            tail.waits = self._waits[-1].ctypes.data
        except BaseException as error:
            self.failed.append(error)
            return 1
        return 0

    def put_waits(self, waits: Mapping[str, Sequence[Waits]], names: Sequence[str]) -> None:
        """Let executions wait where a run starts, of queues with these names."""
        for name, rows in waits.items():
            tail = self.tails[names.index(name)]
            tail.first, tail.count = 0, len(rows)
            if tail.room < len(rows):
                tail.room = len(rows)
                self.longer(tail)
            numbers = structures.array_at(ctypes.c_double, tail.waits, tail.room * self._queued)
            for i, row in enumerate(rows):
                numbers[i * self._queued : i * self._queued + len(row)] = row

    def waits(self, names: Sequence[str], queues: Mapping[str, int]) -> dict[str, list[Waits]]:
        """The executions that wait, of queues with these names and so many values."""
        found: dict[str, list[Waits]] = {}
        for name, tail in zip(names, self.tails, strict=False):
            start, end = (i * self._queued for i in (tail.first, tail.first + tail.count))
            if tail.count:
                numbers = structures.array_at(ctypes.c_double, tail.waits, end)
                found[name] = [
                    tuple[Number, ...](numbers[i : i + queues[name]]) for i in range(start, end, self._queued)
                ]
        return found


class Workspaces:
    """The free workspaces of one model, method and scheme."""

    def __init__(self, compiled: CompiledModel, method: Any, scheme: str, shape: Shape) -> None:
        self._made_of = compiled, method, scheme, shape
        self._free: list[Workspace] = []

    def take(self) -> Workspace:
        """Return a workspace that nobody works at."""
        try:
            return self._free.pop()
        except IndexError:
            return self.new(structures.Task())

    def new(self, task: Any) -> Workspace:
        """Make a workspace for a task."""
        return Workspace(task, *self._made_of)

    def leave(self, workspace: Workspace) -> None:
        """Let the next run have a workspace."""
        if len(self._free) < MOST_KEPT:
            self._free.append(workspace)


# The functions that C calls are made once; they find the workspace by its task's place in memory.
_workspaces: WeakValueDictionary[int, Workspace] = WeakValueDictionary()


def _answer_flush(task: int) -> int:
    return _workspaces[task].more_rows()


def _answer_poll(task: int) -> int:
    return int(_workspaces[task].pressed)


def _answer_grow(task: int, larger: Any) -> int:
    return _workspaces[task].more_visited(structures.Visited.from_address(larger))


def _answer_lengthen(task: int, tail: Any) -> int:
    return _workspaces[task].longer(structures.Tail.from_address(tail))


_callbacks = dict(structures.Task._fields_)
_flush, _poll, _grow, _lengthen = (
    _callbacks[name](answer)
    for name, answer in (
        ("flush", _answer_flush),
        ("poll", _answer_poll),
        ("grow", _answer_grow),
        ("lengthen", _answer_lengthen),
    )
)
