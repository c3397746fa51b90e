"""``Model.ensemble``: many runs of one model, by the compiled loop on all cores, or one after the other in Python.

A request has what every run shares, the arrays that vary, and the times of samples; prepared, it has numbers of every
instance. What runs keep is put into arrays.
"""

from __future__ import annotations

import math
import re
import threading
import time
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from hsdsl.base.errors import UsageError
from hsdsl.base.limits import cores
from hsdsl.base.names import INITIAL
from hsdsl.base.numbers.arithmetic import TIE
from hsdsl.base.numbers.columns import Column, varies
from hsdsl.engine.execution import Array, Ensemble, Execution, Transition, TransitionTable
from hsdsl.engine.execution.run import columns_by_name
from hsdsl.engine.preparation.experiment import check_alone, initial_columns, setting_columns, start_of_parts
from hsdsl.engine.preparation.options import KEYS, check_arguments, overrides_of
from hsdsl.engine.preparation.pipeline import Pipeline
from hsdsl.engine.preparation.values import InstanceTable, check_memory, column_of, evaluate_parameters, whole
from hsdsl.engine.runtime import structures
from hsdsl.engine.simulate import Prepared
from hsdsl.engine.simulate.columns import StateLayouts
from hsdsl.engine.simulate.compiled import CompiledPlan
from hsdsl.engine.simulate.ensemble import CompiledEnsemble, Instances, Kept, Logged
from hsdsl.engine.simulate.input_segments import Timeline
from hsdsl.engine.simulate.stops import SENTENCES
from hsdsl.mathematics.program import Routines

if TYPE_CHECKING:
    from hsdsl.interface.model.runs import Runs


class NothingToRunError(UsageError):
    """No instance of an ensemble has numbers to start with; ``why`` is the reason of the first one."""

    def __init__(self, why: str) -> None:
        super().__init__(f"no instance of the ensemble can be run: {why}")
        self.why = why


