"""Runs of the instances of an ensemble: by threads over the compiled loop, or one after the other in Python."""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from hsdsl.base.numbers.arithmetic import TIE
from hsdsl.engine.execution import Execution, Transition
from hsdsl.engine.runtime import structures
from hsdsl.engine.simulate.compiled import CompiledPlan
from hsdsl.engine.simulate.ensemble import CompiledEnsemble, Instances, Kept, Logged
from hsdsl.mathematics.program import Program

SLICE = 32  # instances that a thread takes at a time
INTERVAL = 0.1  # seconds between looks at how far it is
Progress = Callable[[int, int], None]


def run_compiled(
    plan: CompiledPlan,
    instances: Instances,
    kept: Kept,
    names: tuple[str, ...],
    threads: int,
    progress: Progress | None,
) -> None:
    """Run all instances on so many threads; at Ctrl-C finished ones are kept."""
    ensemble, count = CompiledEnsemble(plan, instances, kept, names), len(instances.settings)
    firsts, failed = iter(range(0, count, SLICE)), list[BaseException]()

    def work() -> None:
        try:
            place = ensemble.place()
            while not ensemble.stopped and (first := next(firsts, None)) is not None:  # one at a time: the GIL
                ensemble.work(first, min(first + SLICE, count), place)
        except BaseException as error:
            failed.append(error)
            ensemble.stop()

    workers = [threading.Thread(target=work, daemon=True) for _ in range(min(threads, max(1, -(-count // SLICE))))]
    for worker in workers:
        worker.start()
    try:
        for worker in workers:
            while worker.is_alive():
                worker.join(INTERVAL)
                if progress is not None:
                    progress(int(np.count_nonzero(kept.reason >= 0)), count)
    except KeyboardInterrupt:
        pass
    finally:
        ensemble.stop()
        for worker in workers:
            worker.join()
    if failed:
        raise failed[0]


def run_in_turn(
    runs: Sequence[Callable[[], Execution]], record: Callable[[int, Execution], None], progress: Progress | None
) -> None:
    """Run all instances one after the other and record each; at Ctrl-C those that are done are kept."""
    try:
        for i, run in enumerate(runs):
            execution = run()
            if execution.stop.reason == "interrupted":
                return
            record(i, execution)
            if progress is not None:
                progress(i + 1, len(runs))
    except KeyboardInterrupt:
        return


@dataclass(frozen=True, eq=False)
class ArrayRecorder:
    """Arrays for executions; ``kinds`` are the layouts of states, ``names`` those of all states."""

    instances: Instances
    kept: Kept
    names: tuple[str, ...]
    kinds: list[tuple[str, ...]]
    program: Program

    def __call__(self, i: int, execution: Execution) -> None:
        """Record the execution of an instance."""
        kept, last = self.kept, execution.arcs[-1]
        n, end = len(last.states), execution.times[-1]
        kept.stop[i] = execution.stop.reason
        modes = self.program.mode_names
        kept.noted[i] = execution.noted(execution) if execution.noted else ""
        kept.mode[i] = modes.index(last.mode)
        kept.kind[i] = self.kinds.index(last.states)
        kept.transitions[i] = len(execution.transitions)
        kept.ended[i] = end
        kept.final[i, :n] = execution.values[-1, :n]
        kept.outputs[i] = execution.outputs[-1]
        times = [t.time for t in execution.transitions[: kept.crossed.shape[1]]]
        kept.crossed[i, : len(times)] = times
        inside = np.flatnonzero(self.instances.time[i] <= end + TIE * abs(float(end)))
        samples = execution.sample(self.instances.time[i][inside])
        for k, name in enumerate(self.names):
            if name in samples.states:
                kept.states[i, k, inside] = samples[name]
        kept.results[i, inside] = samples.output_columns
        if kept.logs:
            kept.log[i] = self._logged(execution.transitions, modes)

    def _logged(self, transitions: Sequence[Transition], modes: tuple[str, ...]) -> Logged:
        nan = float("nan")
        table = np.zeros(len(transitions), structures.TRANSITION)
        before, after = np.full((2, len(transitions), self.kept.width), nan)
        for k, made in enumerate(transitions):
            source = modes.index(made.source)
            edges = [edge.name for edge in self.program.modes[source].edges]
            resumed = nan if made.resumed is None else made.resumed
            table[k] = made.time, resumed, source, edges.index(made.edge), made.entry, len(made.alternatives)
            before[k, : len(made.before)] = list(made.before.values())
            after[k, : len(made.after or ())] = list((made.after or {}).values())
        return table, before, after
