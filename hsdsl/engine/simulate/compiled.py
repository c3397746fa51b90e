"""The compiled loop: hsdsl/engine/runtime/c run on what the Python loop would run on.

The loop returns codes; the functions of the Python loop turn them into sentences.
"""

from __future__ import annotations

import ctypes
from collections.abc import Mapping, Sequence
from functools import cached_property, partial
from types import MappingProxyType
from typing import Any

import numpy as np

from hsdsl.base.interrupts import noting
from hsdsl.base.numbers.arithmetic import FLOAT64, Number
from hsdsl.engine.execution import Array, Stop
from hsdsl.engine.runtime import structures
from hsdsl.engine.runtime.kernel import CompiledModel, Sampled, runtime
from hsdsl.engine.simulate import stops
from hsdsl.engine.simulate.columns import Columns, Shape, StateLayouts
from hsdsl.engine.simulate.control import make_control
from hsdsl.engine.simulate.input_segments import Timeline
from hsdsl.engine.simulate.output_buffers import Sink
from hsdsl.engine.simulate.problem import Problem, Tails
from hsdsl.engine.simulate.review import Review
from hsdsl.engine.simulate.settings import Settings, along_steps, interpolation
from hsdsl.engine.simulate.stops import Diagnostics
from hsdsl.engine.simulate.workspace import Workspace, Workspaces
from hsdsl.mathematics.program import Program

MOST_TRANSITIONS = 2**62
NOTHING: Mapping[str, Number] = MappingProxyType({})  # to call a generic alias takes longer than a short run has


class CompiledPlan:
    """What the compiled loop is given, made once for any number of runs.

    Attributes
    ----------
    layouts : StateLayouts
        The kinds of arcs; the first is what a run begins with.
    """

    def __init__(self, problem: Problem, compiled: CompiledModel) -> None:
        settings, program = problem.settings, problem.program
        assert settings.method is not None
        method, model = structures.method_table(settings.method), compiled.table
        shape = Shape(model.width, model.outputs, settings.method.degree, model.edges, model.contacts)
        self.problem, self.compiled, self.layouts = problem, compiled, StateLayouts(program, problem.states)
        scheme = settings.scheme
        key = settings.method, scheme, shape
        self.workspaces: Workspaces = compiled.shared(key, lambda: Workspaces(compiled, method, scheme, shape))
        self._settings = task_settings(settings, program.all_states)
        self._interpolation = _interpolation(settings)
        self._columns = _Timeline(problem.timeline)
        self.timeline = self._columns.pointer
        self.sampled = Sampled(runtime(), compiled, self.timeline)
        self._mode, self._x = problem.mode, np.array(problem.x, np.float64)
        self._start = len(problem.x), self._x.ctypes.data
        self.until, self.memory, self.queued = settings.until, settings.memory, bool(program.queues)
        self.of_screens: dict[bool, Any] = {}  # those of its runs, by whether they are compared with shadow runs
        self._formulas = compiled.shared("formulas", partial(_tables, program)) if settings.moves else None
        self._rows = 1.01 * settings.until / settings.step + 64 if settings.step else 0

    def lay(self, workspace: Workspace, review: Review | None = None) -> None:
        """Put everything on a workspace, unless it lies there from the run before."""
        workspace.clear(0 if workspace.chunks.sink else self._rows, self.memory, review)
        if self.problem.waits:
            workspace.put_waits(self.problem.waits, self.problem.program.queues)
        if workspace.plan is self:
            return
        task, workspace.plan = workspace.task, self
        task.timeline, task.settings = self.timeline, self._settings
        workspace.move_by(self._formulas)
        task.interpolation = self._interpolation
        task.mode, (task.dimension, task.x) = self._mode, self._start


def _tables(program: Program) -> Any:
    from hsdsl.engine.runtime.formulas import FormulaTables  # only verdicts ask for it

    return FormulaTables(program)


def _doubles(numbers: Sequence[Number] | None) -> Any:
    """Numbers in memory that a field keeps alive; None where there are none."""
    return structures.address((ctypes.c_double * len(numbers))(*numbers)) if numbers else None


def task_settings(settings: Settings, states: tuple[str, ...]) -> Any:
    """Write settings as the runtime takes them; ``states`` are those of all modes."""
    control = make_control(settings, FLOAT64)
    scale = [settings.scale.get(name, 0.0) for name in states] if settings.scale else None
    return structures.Settings(
        control.h,
        control.tolerance,
        control.largest,
        settings.relaxation,
        settings.until,
        min(settings.max_transitions, MOST_TRANSITIONS),
        structures.COMPILED_SCHEMES.index(settings.scheme),
        settings.completion != "none",
        _doubles(scale),
        len(settings.first_steps),
        _doubles(settings.first_steps),
    )