@dataclass(frozen=True, eq=False)
class PreparedEnsemble:
    """An ensemble that can start: ``places`` are the numbers of the instances that are not refused."""

    request: EnsembleRequest
    base: Prepared
    table: InstanceTable
    places: list[int]
    instances: Instances
    kinds: list[tuple[str, ...]]

    @property
    def names(self) -> tuple[str, ...]:
        """The states of all modes."""
        return tuple(dict.fromkeys(name for kind in self.kinds for name in kind))

    def run(self, threads: int, progress: Progress | None) -> Ensemble:
        """Run all instances."""
        began, program = time.perf_counter(), self.base.program
        plan, samples = self.base.plan, self.instances.time.shape[1]
        width = plan.compiled.table.width if plan else max(map(len, self.kinds))
        crossings, logs = self.request.transition_times, self.request.every_transition
        kept = Kept(len(self.places), width, len(program.outputs), len(self.names), samples, crossings, logs)
        if plan is None:
            with suppress(KeyboardInterrupt):  # those that are done are kept
                for i, place in enumerate(self.places):
                    prepared = self.request.model.pipeline.prepare(self.request.single(place))
                    execution = prepared.settled(None, {})[1]  # of parts the composed run, as in C
                    if execution.stop.reason == "interrupted":
                        break
                    self._record(kept, i, execution)
                    if progress is not None:
                        progress(i + 1, len(self.places))
        else:
            run_compiled(plan, self.instances, kept, self.names, threads, progress)
        for i in np.flatnonzero(kept.stop == "stuck").tolist():  # only the message of such a run tells its reason
            kept.stop[i] = self.request.run(self.places[i]).stop.reason
        return self._ensemble(kept, time.perf_counter() - began)

    def _record(self, kept: Kept, i: int, execution: Execution) -> None:
        """Record the execution of an instance."""
        last, program = execution.arcs[-1], self.base.program
        n, end = len(last.states), execution.times[-1]
        kept.stop[i] = execution.stop.reason
        modes = program.mode_names
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
            kept.log[i] = self._logged(kept.width, execution.transitions)

    def _logged(self, width: int, transitions: Sequence[Transition]) -> Logged:
        nan, program = float("nan"), self.base.program
        table = np.zeros(len(transitions), structures.TRANSITION)
        before, after = np.full((2, len(transitions), width), nan)
        for k, made in enumerate(transitions):
            source = program.mode_names.index(made.source)
            edges = [edge.name for edge in program.modes[source].edges]
            resumed = nan if made.resumed is None else made.resumed
            table[k] = made.time, resumed, source, edges.index(made.edge), made.entry, len(made.alternatives)
            before[k, : len(made.before)] = list(made.before.values())
            after[k, : len(made.after or ())] = list((made.after or {}).values())
        return table, before, after

    def _ensemble(self, kept: Kept, seconds: float) -> Ensemble:
        shape, settings = self.request.shape, self.base.settings
        program = self.base.program

        def placed(array: Array, missing: Any) -> Array:
            """Put an array in its place among all instances."""
            if len(array) == self.table.count:
                return array.reshape((*shape, *array.shape[1:]))
            full = np.full((self.table.count, *array.shape[1:]), missing, dtype=array.dtype)
            full[self.places] = array
            return full.reshape((*shape, *array.shape[1:]))

        def columns(arrays: Iterable[tuple[str, Array]]) -> dict[str, Array]:
            return {name: placed(column, math.nan) for name, column in arrays}

        sampled = [(name, kept.states[:, i]) for i, name in enumerate(self.names)]
        sampled += [(name, kept.results[:, :, i]) for i, name in enumerate(program.outputs)]
        final, _ = columns_by_name(kept.final, kept.kind, self.kinds, self.names)
        modes = np.array([*program.mode_names, ""])
        refused = self.table.refused.items()
        return Ensemble(
            model=program.path,
            digest=program.digest,
            engine="python" if self.base.plan is None else "c",
            scheme=settings.scheme,
            method=settings.method.name if settings.method else "two-step",
            shape=shape,
            varied={name: array.reshape(shape) for name, array in self.request.varied.items()},
            stop=placed(kept.stop, "refused"),
            time=placed(kept.ended, math.nan),
            mode=placed(modes[kept.mode], ""),
            state=columns(zip(self.names, final.T, strict=True)),
            outputs=columns((name, kept.outputs[:, i]) for i, name in enumerate(program.outputs)),
            transitions=placed(kept.transitions, 0),
            warnings=placed(self._codes(kept.noted.astype(str)), ""),
            transition_times=placed(kept.crossed, math.nan),
            sample_times=placed(self.instances.time, math.nan),
            samples=columns(sampled if self.instances.time.shape[1] else ()),
            seconds={"simulate": seconds},
            refusals={tuple(map(int, np.unravel_index(k, shape))): why for k, why in refused},
            transition_table=self._transition_table(kept, placed(kept.transitions, 0)) if kept.logs else None,
            again=self.request,
            title=self.base.program.title,
            units=self.base.program.units,
        )

    def _codes(self, noted: Array) -> Array:
        """The codes of warnings, with that of initial ranges of which the runs take the centre."""
        given = {*self.request.call["initial"], *self.request.arrays(initial=True)}
        centred = any(name not in given for name in self.base.program.ranges)
        return np.char.strip(np.char.add(noted, f" {SENTENCES['assumed'][0]}")) if centred else noted

    def _transition_table(self, kept: Kept, counts: Array) -> TransitionTable:
        made, *around = kept.logged()
        modes, names = self.base.program.modes, self.names
        edges = [(mode, edge) for mode in modes for edge in mode.edges]
        offsets = np.cumsum([0, *(len(mode.edges) for mode in modes)])
        number = offsets[made["mode"]] + made["edge"]
        layouts = [mode.states for mode, _ in edges], [edge.target_states for _, edge in edges]
        around[1][np.isnan(made["resumed"])] = math.nan
        states = [columns_by_name(v, number, of, names)[0].T for v, of in zip(around, layouts, strict=True)]
        before, after = (dict(zip(names, columns, strict=True)) for columns in states)
        known = np.array([edge.name for _, edge in edges], dtype=str)
        first = np.concatenate([[0], np.cumsum(counts)])
        return TransitionTable(first, made["time"], known[number], made["entry"] != 0, before, after)


