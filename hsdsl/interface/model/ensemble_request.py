"""The arguments of an ensemble: what every run shares, the arrays that vary, and the times of samples."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from hsdsl.base.errors import UsageError
from hsdsl.base.names import INITIAL
from hsdsl.base.numbers.arithmetic import TIE
from hsdsl.engine.execution import Array
from hsdsl.engine.preparation.options import check_arguments, overrides_of
from hsdsl.engine.preparation.values import InstanceTable, whole
from hsdsl.mathematics.program import Program


@dataclass(frozen=True)
class EnsembleRequest:
    """The arguments of an ensemble: ``call`` has those of every single run, and ``varied`` the arrays by name.

    The arrays are flattened; ``shape`` is their common shape.
    """

    call: dict[str, Any]
    varied: dict[str, Array]
    shape: tuple[int, ...]
    samples: int | Array | str | None
    transition_times: int
    every_transition: bool = False

    @staticmethod
    def of(
        program: Program, call: dict[str, Any], samples: Any, transition_times: int, every_transition: bool = False
    ) -> EnsembleRequest:
        """Sort the arguments.

        Raises UsageError: an argument that a run does not take, a value that is no number, no expression and no array
        of numbers, arrays without a common shape, or samples that are neither a number of them nor times.
        """
        check_arguments(call, "an ensemble", without=("samples", "precision"))
        whole(transition_times, "transition_times", least=0)
        varied: dict[str, Array] = {}
        for group, prefix in (("parameters", ""), ("initial", INITIAL)):
            given = overrides_of(call, group, program)
            varied |= {prefix + name: _array(name, value) for name, value in given.items() if np.ndim(value) > 0}
            call = call | {group: {name: _plain(value) for name, value in given.items() if np.ndim(value) == 0}}
        try:
            common = np.broadcast_arrays(*varied.values())
        except ValueError:
            shapes = ", ".join(f"{name} has {array.shape}" for name, array in varied.items())
            several = [name for name, array in varied.items() if array.ndim == 1]
            hint = f"for every combination give columns and rows: {several[0]} as array[:, None]" if several else None
            raise UsageError(f"the arrays of an ensemble have no common shape: {shapes}", hint) from None
        shape = common[0].shape if common else ()
        flat = {name: array.reshape(-1) for name, array in zip(varied, common, strict=True)}
        return EnsembleRequest(call, flat, shape, _samples(samples), transition_times, every_transition)

    def arrays(self, initial: bool) -> dict[str, list[float]]:
        """The columns of initial states or of parameters, by name."""
        columns = ((name, array) for name, array in self.varied.items() if name.startswith(INITIAL) == initial)
        return {name.removeprefix(INITIAL): array.tolist() for name, array in columns}

    def single(self, index: int) -> dict[str, Any]:
        """The arguments of the single run of one instance."""
        own = {"parameters": dict(self.call["parameters"]), "initial": dict(self.call["initial"])}
        for name, array in self.varied.items():
            group = "initial" if name.startswith(INITIAL) else "parameters"
            own[group][name.removeprefix(INITIAL)] = float(array[index])
        return self.call | own

    def times(self, until: Array, table: InstanceTable) -> tuple[int, Callable[[], Array]]:
        """The number of samples of an instance, and what makes their times, shape (instances, samples).

        Behind the last sample of an instance that has fewer than others is not-a-number.
        """
        given = self.samples
        if given is None:
            return 0, lambda: np.empty((len(until), 0))
        if isinstance(given, str):
            return _times_every(np.array(table.expression(given, "the time between samples"), float), until)
        if isinstance(given, int):
            return given, lambda: _evenly(until, given)
        return len(given), lambda: np.tile(given, (len(until), 1))


def _evenly(until: Array, count: int) -> Array:
    return np.concatenate([until[:, None] * np.arange(count - 1) / (count - 1), until[:, None]], axis=1)


def _times_every(step: Array, until: Array) -> tuple[int, Callable[[], Array]]:
    """Multiples of each instance's step up to its end."""
    if wrong := [value for value in step[np.isfinite(until)].tolist() if not value > 0]:
        raise UsageError(f"the time between samples must be positive, not {wrong[0]:g}")
    with np.errstate(invalid="ignore"):
        count = np.floor(until / step * (1 + TIE)) + 1
    most = int(min(np.nanmax(count, initial=0), 2**62))

    def times() -> Array:
        times = step[:, None] * np.arange(most)
        return np.where(np.arange(most) < count[:, None], np.minimum(times, until[:, None]), math.nan)

    return most, times


def _plain(value: Any) -> Any:
    return value.item() if hasattr(value, "item") else value


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
