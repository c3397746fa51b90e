"""Many instances of one model by the compiled loop: slices of them, each by whichever thread is free."""

from __future__ import annotations

import ctypes
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from hsdsl.engine.execution import REASONS, Array
from hsdsl.engine.runtime import structures
from hsdsl.engine.runtime.kernel import runtime
from hsdsl.engine.simulate.columns import StateLayouts
from hsdsl.engine.simulate.compiled import MOST_TRANSITIONS, CompiledPlan, task_settings
from hsdsl.engine.simulate.control import FIRST_PART, LARGEST_SHARE
from hsdsl.engine.simulate.input_segments import Timeline
from hsdsl.engine.simulate.problem import Problem
from hsdsl.engine.simulate.stops import codes_of, may_be_passed

TIMELINE, SETTINGS = np.dtype(structures.Timeline), np.dtype(structures.Settings)
LONGEST = f"U{max(map(len, REASONS))}"
NOTICED = {"in contact": "held", "replaced": "replaced", "unsettled": "rough", "crowded": "crowded"}
SLID, ENTERED = 16, 17  # the bits of `HS_SLID` and `HS_ENTERED`
KINDS_OF_NOTICES = [
    (SLID, "sliding"),
    (ENTERED, "entered"),
    *((structures.NOTICES.index(word), kind) for word, kind in NOTICED.items()),
]
FEWEST_IN_LANES = 64  # instances: fewer leave most lanes empty
UNDER_WAY = 2  # runs for each lane: others wait for their crossings
IN_MODES = 3  # the same where they are in several modes
LOG_ROOM = 4096  # transitions that a thread keeps before it hands them over
Logged = tuple[Array, Array, Array]  # transitions as `hs_transition`, and the states before and after each


@dataclass(frozen=True, eq=False)
class Instances:
    """What differs between so many instances, as columns: one number where all have it, else an array.

    ``settings`` are ``until``, ``max_transitions``, ``relaxation`` and ``scale``, the last one by states. There is one
    timeline that all have, but for ``parameters`` and ``until``, or one for each. ``start`` has shape (instances,
    states), ``time`` (the samples, never decreasing) shape (instances, samples).
    """

    count: int
    settings: Mapping[str, Any]
    parameters: Sequence[Any]
    timelines: Sequence[Timeline]
    start: Array
    time: Array


class Kept:
    """What is kept of each instance, to be filled in place; ``columns`` states and all outputs are sampled."""

    def __init__(
        self, instances: int, width: int, outputs: int, columns: int, samples: int, crossings: int, logs: bool = False
    ) -> None:
        nan = float("nan")
        self.width, self.logs = width, logs
        self.log: dict[int, Logged] = {}  # every transition, by the first instance of those that made them
        self.stop = np.full(instances, "interrupted", LONGEST)  # until it is run to its end
        self.reason = np.full(instances, -1, np.int32)  # as the compiled loop says it; -1 where it was not run
        self.mode = np.full(instances, -1, np.int32)
        self.kind = np.zeros(instances, np.int32)  # of the last arc's states
        self.notices = np.zeros(instances, np.int32)  # kinds of them, as the compiled loop says it: a bit each
        self.noted = np.full(instances, "", object)  # their codes
        self.transitions = np.zeros(instances, np.int64)
        self.ended = np.full(instances, nan)
        self.final = np.full((instances, width), nan)
        self.outputs = np.full((instances, outputs), nan)
        self.crossed = np.full((instances, crossings), nan)
        self.states = np.full((instances, columns, samples), nan)
        self.results = np.full((instances, samples, outputs), nan)

    def told(self) -> None:
        """Write the codes of the compiled loop as sentences."""
        self.stop[:] = np.array([*structures.STOPPED, "interrupted"], LONGEST)[self.reason]
        for seen in set(self.notices[self.notices != 0].tolist()):
            self.noted[self.notices == seen] = codes_of(kind for bit, kind in KINDS_OF_NOTICES if seen >> bit & 1)

    def logged(self) -> Logged:
        """Every transition, in the order of the instances."""
        empty = np.empty(0, structures.TRANSITION), np.empty((0, self.width)), np.empty((0, self.width))
        columns = zip(empty, *(self.log[first] for first in sorted(self.log)), strict=True)
        first, second, third = (np.concatenate(column) for column in columns)
        return first, second, third


BY_INSTANCE = (
    "reason", "mode", "kind", "notices", "transitions", "ended", "final", "outputs", "crossed", "states", "results",
)  # fmt: skip