def prepare_ensemble(request: EnsembleRequest) -> PreparedEnsemble:
    """Compute the numbers of every instance.

    Raises UsageError: none of them can be run.
    """
    model, call = request.model, request.call
    pipeline = model.pipeline
    table = InstanceTable.of_many(pipeline.values(), math.prod(request.shape))
    evaluate_parameters(table, call["parameters"], request.arrays(initial=False))
    finite = np.logical_and.reduce([np.isfinite(array) for array in request.varied.values()] or [[True]])
    first = next((k for k in np.flatnonzero(finite).tolist() if k not in table.refused), None)
    if first is None:
        why = next(iter(table.refused.values()), "there is none" if len(finite) == 0 else "a value is not finite")
        raise NothingToRunError(why)
    base = pipeline.prepare(request.single(first)).to_settled()
    varied = request.arrays(initial=True)
    shared = start_of_parts(pipeline.program, dict.fromkeys(varied) | call["initial"])
    shared = {name: value for name, value in shared.items() if name not in varied}
    start = np.empty((table.count, len(base.states)))
    for k, column in enumerate(initial_columns(table, base.states, shared, varied)):
        start[:, k] = column
    check_alone(base.program.modes[base.mode], start.T)
    options = pipeline.resolve(call.get("settings"), {key: call.get(key) for key in KEYS})
    settings = setting_columns(options, table)
    places = np.delete(np.arange(table.count), list(table.refused))
    if np.any(np.broadcast_to(settings[options.size], table.count)[places] != getattr(base.settings, options.size)):
        raise UsageError(f"{options.size} differs between the instances of an ensemble", "give it as a number")
    until = np.full(table.count, math.nan)
    until[places] = np.broadcast_to(settings["until"], table.count)[places]
    samples, times = request.times(until, table)
    kept = 2 * len(base.states) + request.transition_times + samples * (1 + len(model.columns))
    check_memory(base.settings.memory, table.count, "instances", kept)

    def placed(column: Column) -> Column:
        """Leave those out that are refused."""
        return column[places] if varies(column) else column

    settings = {name: placed(settings[name]) for name in ("until", "relaxation", "max_transitions")} | {
        "scale": {name: placed(column) for name, column in settings["scale"].items()}
    }
    parameters = [*map(placed, table.parameters)]
    timelines = _timelines(pipeline, base, parameters, settings["until"], len(places))
    instances = Instances(len(places), settings, parameters, timelines, placed(start), times()[places])
    kinds = list(StateLayouts(model.program, base.states).kinds)
    return PreparedEnsemble(request, base, table, places.tolist(), instances, kinds)


def _timelines(
    pipeline: Pipeline, base: Prepared, parameters: Sequence[Column], until: Column, count: int
) -> list[Timeline]:
    """The timeline that instances share but for their parameters and ends; that of each where there is none such."""
    program = base.program
    decisive = parameters_of(program.constants, "input_") | parameters_of(program.switching, "")
    timed = until if program.inputs or program.switches else None
    if not varies(timed, *(column for k, column in enumerate(parameters) if f"p{k}" in decisive)):
        return [base.timeline]
    rows = zip(*(column_of(column, count).tolist() for column in (*parameters, until)), strict=True)
    return [pipeline.timeline(pipeline.values(), row, end) for *row, end in rows]


def parameters_of(routines: Routines, name: str) -> set[str]:
    """The parameters that routines are computed from, of those whose names begin so."""
    texts = (text for text in routines.source.split("    def ")[1:] if text.startswith(name))
    return set(re.findall(r"\bp\d+\b", "".join(texts)))


