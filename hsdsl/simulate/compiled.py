"""The compiled loop: hsdsl/runtime/c run on what the Python loop would run on.

The loop says where and why it stopped; what it means is said by the same functions as for the Python loop.
"""

from __future__ import annotations

import ctypes
from dataclasses import dataclass
from typing import Any

import numpy as np

from hsdsl.arithmetic import FLOAT64, Number
from hsdsl.execution import Array, Stop
from hsdsl.integrators import ButcherTableau, RadauMethod, TaylorMethod
from hsdsl.integrators.stepper import State
from hsdsl.program import Program
from hsdsl.runtime import methods, tables
from hsdsl.runtime.kernel import CompiledModel
from hsdsl.runtime.sampling import Sampled
from hsdsl.simulate import notes, stops
from hsdsl.simulate.along import interpolation
from hsdsl.simulate.chunks import Shape, Sink
from hsdsl.simulate.control import make_control
from hsdsl.simulate.desk import Desk, Desks
from hsdsl.simulate.diagnosis import not_finite
from hsdsl.simulate.entry import LEFT, left_domain
from hsdsl.simulate.interrupt import noted
from hsdsl.simulate.located import FREE
from hsdsl.simulate.recorder import OpenArc
from hsdsl.simulate.relaxed import no_way_on
from hsdsl.simulate.rest import OVER_TIME
from hsdsl.simulate.run import Here, Run
from hsdsl.simulate.settings import Settings
from hsdsl.simulate.spans import along_steps
from hsdsl.simulate.surfaces import Obstacle, Surfaces
from hsdsl.simulate.timeline import Timeline

SCHEMES: dict[str, tuple[type, ...]] = {  # and which methods each one takes
    "relaxed": (ButcherTableau, TaylorMethod, RadauMethod),
    "located": (ButcherTableau, TaylorMethod, RadauMethod),
}


class CompiledPlan:
    """What the compiled loop is given, made once for any number of runs.

    Attributes
    ----------
    states : tuple of str
        Those a run begins with.
    one_layout : bool
        Whether every mode has these.
    """

    def __init__(
        self,
        program: Program,
        compiled: CompiledModel,
        settings: Settings,
        timeline: Timeline,
        mode: int,
        states: tuple[str, ...],
        x: State,
    ) -> None:
        assert settings.method is not None
        method, model = methods.method_table(settings.method), compiled.table
        shape = Shape(model.width, model.outputs, settings.method.degree, model.edges)
        self.program, self.compiled, self.states = program, compiled, states
        self.one_layout = all(m.states == states or (m.final and not m.states) for m in program.modes)
        scheme = settings.scheme
        key = settings.method, scheme, shape
        self.desks: Desks = compiled.shared(key, lambda: Desks(compiled, method, scheme, shape))
        self._settings = task_settings(settings)
        self._interpolation = _interpolations(settings)
        self._columns = _Timeline(timeline)
        self.timeline = self._columns.pointer
        self.sampled = Sampled(compiled, self.timeline)
        self._mode, self._x = mode, np.array(x, np.float64)
        self._start = len(x), self._x.ctypes.data
        self._rows = 1.01 * settings.until / settings.step + 64 if settings.step else 0

    def lay(self, desk: Desk) -> None:
        """Put everything on a desk."""
        desk.clear(0 if desk.chunks.sink else self._rows)
        task = desk.task
        task.timeline, task.settings = self.timeline, self._settings
        task.interpolation = self._interpolation
        task.mode, (task.dimension, task.x) = self._mode, self._start


def task_settings(settings: Settings) -> tables.Settings:
    """Write settings as the runtime takes them."""
    control = make_control(settings, FLOAT64)
    return tables.Settings(
        control.h,
        control.tolerance or 0.0,
        control.largest,
        settings.relaxation,
        settings.until,
        min(settings.max_transitions, 2**62),
        tables.SCHEMES.index(settings.scheme),
    )


def _interpolations(settings: Settings) -> Any:
    """Surfaces along steps, and a push over time."""
    pair = [(interpolation(degree, FLOAT64), share) for degree, share in (along_steps(settings), OVER_TIME)]
    tables_of = [methods.interpolation_table(b.nodes, b.tests, b.matrix, share + b.rounding) for b, share in pair]
    return (tables.Interpolation * 2)(*tables_of)


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
        self._run()
        whole = self.desk.chunks.whole()
        self._notes(whole)
        return self._stop(), whole

    def stream(self, sink: Sink) -> tuple[Stop, dict[str, Array]]:
        """Run to the end, handing over every chunk as soon as it is full: why it stopped, and the last chunk."""

        def take(chunk: dict[str, Array]) -> None:
            self._notes(chunk)
            sink(chunk)

        self.desk.chunks.sink = take
        self._run()
        rest = self.desk.chunks.rest()
        self._notes(rest)
        return self._stop(), rest

    def _run(self) -> None:
        self.plan.lay(self.desk)
        with noted(self.desk.press):
            self.plan.compiled.simulate(self.desk.task)
        if self.desk.failed:
            raise self.desk.failed[0]

    def _notes(self, chunk: dict[str, Array]) -> None:
        said: list[tuple[int, int, int, int, float, float]] = chunk["note"].tolist()
        for note in said:
            self._note(*note)

    def _note(self, number: int, index: int, k: int, count: int, time: float, other: float) -> None:
        """Say what the loop has noted, as the Python loop does."""
        recorder, mode, kind = self.run.recorder, self.run.program.modes[index], tables.NOTICES[number]
        if kind == "unsettled":
            notes.unsettled(recorder, mode.name, k, time)
        elif kind == "crowded":
            notes.crowded(recorder, FREE, time)
        elif kind == "at rest":
            notes.at_rest(recorder, mode.edges[k].name, time, other)
        elif kind == "replaced":
            notes.replaced(recorder, mode.edges[k].name, count, time, other)
        else:
            self._accumulated = notes.accumulates(recorder, mode.edges[k].name, time, other)

    _accumulated: Stop | None = None

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
        if reason == "left":
            return left_domain(self._here(), found.surface, t, LEFT)
        if reason == "step not finite":
            here = self._here()
            return not_finite(run, here, t, (here.x, self.desk.slope(found.dimension)))
        if reason == "accumulated" and self._accumulated is not None:
            return self._accumulated
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