class CompiledEnsemble:
    """Instances of one plan's model and method, and the arrays that are filled."""

    def __init__(self, plan: CompiledPlan, instances: Instances, kept: Kept, names: tuple[str, ...]) -> None:
        self._plan, self._kept = plan, kept
        self._start = np.ascontiguousarray(instances.start, np.float64)
        self._time = np.ascontiguousarray(instances.time, np.float64)
        self._settings, *of_settings = _settings(plan.problem, instances)
        self._timelines, *of_timelines = _timelines(instances)
        self._numbers = of_settings, of_timelines  # what they point into
        self._names, self._layouts = names, plan.layouts
        modes = plan.problem.program.modes
        self._slides = np.array([bool(mode.slides) for mode in modes] * any(mode.slides for mode in modes), np.int32)
        self._watched = _watched(plan)
        self._stop = np.zeros(1, np.int32)
        self._lanes: Any = None

    @property
    def stopped(self) -> bool:
        """Whether :meth:`stop` was called."""
        return bool(self._stop[0])

    def stop(self) -> None:
        """Let every thread end as soon as it can."""
        self._stop[0] = 1

    def work(self, first: int, last: int, place: ThreadWorkspace) -> None:
        """Run the instances from ``first`` up to ``last``."""
        table, kept = place.table, self._kept
        table.done, table.instances = 0, last - first
        table.samples, table.most_transitions = self._time.shape[1], kept.crossed.shape[1]
        for name, column in (("timeline", self._timelines), ("settings", self._settings)):
            setattr(table, name, _row(column, first))
        table.start, table.time = _row(self._start, first), _row(self._time, first)
        table.stop, table.slides = self._stop.ctypes.data, self._slides.ctypes.data if len(self._slides) else None
        for name in BY_INSTANCE:
            setattr(table, name, _row(getattr(kept, name), first))
        place.run()
        if kept.logs:
            kept.log[first] = place.logged(int(kept.transitions[first:last].sum()))

    @property
    def fewest(self) -> int:
        """How many instances a thread should take at least: the last of those that step together leave lanes empty."""
        return 1 if self._lanes is None else 4 * self._together

    def place(self, before: ThreadWorkspace | None = None) -> ThreadWorkspace:
        """Make a place to work at, and others where runs step in lanes; or take one that is such."""
        if before is not None and bool(before.others) is bool(self._lanes):
            return before
        room, lanes = LOG_ROOM if self._kept.logs else 0, self._lanes
        places = [
            ThreadWorkspace(self._plan, self._names, self._layouts, self._time.shape[1], room, self._watched)
            for _ in range(self._together if lanes else 1)
        ]
        if lanes:
            places[0].join(lanes, places)
        return places[0]

    @property
    def _together(self) -> int:
        """How many runs are under way: more than lanes where they are in several modes."""
        modes = structures.array_at(ctypes.c_int32, self._lanes.is_for, self._plan.compiled.table.modes)
        return self._lanes.lanes * (IN_MODES if sum(modes) > 1 else UNDER_WAY)

    def look_for_lanes(self, compiles: bool) -> None:
        """Let runs that follow step many at once, by what is kept or what one ``compiles``."""
        settings = self._plan.problem.settings
        of_series = settings.scheme == "located" and settings.method is not None and settings.method.kind == "taylor"
        if of_series and not settings.moves and not self._kept.logs and len(self._start) >= FEWEST_IN_LANES:
            self._lanes = self._plan.compiled.lanes(compiles)


