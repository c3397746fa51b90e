"""Who runs the instances of an ensemble: threads over the compiled loop, or the Python loop one after the other."""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence

import numpy as np

from hsdsl.execution import Execution
from hsdsl.simulate.compiled import CompiledPlan
from hsdsl.simulate.ensemble import CompiledEnsemble, Instances, Kept

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
    """Run all instances on so many threads; at Ctrl-C what is done is kept."""
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
    runs: Sequence[Callable[[], Execution]],
    instances: Instances,
    kept: Kept,
    names: tuple[str, ...],
    kinds: list[tuple[str, ...]],
    modes: list[str],
    progress: Progress | None,
) -> None:
    """Run all instances one after the other; at Ctrl-C what is done is kept."""
    try:
        for i, run in enumerate(runs):
            execution = run()
            if execution.stop.reason == "interrupted":
                return
            _keep(execution, i, instances, kept, names, kinds, modes)
            if progress is not None:
                progress(i + 1, len(runs))
    except KeyboardInterrupt:
        return


def _keep(
    execution: Execution,
    i: int,
    instances: Instances,
    kept: Kept,
    names: tuple[str, ...],
    kinds: list[tuple[str, ...]],
    modes: list[str],
) -> None:
    last, n = execution.arcs[-1], len(execution.arcs[-1].states)
    kept.stop[i] = execution.stop.reason
    kept.mode[i] = modes.index(last.mode)
    kept.kind[i] = kinds.index(last.states)
    kept.transitions[i] = len(execution.transitions)
    kept.ended[i] = execution.times[-1]
    kept.final[i, :n] = execution.values[-1, :n]
    kept.outputs[i] = execution.outputs[-1]
    times = [t.time for t in execution.transitions[: kept.crossed.shape[1]]]
    kept.crossed[i, : len(times)] = times
    inside = instances.time[i] <= execution.times[-1] + 1e-12 * abs(float(execution.times[-1]))
    samples = execution.sample(instances.time[i][inside])
    for k, name in enumerate(names):
        if name in samples.states:
            kept.states[i, k, np.flatnonzero(inside)] = samples[name]
    kept.results[i, np.flatnonzero(inside)] = samples.output_columns