def run_ensemble(
    model: Runs,
    call: dict[str, Any],
    samples: Any,
    transition_times: int,
    threads: int | None,
    progress: Callable[[int, int], None] | None,
    every_transition: bool = False,
) -> Ensemble:
    """Run many instances of a model; see `Model.ensemble`."""
    if threads is not None:
        whole(threads, "threads", least=1)
    model = model.sliding if model.pipeline.slides(call) else model
    request = EnsembleRequest.of(model, call, samples, transition_times, every_transition)
    return prepare_ensemble(request).run(threads or cores(), progress)


@dataclass(frozen=True, eq=False)
class EnsembleRequest:
    """The arguments of an ensemble: ``call`` has those of every single run, and ``varied`` the arrays by name.

    The arrays are flattened; ``shape`` is their common shape. Called with a place there it runs that instance.
    """

    model: Runs
    call: dict[str, Any]
    varied: dict[str, Array]
    shape: tuple[int, ...]
    samples: int | Array | str | None
    transition_times: int
    every_transition: bool = False

    @staticmethod
    def of(
        model: Runs, call: dict[str, Any], samples: Any, transition_times: int, every_transition: bool = False
    ) -> EnsembleRequest:
        """Sort the arguments.

        Raises UsageError: an argument that a run does not take, a value that is no number, no expression and no array
        of numbers, arrays without a common shape, or samples that are neither a number of them nor times.
        """
        check_arguments(call, "an ensemble", without=("samples", "precision"))
        whole(transition_times, "transition_times", least=0)
        varied: dict[str, Array] = {}
        for group, prefix in (("parameters", ""), ("initial", INITIAL)):
            given = overrides_of(call, group, model.program)
            varied |= {prefix + name: _array(name, value) for name, value in given.items() if np.ndim(value) > 0}
            alone = {name: value for name, value in given.items() if np.ndim(value) == 0}
            call = call | {group: {name: x.item() if hasattr(x, "item") else x for name, x in alone.items()}}
        try:
            common = np.broadcast_arrays(*varied.values())
        except ValueError:
            shapes = ", ".join(f"{name} has {array.shape}" for name, array in varied.items())
            several = [name for name, array in varied.items() if array.ndim == 1]
            hint = f"for every combination give columns and rows: {several[0]} as array[:, None]" if several else None
            raise UsageError(f"the arrays of an ensemble have no common shape: {shapes}", hint) from None
        shape = common[0].shape if common else ()
        flat = {name: array.reshape(-1) for name, array in zip(varied, common, strict=True)}
        return EnsembleRequest(model, call, flat, shape, _samples(samples), transition_times, every_transition)

    def arrays(self, initial: bool) -> dict[str, Array]:
        """The columns of initial states or of parameters, by name."""
        columns = ((name, array) for name, array in self.varied.items() if name.startswith(INITIAL) == initial)
        return {name.removeprefix(INITIAL): array for name, array in columns}

    def __call__(self, place: tuple[int, ...]) -> Execution:
        """Run the instance at a place."""
        return self.run(int(np.ravel_multi_index(place, self.shape)) if self.shape else 0)

    def run(self, index: int) -> Execution:
        """Run the instance with this number by itself."""
        return self.model.simulate(**self.single(index))

    def single(self, index: int) -> dict[str, Any]:
        """The arguments of the single run of one instance."""
        own = {"parameters": dict(self.call["parameters"]), "initial": dict(self.call["initial"])}
        for name, array in self.varied.items():
            group = "initial" if name.startswith(INITIAL) else "parameters"
            own[group][name.removeprefix(INITIAL)] = float(array[index])
        return self.call | own

    def times(self, until: Array, table: InstanceTable) -> tuple[int, Callable[[], Array]]:
        """The number of samples of an instance, and what makes their times, shape (instances, samples).

        After the last sample of an instance that has fewer than others come not-a-numbers.
        """
        given = self.samples
        if given is None:
            return 0, lambda: np.empty((len(until), 0))
        if isinstance(given, str):
            step = column_of(table.expression(given, "the time between samples"), table.count)
            if wrong := [value for value in step[np.isfinite(until)].tolist() if not value > 0]:
                raise UsageError(f"the time between samples must be positive, not {wrong[0]:g}")
            with np.errstate(invalid="ignore"):
                count = np.floor(until / step * (1 + TIE)) + 1
            most = int(min(np.nanmax(count, initial=0), 2**62))

            def times() -> Array:
                times = step[:, None] * np.arange(most)
                return np.where(np.arange(most) < count[:, None], np.minimum(times, until[:, None]), math.nan)

            return most, times
        if isinstance(given, int):
            ends, most = until[:, None], given - 1
            return given, lambda: np.concatenate([ends * np.arange(most) / most, ends], axis=1)
        return len(given), lambda: np.tile(given, (len(until), 1))


