"""The two axes of a stability map, read from text such as ``h=1e-4:1e-1:20,relaxation``."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import isfinite
from typing import Any

import numpy as np

from hsdsl.base.errors import UsageError
from hsdsl.base.names import did_you_mean, shown
from hsdsl.base.numbers.arithmetic import FLOAT64
from hsdsl.engine.preparation.values import with_parameters
from hsdsl.interface.model import Model
from hsdsl.interface.model.differentiate import start_by

SIZES = {"h": "step", "step": "step", "tolerance": "tolerance", "relaxation": "relaxation"}
COUNT, MOST, MOST_CELLS = 12, 400, 40_000
DEFAULTS = {"step": (1e-5, 1e-1), "tolerance": (1e-12, 1e-2), "relaxation": (1e-10, 1e-2)}
IN_TIME = ("step", "relaxation")  # their default ranges are shares of a run
EXAMPLE = "for example --map h=1e-4:1e-1:20,relaxation=1e-8:1e-2:20"


@dataclass(frozen=True)
class Axis:
    """What varies: ``kind`` is a setting (step, tolerance, relaxation), ``parameter`` or ``initial``."""

    name: str
    kind: str
    values: tuple[float, ...]
    logarithmic: bool
    unit: str = ""

    @property
    def label(self) -> str:
        """Its name with its unit."""
        return f"{self.name} [{self.unit}]" if self.unit else self.name

    def onto(self, arguments: Mapping[str, Any], value: float) -> dict[str, Any]:
        """The arguments of a run with a value of this axis among them."""
        if self.kind in DEFAULTS:
            return {**arguments, self.kind: value}
        group = "parameters" if self.kind == "parameter" else "initial"
        return {**arguments, group: {**arguments.get(group, {}), self.name.removeprefix("initial."): value}}


def read_axes(model: Model, text: str, until: float, base: Mapping[str, Any]) -> tuple[Axis, Axis]:
    """Read ``NAME[=FROM:TO[:COUNT[:lin]]],NAME[=...]``; values are spaced logarithmically, or evenly with ``lin``.

    ``base`` has the parameters and initial values of all runs, about which a number varies that has no range.

    Raises UsageError: not two different names, a name that cannot vary, or a range that is empty or no range.
    """
    parts = [part.strip() for part in text.split(",") if part.strip()]
    if len(parts) != 2:
        raise UsageError(f"--map: expected two names with a comma between them, got '{shown(text)}'", EXAMPLE)
    x, y = (_axis(model, part, until, base) for part in parts)
    setting = x.kind in DEFAULTS and x.kind == y.kind
    if x.name == y.name:
        raise UsageError(f"--map: expected two names, got {x.name} twice", EXAMPLE)
    if setting or {x.kind, y.kind} == {"step", "tolerance"}:
        raise UsageError(f"--map: {x.name} and {y.name} exclude each other", EXAMPLE)
    if len(x.values) * len(y.values) > MOST_CELLS:
        raise UsageError(f"--map: expected at most {MOST_CELLS:,} runs, got {len(x.values) * len(y.values):,}")
    units = model.program.units
    names = ("t" if axis.kind == "step" else axis.name.removeprefix("initial.") for axis in (x, y))
    return replace(x, unit=units.get(next(names), "")), replace(y, unit=units.get(next(names), ""))


def _axis(model: Model, part: str, until: float, base: Mapping[str, Any]) -> Axis:
    name, equals, range_ = (piece.strip() for piece in part.partition("="))
    kind = SIZES.get(name) or _kind(model, name)
    if equals:
        values, logarithmic = _range(name, range_)
        if kind in DEFAULTS and values[0] <= 0:
            raise UsageError(f"--map {name}: expected positive ends, got '{shown(range_)}'", EXAMPLE)
        return Axis(name, kind, values, logarithmic)
    if kind in DEFAULTS:
        low, high = (end * (until if kind in IN_TIME else 1.0) for end in DEFAULTS[kind])
        return Axis(name, kind, _spaced(low, high, COUNT), True)
    values = with_parameters(model.pipeline.values(FLOAT64), base.get("parameters", {}))
    value = start_by([name], base, values)[1][name]
    if not value > 0:
        raise UsageError(f"--map {name}: its value is {value:g}, so give a range", f"for example {name}=-1:1:20:lin")
    return Axis(name, kind, _spaced(value / 10, value * 10, COUNT), True)


def _kind(model: Model, name: str) -> str:
    """Which group a name belongs to.

    Raises UsageError: the model does not let it vary.
    """
    parameters, states = list(model.program.parameters), list(model.program.all_states)
    if name in parameters:
        return "parameter"
    group, dot, state = name.partition(".")
    if dot and group == "initial" and state in states:
        return "initial"
    if name in model.columns or name == "t":
        kind = "time" if name == "t" else "a state" if name in states else "an output"
        hint = f"map initial.{name}" if name in states else None
        raise UsageError(f"--map {name}: it is {kind}, which a run computes, so it cannot be varied", hint)
    known = [*SIZES, *parameters, *(f"initial.{state}" for state in states)]
    raise UsageError(
        f"--map: there is no setting, parameter or initial value '{shown(name)}'", did_you_mean(name, known)
    )


def _range(name: str, text: str) -> tuple[tuple[float, ...], bool]:
    pieces = text.split(":")
    even = pieces[-1] == "lin"
    pieces = pieces[:-1] if even else pieces
    try:
        low, high = float(pieces[0]), float(pieces[1])
        count = int(pieces[2]) if len(pieces) > 2 else COUNT
    except (ValueError, IndexError):
        count = low = high = 0
    if len(pieces) not in (2, 3) or not (isfinite(low) and isfinite(high)) or count == 0 == low == high:
        raise UsageError(f"--map {name}: expected FROM:TO:COUNT, got '{shown(text)}'", EXAMPLE)
    if not (low < high and 2 <= count <= MOST):
        raise UsageError(f"--map {name}: expected FROM below TO and 2 to {MOST} values, got '{shown(text)}'", EXAMPLE)
    if even:
        return tuple(np.linspace(low, high, count).tolist()), False
    if low <= 0:
        raise UsageError(
            f"--map {name}: expected positive ends, got '{shown(text)}'", f"evenly: {name}={shown(text)}:lin"
        )
    return _spaced(low, high, count), True


def _spaced(low: float, high: float, count: int) -> tuple[float, ...]:
    return tuple(np.geomspace(low, high, count).tolist())
