"""The compiled loop: hsdsl/runtime/c run on what the Python loop would run on.

The loop says where and why it stopped; what it means is said by the same functions as for the Python loop.
"""

from __future__ import annotations

import ctypes
from dataclasses import dataclass
from threading import Event
from typing import Any

import numpy as np

from hsdsl.arithmetic import Number
from hsdsl.execution import Array, Stop
from hsdsl.integrators import ButcherTableau
from hsdsl.integrators.stepper import State
from hsdsl.runtime import tables
from hsdsl.runtime.kernel import CompiledModel
from hsdsl.simulate import stops
from hsdsl.simulate.chunks import Chunks, Shape, grown
from hsdsl.simulate.diagnosis import not_finite
from hsdsl.simulate.entry import left_domain
from hsdsl.simulate.interrupt import noted
from hsdsl.simulate.recorder import OpenArc
from hsdsl.simulate.relaxed import no_way_on
from hsdsl.simulate.run import Here, Run
from hsdsl.simulate.surfaces import Obstacle, Surfaces

SCHEMES = ("relaxed",)
VISITED = 64


@dataclass
class CompiledRun:
    """One run of the compiled loop, to be looked at while it is under way.

    Attributes
    ----------
    whole : dict
        The columns it wrote, when it has ended.
    """

    run: Run
    compiled: CompiledModel
    mode: int
    x: State

    def __post_init__(self) -> None:
        model, settings = self.compiled.table, self.run.settings
        assert isinstance(settings.method, ButcherTableau)
        method = tables.method_table(settings.method)
        self._task = tables.Task()
        self._numbers = _Numbers(self.run, model, self.compiled.workspace(method), self.x)
        self._numbers.fill(self._task)
        control = self.run.control
        self._task.model, self._task.method = ctypes.pointer(model), ctypes.pointer(method)
        self._task.settings = tables.Settings(
            control.h,
            control.tolerance or 0.0,
            control.largest,
            settings.relaxation,
            settings.until,
            min(settings.max_transitions, 2**62),
        )
        self._task.mode, self._task.dimension = self.mode, len(self.x)
        shape = Shape(model.width, model.outputs, settings.method.degree, model.edges)
        rows = 1.01 * settings.until / settings.step + 64 if settings.step else 0
        self._chunks = Chunks(self._task.chunk, shape, rows)
        self._visited = [grown(self._task.visited, VISITED, model.width)]
        self._pressed = Event()
        self._failed: BaseException | None = None
        self.whole: dict[str, Array] = {}

    @property
    def now(self) -> Number:
        """Time of the last row written."""
        return self._task.now

    @property
    def until(self) -> Number:
        """When the run should end."""
        return self.run.settings.until

    @property
    def made(self) -> int:
        """How many transitions were made."""
        return self._task.made

    def follow(self) -> Stop:
        """Run to the end."""
        task = self._task
        task.flush, task.poll, task.grow = tables.Ask(self._flush), tables.Ask(self._poll), tables.Grow(self._grow)
        with noted(self._pressed):
            self.compiled.simulate(self._task)
        if self._failed is not None:
            raise self._failed
        self.whole = self._chunks.whole()
        return self._stop()

    def _poll(self, _: int) -> int:
        return int(self._pressed.is_set())

    def _flush(self, _: int) -> int:
        try:
            self._chunks.flush()
        except BaseException as error:  # none can pass through C
            self._failed = error
            return 2
        return int(self._pressed.is_set())

    def _grow(self, _: int, larger: Any) -> int:
        try:
            self._visited.append(grown(larger.contents, 2 * self._task.visited.room, self.compiled.table.width))
        except BaseException as error:
            self._failed = error
            return 1
        return 0

    def _stop(self) -> Stop:
        found, run = self._task.stop, self.run
        t, reason, mode = found.time, tables.REASONS[found.reason], run.program.modes[found.mode]
        if reason in ("until in strip", "until on guard"):
            return stops.reached_in_strip(t, mode.edges[found.edge].name, reason == "until on guard")
        if reason == "reset not finite":
            return stops.reset_not_finite(mode.edges[found.edge], t)
        if reason == "here not finite":
            return not_finite(run, self._here(), t, (self._here().x,))
        if reason == "entered outside":
            return left_domain(self._here(), found.surface, t, "was entered outside it")
        if reason == "stuck":
            run.control.h = found.h
            obstacle = Obstacle(tables.OBSTACLES[found.obstacle], None if found.surface < 0 else found.surface)
            return no_way_on(run, self._here(), obstacle, self._numbers.slope(found.dimension))
        return {
            "until": lambda: stops.reached(t),
            "final": lambda: stops.entered_final(mode.name, t),
            "zeno": lambda: stops.endless(mode.name, t),
            "limit": lambda: stops.limit(run.settings.max_transitions, t),
            "interrupted": lambda: stops.interrupted(self.now),
        }[reason]()

    def _here(self) -> Here:
        """Where the run stopped, as the Python loop would have it."""
        found, run = self._task.stop, self.run
        mode, segment = run.program.modes[found.mode], run.timeline.segments[found.segment]
        x, t = self._numbers.x(found.dimension), found.time
        kernel = run.kernel.bind(found.mode, segment.data)
        surfaces = Surfaces(kernel, mode.edges, tuple(0.0 for _ in x), run.arithmetic)
        arc = OpenArc(mode.name, mode.states, "flow", self.made, None, [t], [x], [])
        return Here(mode, kernel, surfaces, segment, arc, t, x)


class _Numbers:
    """The memory of a run besides its chunks."""

    def __init__(self, run: Run, model: tables.Model, workspace: int, x: State) -> None:
        segments = run.timeline.segments
        self._start = np.array([s.start for s in segments])
        self._end = np.array([s.end for s in segments])
        self._jump = np.array([s.jump for s in segments], np.int32)
        self._data = np.array([s.data for s in segments], np.float64)
        self._timeline = tables.Timeline(
            len(segments), *(column.ctypes.data for column in (self._start, self._end, self._jump, self._data))
        )
        self._workspace = np.empty(workspace)
        self._first = np.array(x, np.float64)
        self._x, self._slope = np.empty(model.width), np.empty(model.width)

    def fill(self, task: tables.Task) -> None:
        """Say where everything is."""
        task.timeline = ctypes.pointer(self._timeline)
        task.workspace, task.x = self._workspace.ctypes.data, self._first.ctypes.data
        task.stop.x, task.stop.slope = self._x.ctypes.data, self._slope.ctypes.data

    def x(self, dimension: int) -> State:
        """The state the run stopped at."""
        return tuple(self._x[:dimension].tolist())

    def slope(self, dimension: int) -> State:
        """The flow there, where it was stuck."""
        return tuple(self._slope[:dimension].tolist())