def _array(name: str, value: Any) -> Array:
    if np.ma.is_masked(value):
        raise UsageError(f"{name}: elements of the array are masked, and have no value", "leave those instances out")
    try:
        return np.asarray(value, dtype=float)
    except (TypeError, ValueError):
        raise UsageError(f"{name}: expected a number, an expression or an array of numbers") from None


def _samples(given: Any) -> int | Array | str | None:
    """A number of samples, their times, or the time between them as an expression of parameters."""
    if given is None or isinstance(given, str):
        return given
    if np.ndim(given) == 1 and not isinstance(given, str):
        times = np.asarray(given, dtype=float)
        if np.isfinite(times).all() and (times >= 0).all() and (np.diff(times) >= 0).all():
            return times
    elif isinstance(given, int) and not isinstance(given, bool) and given >= 2:
        return given
    raise UsageError("samples of an ensemble are times from 0 on that never decrease, or a whole number of at least 2")


SHARE = 4  # a thread takes this part of what is its share of the instances that are left, so that all end together
MOST_AT_ONCE = 4096  # instances that a thread takes at a time
INTERVAL = 0.1  # seconds between looks at how far it is
PATIENCE = 0.25  # seconds until code is compiled that steps many runs at once, unless it is kept: that takes a second
Progress = Callable[[int, int], None]


def run_compiled(
    plan: CompiledPlan,
    instances: Instances,
    kept: Kept,
    names: tuple[str, ...],
    threads: int,
    progress: Progress | None,
) -> None:
    """Run all instances on ``threads`` threads; Ctrl-C keeps the finished ones."""
    ensemble, count = CompiledEnsemble(plan, instances, kept, names), instances.count
    ensemble.look_for_lanes(compiles=False)
    slices, failed = iter(_slices(count, threads, ensemble.fewest)), list[BaseException]()

    def work() -> None:
        try:
            place = None
            while not ensemble.stopped and (taken := next(slices, None)) is not None:  # one at a time: the GIL
                place = ensemble.place(place)
                ensemble.work(*taken, place)
        except BaseException as error:
            failed.append(error)
            ensemble.stop()

    workers = [threading.Thread(target=work, daemon=True) for _ in range(min(threads, count))]
    began, compiler = time.perf_counter(), threading.Thread(target=ensemble.look_for_lanes, args=(True,), daemon=True)
    for worker in workers:
        worker.start()
    try:
        for worker in workers:
            while worker.is_alive():
                worker.join(INTERVAL)
                done = int(np.count_nonzero(kept.reason >= 0))
                if time.perf_counter() - began > PATIENCE and 2 * done < count and compiler.ident is None:
                    compiler.start()
                if progress is not None:
                    progress(done, count)
    except KeyboardInterrupt:
        pass
    finally:
        ensemble.stop()
        for thread in (*workers, compiler):
            if thread.ident is not None:
                thread.join()
    if failed:
        raise failed[0]
    kept.told()


def _slices(count: int, threads: int, fewest: int) -> list[tuple[int, int]]:
    """Instances that a thread takes at a time, from the first up to the last: fewer towards the end."""
    found, first = list[tuple[int, int]](), 0
    while first < count:
        share = -(-(count - first) // (SHARE * threads))
        last = min(count, first + max(fewest, min(MOST_AT_ONCE, share)))
        found.append((first, last))
        first = last
    return found
