"""The numbers of many instances of a model at once: what is varied, and all that follows from it.

Each number is computed by the routine that a single run computes it by, so that it is the same to the last bit.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from hsdsl.arithmetic import DOMAIN_ERRORS
from hsdsl.errors import UsageError
from hsdsl.execution import Array
from hsdsl.model.options import FILE, SCALE, Options
from hsdsl.model.values import Values
from hsdsl.names import did_you_mean
from hsdsl.simulate import Settings

Row = tuple[float, ...]


@dataclass(frozen=True)
class Varied:
    """Arrays by name, flattened to one common length; ``shape`` is what they had in common."""

    shape: tuple[int, ...]
    arrays: dict[str, Array]

    @property
    def count(self) -> int:
        """How many instances there are."""
        return math.prod(self.shape)

    def at(self, index: int) -> dict[str, float]:
        """The values of one instance."""
        return {name: float(column[index]) for name, column in self.arrays.items()}


def split(given: Mapping[str, Any]) -> tuple[dict[str, Any], dict[str, Array]]:
    """Sort overrides into those that all instances share (numbers and expressions) and those that vary.

    Raises
    ------
    UsageError
        A value is no number, no expression and no array of numbers.
    """
    shared: dict[str, Any] = {}
    varied: dict[str, Array] = {}
    for name, value in given.items():
        if isinstance(value, str) or np.ndim(value) == 0:
            shared[name] = value.item() if isinstance(value, np.generic | np.ndarray) else value
            continue
        if np.ma.is_masked(value):
            raise UsageError(
                f"{name}: elements of the array are masked, and have no value", "leave those instances out"
            )
        try:
            varied[name] = np.asarray(value, dtype=float)
        except (TypeError, ValueError):
            raise UsageError(f"{name}: a number, an expression or an array of numbers is wanted") from None
    return shared, varied


def broadcast(varied: Mapping[str, Array]) -> Varied:
    """Bring arrays to their common shape, as NumPy does.

    Raises
    ------
    UsageError
        They have none.
    """
    try:
        arrays = np.broadcast_arrays(*varied.values())
    except ValueError:
        shapes = ", ".join(f"{name} has {array.shape}" for name, array in varied.items())
        raise UsageError(f"the arrays of an ensemble have no common shape: {shapes}") from None
    shape = arrays[0].shape if arrays else ()
    return Varied(shape, {name: array.reshape(-1) for name, array in zip(varied, arrays, strict=True)})


@dataclass
class Columns:
    """Numbers by instance; ``refused`` says which instances have none, and why."""

    values: Values
    count: int
    rows: list[Row]  # parameters
    refused: dict[int, str] = field(default_factory=dict[int, str])

    def of(self, routine: Callable[..., Sequence[float]], what: str) -> list[Sequence[float]]:
        """Evaluate a routine of the parameters for every instance."""
        try:
            found = [routine(*row) for row in self.rows]
        except DOMAIN_ERRORS:
            found = [self._one(routine, row) for row in self.rows]
        for i, numbers in enumerate(found):
            if not all(map(math.isfinite, numbers)):
                self.refused.setdefault(i, f"{what} has no finite value with these parameters")
        return found

    @staticmethod
    def _one(routine: Callable[..., Sequence[float]], row: Row) -> Sequence[float]:
        try:
            return routine(*row)
        except DOMAIN_ERRORS:
            return (math.nan,)

    def constant(self, name: str, what: str) -> list[Sequence[float]]:
        """Evaluate one of the program's constants for every instance."""
        return self.of(lambda *row: self.values.kernel.constant(name, row), what)


def parameter_rows(values: Values, shared: Mapping[str, Any], varied: Mapping[str, Array], count: int) -> Columns:
    """Evaluate the parameters in file order, derived ones anew, and check the bounds the file gives them."""
    program = values.program
    for name in (*shared, *varied):
        if name not in program.parameters:
            raise UsageError(f"the model has no parameter '{name}'", did_you_mean(name, program.parameters))
    columns = Columns(values, count, [()] * count)
    for i, name in enumerate(program.parameters):
        if name in varied:
            found = [(value,) for value in varied[name].tolist()]
            bad = np.flatnonzero(~np.isfinite(varied[name])).tolist()
            columns.refused |= {k: f"parameter {name}: {varied[name][k]} has no finite value" for k in bad}
        elif name in shared:
            found = columns.of(values.routine(shared[name], f"parameter {name}", i), f"parameter {name}")
        else:
            found = columns.constant(f"parameter_{i}", f"parameter {name}")
        columns.rows = [(*row, numbers[0]) for row, numbers in zip(columns.rows, found, strict=True)]
    _check_bounds(columns)
    return columns


