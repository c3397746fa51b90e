"""``Model.ensemble``: many runs of one model, by the compiled loop on all cores, or one after the other in Python."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from hsdsl.base.errors import UsageError
from hsdsl.base.limits import cores
from hsdsl.base.numbers.arithmetic import FLOAT64
from hsdsl.engine.execution import Array, Ensemble, Execution, TransitionTable
from hsdsl.engine.execution.run import columns_by_name
from hsdsl.engine.preparation import automatic
from hsdsl.engine.preparation.options import KEYS, Options
from hsdsl.engine.preparation.values import (
    InstanceTable,
    check_alone,
    check_memory,
    evaluate_parameters,
    initial_columns,
    setting_columns,
    start_of_parts,
    whole,
)
from hsdsl.engine.simulate import Prepared, Settings
from hsdsl.engine.simulate.ensemble import Instances, Kept
from hsdsl.engine.simulate.state_layouts import StateLayouts
from hsdsl.interface.model.ensemble_request import EnsembleRequest
from hsdsl.interface.model.workers import ArrayRecorder, Progress, run_compiled, run_in_turn

if TYPE_CHECKING:
    from hsdsl.interface.model import Model


class NothingToRunError(UsageError):
    """No instance of an ensemble has numbers to start with; ``why`` is the reason of the first one."""

    def __init__(self, why: str) -> None:
        super().__init__(f"no instance of the ensemble can be run: {why}")
        self.why = why


@dataclass(frozen=True, eq=False)
class SingleRuns:
    """Single runs of the instances of an ensemble, by their places."""

    model: Model
    request: EnsembleRequest

    def __call__(self, place: tuple[int, ...]) -> Execution:
        """Run one."""
        shape = self.request.shape
        return self.numbered(int(np.ravel_multi_index(place, shape)) if shape else 0)

    def numbered(self, index: int) -> Execution:
        """Run the one with this number."""
        return self.model.simulate(**self.request.single(index))


@dataclass(frozen=True, eq=False)
class PreparedEnsemble:
    """An ensemble that can start: ``places`` are the numbers of the instances that are not refused."""

    model: Model
    request: EnsembleRequest
    base: Prepared
    columns: InstanceTable
    places: list[int]
    instances: Instances
    kinds: list[tuple[str, ...]]

    @property
    def names(self) -> tuple[str, ...]:
        """The states of all modes."""
        return tuple(dict.fromkeys(name for kind in self.kinds for name in kind))

    @property
    def again(self) -> SingleRuns:
        """Single runs."""
        return SingleRuns(self.model, self.request)

    def run(self, threads: int, progress: Progress | None) -> Ensemble:
        """Run all instances."""
        began, program = time.perf_counter(), self.base.program
        plan, samples = self.base.plan, self.instances.time.shape[1]
        width = plan.compiled.table.width if plan else max(map(len, self.kinds))
        crossings, logs = self.request.transition_times, self.request.every_transition
        kept = Kept(len(self.places), width, len(program.outputs), len(self.names), samples, crossings, logs)
        if plan is None:
            again = [partial(self.again.numbered, place) for place in self.places]
            run_in_turn(again, ArrayRecorder(self.instances, kept, self.names, self.kinds, program), progress)
        else:
            run_compiled(plan, self.instances, kept, self.names, threads, progress)
        for i in np.flatnonzero(kept.stop == "stuck").tolist():  # only the message of such a run tells its reason
            kept.stop[i] = self.again.numbered(self.places[i]).stop.reason
        return self._ensemble(kept, time.perf_counter() - began)

    def _ensemble(self, kept: Kept, seconds: float) -> Ensemble:
        shape, settings = self.request.shape, self.base.settings
        program = self.base.program

        def placed(array: Array, missing: Any) -> Array:
            """Put an array in its place among all instances."""
            full = np.full((len(self.columns.rows), *array.shape[1:]), missing, dtype=array.dtype)
            full[self.places] = array
            return full.reshape((*shape, *array.shape[1:]))

        def columns(arrays: Iterable[tuple[str, Array]]) -> dict[str, Array]:
            return {name: placed(column, math.nan) for name, column in arrays}

        sampled = [(name, kept.states[:, i]) for i, name in enumerate(self.names)]
        sampled += [(name, kept.results[:, :, i]) for i, name in enumerate(program.outputs)]
        final, _ = columns_by_name(kept.final, kept.kind, self.kinds, self.names)
        modes = np.array([*program.mode_names, ""])
        refused = self.columns.refused.items()
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
            warnings=placed(kept.noted.astype(str), ""),
            transition_times=placed(kept.crossed, math.nan),
            sample_times=placed(self.instances.time, math.nan),
            samples=columns(sampled if self.instances.time.shape[1] else ()),
            seconds={"simulate": seconds},
            refusals={tuple(map(int, np.unravel_index(k, shape))): why for k, why in refused},
            transition_table=self._transition_table(kept, placed(kept.transitions, 0)) if kept.logs else None,
            again=self.again,
            title=self.base.program.title,
        )

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


def prepare_ensemble(model: Model, request: EnsembleRequest) -> PreparedEnsemble:
    """Compute the numbers of every instance.

    Raises UsageError: none of them can be run.
    """
    pipeline, call = model.pipeline, request.call
    values = pipeline.values(FLOAT64)
    columns = InstanceTable(values, [()] * math.prod(request.shape))
    evaluate_parameters(columns, call["parameters"], request.arrays(initial=False))
    finite = np.logical_and.reduce([np.isfinite(array) for array in request.varied.values()] or [[True]])
    first = next((k for k in np.flatnonzero(finite).tolist() if k not in columns.refused), None)
    if first is None:
        why = next(iter(columns.refused.values()), "there is none" if len(finite) == 0 else "a value is not finite")
        raise NothingToRunError(why)
    base = automatic.settled(pipeline.prepare(request.single(first)))
    varied = request.arrays(initial=True)
    shared = start_of_parts(pipeline.program, dict.fromkeys(varied) | call["initial"])
    shared = {name: value for name, value in shared.items() if name not in varied}
    start = np.array(initial_columns(columns, base.states, shared, varied), dtype=float)
    check_alone(base.program.modes[base.mode], start)
    options = pipeline.resolve(call.get("settings"), {key: call.get(key) for key in KEYS})
    settings = _settings(columns, base.settings, options)
    places = list(settings)
    until = np.full(len(columns.rows), math.nan)
    until[places] = [settings[k].until for k in places]
    samples, times = request.times(until, columns)
    kept = 2 * len(base.states) + request.transition_times + samples * (1 + len(model.columns))
    check_memory(base.settings.memory, len(columns.rows), "instances", kept)
    instances = Instances(
        settings=list(settings.values()),
        timelines=[pipeline.timeline(values, columns.rows[k], settings[k].until) for k in places],
        start=start.reshape(len(base.states), len(columns.rows)).T[places],
        time=times()[places],
    )
    kinds = list(StateLayouts(model.program, base.states).kinds)
    return PreparedEnsemble(model, request, base, columns, places, instances, kinds)


def _settings(columns: InstanceTable, base: Settings, options: Options) -> dict[int, Settings]:
    """The settings of every instance that can be run, by its number."""
    rows = enumerate(setting_columns(options, columns))
    kept: Mapping[int, dict[str, Any]] = {k: row for k, row in rows if k not in columns.refused}
    if any(row[options.size] != getattr(base, options.size) for row in kept.values()):
        raise UsageError(f"{options.size} differs between the instances of an ensemble", "give it as a number")
    return {k: replace(base, **row) for k, row in kept.items()}


def run_ensemble(
    model: Model,
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
    request = EnsembleRequest.of(model.program, call, samples, transition_times, every_transition)
    completion = model.resolve(call.get("settings"), {"completion": call.get("completion")}).values["completion"].value
    return prepare_ensemble(model.sliding if completion == "auto" else model, request).run(threads or cores(), progress)