def _interpolation(settings: Settings) -> Any:
    """Surfaces along steps."""
    degree, share = along_steps(settings)
    by = interpolation(degree, FLOAT64)
    table = structures.interpolation_table(by.nodes, by.tests, by.matrix, share + by.rounding)
    return structures.address((structures.Interpolation * 1)(table))


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
        table = structures.Timeline(len(segments), *(c.ctypes.data for c in self._columns))
        self.pointer = structures.address(ctypes.pointer(table))


class CompiledRun:
    """One run of the compiled loop at a workspace, to be looked at while it is under way, and what it has written.

    A workspace that another run works at afterwards tells of that one.
    """

    columns: Columns | None = None  # once it is over
    waits: Mapping[str, Number] = NOTHING  # at its end, as states
    _counted: tuple[int, int] | None = None
    _accumulated: Stop | None = None

    def __init__(self, plan: CompiledPlan, workspace: Workspace, review: Review | None = None) -> None:
        self.plan, self.workspace, self.review = plan, workspace, review

    @cached_property
    def diagnostics(self) -> Diagnostics:
        """What the run has noted; most runs note nothing."""
        diagnostics = Diagnostics()
        if self.columns is not None and self.columns.notes:
            self._note(self.columns["note"], diagnostics)
        return diagnostics

    @property
    def now(self) -> Number:
        """Time of the last row written."""
        return self.workspace.task.now

    @property
    def until(self) -> Number:
        """When the run should end."""
        return self.plan.until

    @property
    def made(self) -> int:
        """How many transitions were made."""
        return self._counts[0]

    @property
    def enters_beyond(self) -> bool:
        """Whether one fired on entry."""
        return self._counts[1] > 0

    @property
    def _counts(self) -> tuple[int, int]:
        task = self.workspace.task
        return self._counted or (task.made, task.entries)

    def follow(self) -> Stop:
        """Run to the end: why it stopped."""
        size = self._run()
        self._counted = self._counts
        self.columns = self.workspace.chunks.whole(self.workspace.pack, size, self.plan.layouts)
        return self._stop()

    def stream(self, sink: Sink) -> tuple[Stop, dict[str, Array]]:
        """Run to the end, handing over every chunk as soon as it is full: why it stopped, and the last chunk."""

        def take(chunk: dict[str, Array]) -> None:
            self._note(chunk["note"], self.diagnostics)
            sink(chunk)

        self.workspace.chunks.sink = take
        self._run()
        rest = self.workspace.chunks.rest()
        self._note(rest["note"], self.diagnostics)
        return self._stop(), rest

    def _run(self) -> int:
        self.plan.lay(self.workspace, self.review)
        size = noting(self.workspace.press, self.workspace.simulate)
        if self.workspace.failed:
            raise self.workspace.failed[0]
        if self.plan.queued:
            program = self.plan.problem.program
            sizes = {queue.name: len(queue.values) for mode in program.modes for queue in mode.queues}
            self.waits = Tails(self.workspace.waits(program.queues, sizes)).states(program.modes)
        return size

    def _note(self, notes: Array, diagnostics: Diagnostics) -> None:
        if len(notes):
            from hsdsl.engine.simulate.stalls import Note, add_note

            listed: list[Note] = notes.tolist()
            for note in listed:
                self._accumulated = add_note(diagnostics, self.plan.problem.program, note) or self._accumulated

    def _stop(self) -> Stop:
        found = self.workspace.task.stop
        reason = structures.REASONS[int(found.reason)]
        if reason == "until":
            return stops.reached(found.time)
        if reason == "final":
            return stops.entered_final(self.plan.problem.program.modes[int(found.mode)].name, found.time)
        if reason == "interrupted" and self.workspace.chunks.full:
            return stops.memory(self.plan.memory, self.now)
        if reason == "interrupted":
            return stops.interrupted(self.now)
        from hsdsl.engine.simulate.stalls import stop

        diagnostics = self.diagnostics  # they may end the run
        if reason == "accumulated" and self._accumulated is not None:
            return self._accumulated
        return stop(self.plan.problem, self.workspace, reason, diagnostics)
