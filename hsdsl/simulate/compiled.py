"""The compiled loop: hsdsl/runtime/c run on what the Python loop would run on.

The loop says where and why it stopped; what it means is said by the same functions as for the Python loop.
"""

from __future__ import annotations

import ctypes
from dataclasses import dataclass

import numpy as np

from hsdsl.arithmetic import FLOAT64, Number
from hsdsl.execution import Array, Stop
from hsdsl.integrators.stepper import State
from hsdsl.runtime import tables
from hsdsl.runtime.kernel import CompiledModel
from hsdsl.simulate import stops
from hsdsl.simulate.chunks import Shape
from hsdsl.simulate.control import make_control
from hsdsl.simulate.desk import Desk, Desks
from hsdsl.simulate.diagnosis import not_finite
from hsdsl.simulate.entry import left_domain
from hsdsl.simulate.interrupt import noted
from hsdsl.simulate.recorder import OpenArc
from hsdsl.simulate.relaxed import no_way_on
from hsdsl.simulate.run import Here, Run
from hsdsl.simulate.settings import Settings
from hsdsl.simulate.surfaces import Obstacle, Surfaces
from hsdsl.simulate.timeline import Timeline

SCHEMES = ("relaxed",)


class CompiledPlan:
    """What the compiled loop is given, made once for any number of runs."""

    def __init__(self, compiled: CompiledModel, settings: Settings, timeline: Timeline, mode: int, x: State) -> None:
        assert settings.method is not None
        method, model = tables.method_table(settings.method), compiled.table
        shape = Shape(model.width, model.outputs, settings.method.degree, model.edges)
        self.compiled = compiled
        self.desks: Desks = compiled.shared((settings.method.name, shape), lambda: Desks(compiled, method, shape))
        control = make_control(settings, FLOAT64)
        self._settings = tables.Settings(
            control.h,
            control.tolerance or 0.0,
            control.largest,
            settings.relaxation,
            settings.until,
            min(settings.max_transitions, 2**62),
        )
        self._timeline = _Timeline(timeline)
        self._mode, self._x = mode, np.array(x, np.float64)
        self._rows = 1.01 * settings.until / settings.step + 64 if settings.step else 0

    def lay(self, desk: Desk) -> None:
        """Put everything on a desk."""
        desk.clear(self._rows)
        task = desk.task
        task.timeline, task.settings = self._timeline.pointer, self._settings
        task.mode, task.dimension, task.x = self._mode, len(self._x), self._x.ctypes.data


class _Timeline:
    """The timeline's columns; ``pointer`` is to the structure that says where they are."""

    def __init__(self, timeline: Timeline) -> None:
        segments = timeline.segments
        self._columns = (
            np.array([s.start for s in segments]),
            np.array([s.end for s in segments]),
            np.array([s.jump for s in segments], np.int32),
            np.array([s.data for s in segments], np.float64),
        )
        self.pointer = ctypes.pointer(tables.Timeline(len(segments), *(c.ctypes.data for c in self._columns)))


@dataclass
class CompiledRun:
    """One run of the compiled loop at a desk, to be looked at while it is under way.

    A desk that another run works at afterwards tells of that one.
    """

    run: Run
    plan: CompiledPlan
    desk: Desk

    @property
    def now(self) -> Number:
        """Time of the last row written."""
        return self.desk.task.now

    @property
    def until(self) -> Number:
        """When the run should end."""
        return self.run.settings.until

    @property
    def made(self) -> int:
        """How many transitions were made."""
        return self.desk.task.made

    def follow(self) -> tuple[Stop, dict[str, Array]]:
        """Run to the end: why it stopped, and the columns that were written."""
        desk = self.desk
        self.plan.lay(desk)
        with noted(desk.pressed):
            self.plan.compiled.simulate(desk.task)
        if desk.failed:
            raise desk.failed[0]
        return self._stop(), desk.chunks.whole()

    def _stop(self) -> Stop:
        found, run = self.desk.task.stop, self.run
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
            return no_way_on(run, self._here(), obstacle, self.desk.slope(found.dimension))
        return {
            "until": lambda: stops.reached(t),
            "final": lambda: stops.entered_final(mode.name, t),
            "zeno": lambda: stops.endless(mode.name, t),
            "limit": lambda: stops.limit(run.settings.max_transitions, t),
            "interrupted": lambda: stops.interrupted(self.now),
        }[reason]()

    def _here(self) -> Here:
        """Where the run stopped, as the Python loop would have it."""
        found, run = self.desk.task.stop, self.run
        mode, segment = run.program.modes[found.mode], run.timeline.segments[found.segment]
        x, t = self.desk.x(found.dimension), found.time
        kernel = run.kernel.bind(found.mode, segment.data)
        surfaces = Surfaces(kernel, mode.edges, tuple(0.0 for _ in x), run.arithmetic)
        arc = OpenArc(mode.name, mode.states, "flow", self.made, None, [t], [x], [])
        return Here(mode, kernel, surfaces, segment, arc, t, x)
