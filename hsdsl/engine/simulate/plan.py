"""A run as far as its arguments decide it; to run it again costs little more than the loop."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from hsdsl.engine.execution import Array, Execution, Stop
from hsdsl.engine.integrators import METHODS
from hsdsl.engine.runtime import structures
from hsdsl.engine.runtime.kernel import CompiledModel
from hsdsl.engine.simulate.compiled import CompiledPlan, CompiledRun
from hsdsl.engine.simulate.control import make_control
from hsdsl.engine.simulate.moving import finer_settings
from hsdsl.engine.simulate.output_buffers import Sink
from hsdsl.engine.simulate.problem import Problem, Tails
from hsdsl.engine.simulate.result import about, from_recorder, written
from hsdsl.engine.simulate.review import Judge, Judged, Review
from hsdsl.engine.simulate.stops import interrupted, memory

if TYPE_CHECKING:
    from hsdsl.engine.simulate.recorder import Progress
    from hsdsl.engine.simulate.run import ModeState, Run


def _relaxed(run: Run, here: ModeState | Stop) -> Stop:
    """The loop, imported on first use: the compiled one needs nothing of it."""
    from hsdsl.engine.simulate.relaxed import relaxed

    return relaxed(run, here)


def _located(run: Run, here: ModeState | Stop) -> Stop:
    from hsdsl.engine.simulate.located import located

    return located(run, here)


def _paoli_schatzman(run: Run, here: ModeState | Stop) -> Stop:
    from hsdsl.engine.simulate.paoli_schatzman import paoli_schatzman

    return paoli_schatzman(run, here)


LOOPS: dict[str, Callable[[Run, ModeState | Stop], Stop]] = {
    "relaxed": _relaxed,
    "located": _located,
    "paoli-schatzman": _paoli_schatzman,
}
Watch = Callable[["Progress"], None]
Streamed = tuple[Stop, CompiledRun, dict[str, Array]]


@dataclass(frozen=True, eq=False)
class Prepared(Problem):
    """A problem ready to run any number of times; ``plan`` is given where the compiled loop runs it.

    ``judge`` finds stiff stretches, where the method was chosen for the start. ``links`` are the fields of its
    executions by which these answer what takes more than their numbers.
    """

    plan: CompiledPlan | None
    judge: Judge | None = None
    links: dict[str, Any] = field(default_factory=dict[str, Any])
    finer: dict[int, Prepared] = field(default_factory=dict[int, "Prepared"])  # by the rows of the run

    def simulate(self, watch: Watch | None = None, seconds: Mapping[str, float] = MappingProxyType({})) -> Execution:
        """Run to the end.

        ``watch`` is given something to look at before the run starts, so that another thread can show how far it is.
        An interrupt (Ctrl-C) ends the run with what was computed. ``seconds`` is what was spent before.
        """
        return self._run(None, watch, dict(seconds))

    def judged(
        self, watch: Watch | None = None, seconds: Mapping[str, float] = MappingProxyType({})
    ) -> tuple[Execution | None, Any]:
        """Run to the end, or to a finding of the judge: the run, or None and the finding."""
        try:
            return self._run(self._review(), watch, dict(seconds)), None
        except Judged as found:
            return None, found.finding

    def settled(self, watch: Watch | None, seconds: Mapping[str, float]) -> tuple[Prepared, Execution]:
        """Run to the end; from the start by the method for stiff modes where the run has come to a stiff stretch.

        Returns what has run, too.
        """
        made, stiff = self.judged(watch, seconds)
        if made is not None:
            return self, made
        other = self.by_stiff_method(stiff)
        return other, other.simulate(watch, seconds)

    def stream(self, sink: Sink, watch: Watch | None = None) -> tuple[Streamed | None, Any]:
        """Run the compiled loop to the end, or to a finding of the judge, and hand over what it writes, by chunks.

        Returns why it stopped, the run with what it has noted, and the last chunk; or None and the finding.
        """
        assert self.plan is not None
        run = CompiledRun(self.plan, self.plan.workspaces.new(structures.Task()), self._review())
        if watch is not None:
            watch(run)
        try:
            stop, rest = run.stream(sink)
        except Judged as found:
            return None, found.finding
        return (stop, run, rest), None

    def to_settled(self) -> Prepared:
        """The run by the method that it ends with: it is made once for that, in constant memory."""
        if self.plan is None or self.judge is None:
            return self
        _, stiff = self.stream(lambda chunk: None)
        return self if stiff is None else self.by_stiff_method(stiff)

    def by_stiff_method(self, why: str) -> Prepared:
        """The same run by the method for stiff modes, and the reason."""
        settings = self.settings
        method = METHODS["radau"].for_tolerance(settings.tolerance, self.arithmetic)
        chosen = replace(settings, method=method, method_chosen=f"{method.name}: {why}")
        return self._prepared(self.with_settings(chosen))

    def again(self, execution: Execution) -> Execution:
        """Make the same run finer."""
        rows = len(execution.times)  # fewer where a run was interrupted
        if rows not in self.finer:
            settings = finer_settings(self.settings, execution, self.arithmetic)
            self.finer[rows] = self._prepared(self.moved_with(settings))
        return self.finer[rows].simulate()

    def _prepared(self, problem: Problem) -> Prepared:
        return replace(prepare(problem, self.plan and self.plan.compiled), links=self.links)

    def _review(self) -> Review | None:
        return self.judge and Review(self.judge)

    @cached_property
    def _about(self) -> dict[str, Any]:
        return {**about(self, self.plan is not None), "repetition": self.again, **self.links}

    def _run(self, review: Review | None, watch: Watch | None, spent: dict[str, float]) -> Execution:
        plan = self.plan
        if plan is None:
            return self._by_python_loop(self._fresh(review), watch, spent)
        under_way = CompiledRun(plan, plan.workspaces.take(), review)
        if watch is not None:
            watch(under_way)
        began = time.perf_counter()
        stop = under_way.follow()
        spent["simulate"] = time.perf_counter() - began
        if watch is None:  # else someone may look at the workspace for longer than the run lasts
            plan.workspaces.leave(under_way.workspace)
        return written(self._about, under_way, stop, spent)

    def _fresh(self, review: Review | None) -> Run:
        """A run that nothing is recorded of yet."""
        from hsdsl.engine.simulate.recorder import Recorder, Room  # what is compiled needs none
        from hsdsl.engine.simulate.run import Run

        settings, arithmetic, program = self.settings, self.kernel.arithmetic, self.program
        degree = settings.method.degree if settings.method else 0
        outputs, width = len(program.outputs), max(len(mode.states) for mode in program.modes)
        room = Room.of(settings.memory, width, degree, outputs, arithmetic.digits)
        modes = tuple(mode.name for mode in program.modes)
        recorder = Recorder(
            arithmetic, settings.until, degree, outputs, room,
            scales=dict(settings.scale), modes=modes, review=review,
        )  # fmt: skip
        problem = vars(self.with_settings(settings))
        tails = Tails(self.waits)
        return Run(**problem, control=make_control(settings, arithmetic), recorder=recorder, tails=tails)

    def _by_python_loop(self, run: Run, watch: Watch | None, spent: dict[str, float]) -> Execution:
        from hsdsl.engine.simulate.contact import start_sizes
        from hsdsl.engine.simulate.recorder import OutOfRoom
        from hsdsl.engine.simulate.transitions import enter

        if watch is not None:
            watch(run.recorder)
        zero = run.arithmetic.zero
        began = time.perf_counter()
        try:
            here = enter(run, self.mode, self.states, zero, self.x, start_sizes(run, self.mode, self.x))
            stop = LOOPS[self.settings.scheme](run, here)
        except KeyboardInterrupt:
            if not run.recorder.arcs:
                raise
            stop = interrupted(run.recorder.now)
        except OutOfRoom:
            stop = memory(self.settings.memory, run.recorder.now)
        spent["simulate"] = time.perf_counter() - began
        return from_recorder(self._about, run, stop, spent)


def prepare(problem: Problem, code: CompiledModel | None = None, judge: Judge | None = None) -> Prepared:
    """Prepare a run by compiled code, by the Python loop where there is none."""
    return Prepared(**vars(problem), plan=code and CompiledPlan(problem, code), judge=judge)
