"""``Model.ensemble``: many runs of one model, by the compiled loop on all cores, or one after the other in Python."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from hsdsl.errors import UsageError
from hsdsl.execution import Array, Ensemble, Execution
from hsdsl.model.instances import (
    Columns,
    Varied,
    broadcast,
    initial_rows,
    parameter_rows,
    settings_rows,
    split,
)
from hsdsl.model.options import KEYS
from hsdsl.model.settings import check_memory, whole
from hsdsl.model.values import Values
from hsdsl.model.workers import Progress, run_compiled, run_in_turn
from hsdsl.names import did_you_mean
from hsdsl.simulate import Prepared
from hsdsl.simulate.ensemble import Instances, Kept
from hsdsl.simulate.layouts import Layouts

if TYPE_CHECKING:
    from hsdsl.model import Model

INITIAL = "initial."


@dataclass(frozen=True)
class EnsembleRequest:
    """What an ensemble is asked for: ``call`` is what every single run of it is asked for."""

    parameters: dict[str, Any]
    initial: dict[str, Any]
    varied: Varied
    samples: int | Array | None
    transition_times: int
    call: dict[str, Any]

    @staticmethod
    def of(
        parameters: Mapping[str, Any], initial: Mapping[str, Any], samples: Any, crossings: int, call: dict[str, Any]
    ) -> EnsembleRequest:
        """Sort out what the instances share and what is varied.

        Raises
        ------
        UsageError
            Arrays without a common shape, or samples that are neither how many nor times.
        """
        shared, by_parameter = split(parameters)
        shared_initial, by_state = split(initial)
        varied = broadcast(by_parameter | {INITIAL + name: array for name, array in by_state.items()})
        return EnsembleRequest(shared, shared_initial, varied, _samples(samples), crossings, call)

    def arrays(self, initial: bool) -> dict[str, Array]:
        """What is varied, of initial states or of parameters, by name."""
        arrays = self.varied.arrays.items()
        return {name.removeprefix(INITIAL): array for name, array in arrays if name.startswith(INITIAL) == initial}

    def single(self, index: int) -> dict[str, Any]:
        """What the single run of one instance is asked for."""
        own = [{name: float(a[index]) for name, a in self.arrays(initial).items()} for initial in (False, True)]
        return self.call | {"parameters": self.parameters | own[0], "initial": self.initial | own[1]}

    @property
    def sample_count(self) -> int:
        """How many samples are taken of each instance."""
        return self.samples if isinstance(self.samples, int) else 0 if self.samples is None else len(self.samples)

    def times(self, until: Array) -> Array:
        """The sample times of every instance, shape (instances, samples)."""
        if self.samples is None:
            return np.empty((len(until), 0))
        if isinstance(self.samples, int):
            n = self.samples
            return np.concatenate([until[:, None] * np.arange(n - 1) / (n - 1), until[:, None]], axis=1)
        return np.repeat(self.samples[None, :], len(until), axis=0)


def _samples(asked: Any) -> int | Array | None:
    if asked is None:
        return None
    if np.ndim(asked) == 1 and not isinstance(asked, str):
        times = np.asarray(asked, dtype=float)
        if np.isfinite(times).all() and (times >= 0).all() and (np.diff(times) >= 0).all():
            return times
    elif isinstance(asked, int) and not isinstance(asked, bool) and asked >= 2:
        return asked
    raise UsageError("samples of an ensemble are times from 0 on that never decrease, or a whole number of at least 2")


@dataclass(frozen=True, eq=False)
class Again:
    """Single runs of the instances of an ensemble, by their places."""

    model: Model
    asked: EnsembleRequest

    def __call__(self, place: tuple[int, ...]) -> Execution:
        """Run one."""
        shape = self.asked.varied.shape
        return self.numbered(int(np.ravel_multi_index(place, shape)) if shape else 0)

    def numbered(self, index: int) -> Execution:
        """Run the one with this number."""
        return self.model.simulate(**self.asked.single(index))


@dataclass(frozen=True, eq=False)
class Ready:
    """An ensemble that can start. ``places`` are the numbers of the instances that are not refused."""

    model: Model
    asked: EnsembleRequest
    base: Prepared
    columns: Columns
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
        outputs, crossings = len(program.outputs), self.asked.transition_times
        plan, samples = self.base.plan, self.instances.time.shape[1]
        width = plan.compiled.table.width if plan else max(map(len, self.kinds))
        kept = Kept(len(self.places), width, outputs, len(self.names), samples, crossings)
        if plan is None:
            modes = [mode.name for mode in program.modes]
            again = [partial(self.again.numbered, place) for place in self.places]
            run_in_turn(again, self.instances, kept, self.names, self.kinds, modes, progress)
        else:
            run_compiled(plan, self.instances, kept, self.names, threads, progress)
        return self._ensemble(kept, time.perf_counter() - began)

    @property
    def again(self) -> Again:
        """Single runs."""
        return Again(self.model, self.asked)

    def _ensemble(self, kept: Kept, seconds: float) -> Ensemble:
        shape, settings = self.asked.varied.shape, self.base.settings
        program, plan, states = self.base.program, self.base.plan, self._states(kept)

        def placed(array: Array, missing: Any) -> Array:
            """Put what was kept in its place among all instances."""
            full = np.full((self.columns.count, *array.shape[1:]), missing, dtype=array.dtype)
            full[self.places] = array
            return full.reshape((*shape, *array.shape[1:]))

        nan = float("nan")
        samples = {name: kept.states[:, i] for i, name in enumerate(self.names)}
        samples |= {name: kept.results[:, :, i] for i, name in enumerate(program.outputs)}
        outputs = {name: kept.outputs[:, i] for i, name in enumerate(program.outputs)}
        modes = np.array([*(mode.name for mode in program.modes), ""])
        refused = {tuple(map(int, np.unravel_index(k, shape))): why for k, why in self.columns.refused.items()}
        return Ensemble(
            model=program.path,
            digest=program.digest,
            engine="python" if plan is None else "c",
            scheme=settings.scheme,
            method=settings.method.name if settings.method else "two-step",
            shape=shape,
            varied={name: array.reshape(shape) for name, array in self.asked.varied.arrays.items()},
            stop=placed(self._stops(kept), "refused"),
            time=placed(kept.ended, nan),
            mode=placed(modes[kept.mode], ""),
            state={name: placed(column, nan) for name, column in states.items()},
            outputs={name: placed(column, nan) for name, column in outputs.items()},
            transitions=placed(kept.transitions, 0),
            transition_times=placed(kept.crossed, nan),
            sample_times=placed(self.instances.time, nan),
            samples={name: placed(column, nan) for name, column in samples.items() if self.instances.time.shape[1]},
            seconds={"simulate": seconds},
            refusals=refused,
            again=self.again,
        )

    def _states(self, kept: Kept) -> dict[str, Array]:
        """The final states by name; where they stand depends on the mode."""
        found = {name: np.full(len(self.places), float("nan")) for name in self.names}
        for number, kind in enumerate(self.kinds):
            here = kept.kind == number
            for i, name in enumerate(kind):
                found[name][here] = kept.final[here, i]
        return found

    def _stops(self, kept: Kept) -> Array:
        """Why each run ended; of one that was stuck only its own message tells."""
        for i in np.flatnonzero(kept.stop == "stuck").tolist():
            kept.stop[i] = self.again.numbered(self.places[i]).stop.reason
        return kept.stop


def ready(model: Model, values: Values, asked: EnsembleRequest, prepare: Callable[..., Prepared]) -> Ready:
    """Compute the numbers of every instance.

    Raises
    ------
    UsageError
        None of them can be run.
    """
    request = model.resolve(asked.call.get("settings"), {k: v for k, v in asked.call.items() if k not in OUTSIDE})
    columns = parameter_rows(values, asked.parameters, asked.arrays(initial=False), asked.varied.count)
    first = next((k for k in range(columns.count) if k not in columns.refused), None)
    if first is None:
        why = next(iter(columns.refused.values()), "there is none")
        raise UsageError(f"no instance of the ensemble can be run: {why}")
    base = prepare(asked.single(first))
    kept = 2 * len(base.states) + asked.transition_times + asked.sample_count * (1 + len(model.columns))
    check_memory(base.settings.memory, columns.count, "instances", kept)
    start = initial_rows(columns, base.states, asked.initial, asked.arrays(initial=True))
    settings = settings_rows(columns, base.settings, request)
    places = [k for k in range(columns.count) if k not in columns.refused]
    timeline = partial(model.pipeline.timeline, values)
    instances = Instances(
        settings=[settings[k] for k in places],
        timelines=[timeline(columns.rows[k], settings[k].until) for k in places],
        start=start[places],
        time=asked.times(np.array([settings[k].until for k in places], dtype=float)),
    )
    return Ready(model, asked, base, columns, places, instances, list(Layouts(model.program, base.states).kinds))


OUTSIDE = ("settings", "engine", "parameters", "initial")  # of what a run is asked for, these are no settings


def cores() -> int:
    """How many cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def check(asked: Mapping[str, Any], threads: int | None, transition_times: int) -> None:
    """Refuse what an ensemble does not take."""
    known = (*KEYS, "settings", "engine")
    for name in asked:
        if name == "samples" or name not in known:
            raise UsageError(f"an ensemble has no argument '{name}'", did_you_mean(name, known))
    if threads is not None:
        whole(threads, "threads", least=1)
    whole(transition_times, "transition_times", least=0)