class ThreadWorkspace:
    """One thread's memory."""

    def __init__(
        self,
        plan: CompiledPlan,
        names: tuple[str, ...],
        layouts: StateLayouts,
        samples: int,
        log_room: int,
        watched: Array,
    ) -> None:
        self.table = structures.Ensemble()
        self.workspace = plan.workspaces.new(self.table.task)
        plan.lay(self.workspace)
        model, chunk, room = plan.compiled.table, self.table.task.chunk, samples
        self._memory = np.zeros(room * (1 + len(names)) + 2 * model.width)
        self._arcs = np.zeros(chunk.arc_room, np.int32)
        sampling, start = self.table.sampling, self._memory.ctypes.data
        asked = plan.sampled.table(layouts.kinds, names, model.outputs, False)
        ctypes.memmove(ctypes.byref(sampling), asked, ctypes.sizeof(sampling))
        sampling.width, sampling.degree = model.width, self.workspace.degree
        sampling.time, sampling.states = start, start + 8 * room
        sampling.scratch = start + 8 * room * (1 + len(names))
        self.table.layouts = self._arcs.ctypes.data
        self.table.layout_of = None if layouts.one else layouts.of_mode.ctypes.data
        self._log: Logged = (
            np.empty(log_room, structures.TRANSITION),
            np.empty((log_room, model.width)),
            np.empty((log_room, model.width)),
        )
        watch, count = self.table.watch, int(watched.max(initial=-1)) + 1
        self._watch = (
            np.zeros(count + model.states + 2 * model.surfaces + 2 * model.width + 1),
            np.zeros(count, np.int32),
        )
        watch.names, watch.name, watch.came = count, watched.ctypes.data, self._watch[1].ctypes.data
        watch.side = self._watch[0].ctypes.data
        watch.sizes = watch.side + 8 * count
        watch.memory = watch.sizes + 8 * model.states
        self._full: list[Logged] = []
        self.others: list[ThreadWorkspace] = []
        self.team: Any = None
        self._lay_log(log_room)

    def join(self, lanes: Any, places: list[ThreadWorkspace]) -> None:
        """Let runs at so many places step together, this one being the first."""
        task, count = self.table.task, len(places)
        of = (ctypes.c_void_p * count)(*(ctypes.addressof(place.table) for place in places))
        room = runtime().hs_lane_memory(task.model, task.method, count, lanes.lanes)
        memory = (ctypes.c_double * room)()
        self.others = places[1:]
        self.team = structures.Team(
            places=structures.address(of),
            count=count,
            program=structures.address(ctypes.pointer(lanes)),
            memory=structures.address(memory),
        )

    def run(self) -> None:
        """Run what is laid here; the interpreter is free meanwhile."""
        if self.team is None:
            runtime().hs_run_ensemble(ctypes.addressof(self.table))
        else:
            runtime().hs_run_team(ctypes.addressof(self.team))
        for place in (self, *self.others):
            if place.workspace.failed:
                raise place.workspace.failed[0]

    def _lay_log(self, room: int) -> None:
        table = self.table
        table.log_room = room
        table.log, table.before, table.after = (column.ctypes.data for column in self._log)
        self._drain = type(table.drain)(self._take)
        table.drain = self._drain

    def _take(self, _: int | None = None) -> int:
        """Take the transitions out of the log."""
        first, second, third = (column[: self.table.logged].copy() for column in self._log)
        self._full.append((first, second, third))
        self.table.logged = 0
        return 0

    def logged(self, count: int) -> Logged:
        """Take away so many transitions of the instances that have been run; after them are those of one cut short."""
        self._take()
        first, second, third = (np.concatenate(column)[:count] for column in zip(*self._full, strict=True))
        self._full.clear()
        return first, second, third


def _watched(plan: CompiledPlan) -> Array:
    """For each mode and surface the number of the name of an edge with an `if`, -1 where that is not watched."""
    program, numbers = plan.problem.program, dict[str, int]()
    watched = np.full((len(program.modes), plan.compiled.table.surfaces), -1, np.int32)
    for row, mode in zip(watched, program.modes, strict=True):
        for k, edge in enumerate(() if mode.slides else mode.edges):
            if may_be_passed(program, edge):
                row[k] = numbers.setdefault(edge.name, len(numbers))
    return watched


def _row(array: Any, row: int) -> int:
    return array.ctypes.data + row * array.strides[0] if len(array) else array.ctypes.data


def _settings(problem: Problem, instances: Instances) -> tuple[Array, Any, Array]:
    """The settings of all instances as ``hs_settings``, and the columns they point into."""
    states, given = problem.program.all_states, instances.settings
    base = task_settings(problem.settings, states)
    table = np.frombuffer(bytearray(base) * instances.count, SETTINGS)
    for name in ("until", "relaxation", "max_transitions"):
        table[name] = np.minimum(given[name], MOST_TRANSITIONS) if name == "max_transitions" else given[name]
    if problem.settings.tolerance is not None:
        table["largest"] = table["until"] * LARGEST_SHARE
        table["step"] = table["largest"] / FIRST_PART
    scale = np.zeros((instances.count if given["scale"] else 0, len(states)))
    for name, column in given["scale"].items():
        scale[:, states.index(name)] = column
        table["scale"] = _rows(scale)
    return table, base, scale


def _timelines(instances: Instances) -> tuple[Array, ...]:
    """All timelines as ``hs_timeline``, and the columns they point into."""
    timelines, n = instances.timelines, instances.count
    counts = np.array([len(timeline.segments) for timeline in timelines])
    segments = [segment for timeline in timelines for segment in timeline.segments]
    first = np.cumsum(counts) - counts
    columns = {
        "start": np.array([s.start for s in segments]),
        "end": np.array([s.end for s in segments]),
        "jump": np.array([s.jump for s in segments], np.int32),
        "data": np.array([s.data for s in segments], np.float64).reshape(len(segments), -1),
    }
    table = np.empty(n, TIMELINE)
    table["segments"] = counts
    for name, column in columns.items():
        table[name] = _rows(column)[first]
    if len(timelines) == 1:
        columns["data"] = np.tile(columns["data"], (n, 1, 1))
        for k, column in enumerate(instances.parameters):
            columns["data"][:, :, k] = np.reshape(column, (-1, 1))
        columns["end"] = np.tile(columns["end"], (n, 1))
        columns["end"][:, -1] = instances.settings["until"]
        table["data"], table["end"] = _rows(columns["data"]), _rows(columns["end"])
    return table, *columns.values()


def _rows(column: Array) -> Array:
    """The addresses of the rows of an array."""
    return column.ctypes.data + np.arange(len(column)) * column.strides[0]