def _check_bounds(columns: Columns) -> None:
    values = columns.values
    for i, name in enumerate(values.program.parameters):
        for kind, sign in (("minimum", 1), ("maximum", -1)):
            if not values.has(f"{kind}_{i}"):
                continue
            bounds = columns.constant(f"{kind}_{i}", f"the {kind} of {name}")
            for k, (row, bound) in enumerate(zip(columns.rows, bounds, strict=True)):
                if sign * (row[i] - bound[0]) < 0:
                    sentence = f"parameter {name} = {row[i]:.10g} is beyond its {kind} {bound[0]:.10g}"
                    columns.refused.setdefault(k, sentence)


def initial_rows(
    columns: Columns, states: tuple[str, ...], shared: Mapping[str, Any], varied: Mapping[str, Array]
) -> Array:
    """Evaluate the initial states of every instance, shape (instances, states)."""
    program, parameters = columns.values.program, len(columns.values.program.parameters)
    given = dict(zip(program.initial_states, zip(*columns.constant("initial", "initial"), strict=True), strict=True))
    for name, array in varied.items():
        given[name] = array.tolist()
        bad = np.flatnonzero(~np.isfinite(array)).tolist()
        columns.refused |= {k: f"initial.{name}: {array[k]} has no finite value" for k in bad}
    for name, value in shared.items():
        if name != "mode":
            what = f"initial.{name}"
            given[name] = tuple(row[0] for row in columns.of(columns.values.routine(value, what, parameters), what))
    return np.array([given[name] for name in states], dtype=float).reshape(len(states), columns.count).T


def settings_rows(columns: Columns, base: Settings, request: Options) -> list[Settings]:
    """Evaluate the settings of every instance; ``base`` are those of one that is not refused.

    Raises
    ------
    UsageError
        The step or the tolerance is not the same for all.
    """
    numbers = {key: _setting(columns, request, key) for key in ("until", "relaxation", "max_transitions", request.size)}
    scales = _scale_columns(columns, request)
    found: list[Settings] = []
    for k, (until, relaxation, most, size) in enumerate(zip(*numbers.values(), strict=True)):
        if k in columns.refused:
            found.append(base)
            continue
        if size != getattr(base, request.size):
            raise UsageError(f"{request.size} differs between the instances of an ensemble", "give it as a number")
        if until < 0 or not relaxation > 0 or most < 0 or most != int(most):
            columns.refused[k] = f"until = {until}, relaxation = {relaxation}, max_transitions = {most} cannot be"
            found.append(base)
        else:
            scale = {name: sizes[k] for name, sizes in scales.items()}
            found.append(replace(base, until=until, relaxation=relaxation, max_transitions=int(most), scale=scale))
    return found


def _scale_columns(columns: Columns, request: Options) -> dict[str, list[float]]:
    """The given sizes of states, of every instance."""
    keys = [key for key in request.values if key.startswith(SCALE)]
    sizes = {key.removeprefix(SCALE): _setting(columns, request, key) for key in keys}
    for name, column in sizes.items():
        for k in (k for k, size in enumerate(column) if not size > 0):
            columns.refused.setdefault(k, f"{SCALE}{name} must be positive, not {column[k]}")
    return sizes


def _setting(columns: Columns, request: Options, key: str) -> list[float]:
    asked, values = request.values[key], columns.values
    if asked.origin == FILE and key.startswith(SCALE):
        k = values.program.scaled_states.index(key.removeprefix(SCALE))
        return [row[k] for row in columns.constant("scale", key)]
    if asked.origin == FILE:
        return [row[0] for row in columns.constant(key, key)]
    return [row[0] for row in columns.of(values.routine(asked.value, key, len(values.program.parameters)), key)]
