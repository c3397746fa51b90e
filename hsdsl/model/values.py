"""Overrides: values a call or `--set` gives, as numbers or as expressions of parameters."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import TYPE_CHECKING, Any

from hsdsl.arithmetic import DOMAIN_ERRORS, Number
from hsdsl.backends.python import PythonKernel, compile_routines
from hsdsl.errors import UsageError
from hsdsl.model.options import KEYS
from hsdsl.names import did_you_mean
from hsdsl.program import Program
from hsdsl.simulate.stops import show

if TYPE_CHECKING:
    from hsdsl.system import HybridSystem

_NUMBER = re.compile(r"-?[0-9]{1,30}(\.[0-9]{0,30})?([eE][+-]?[0-9]{1,2})?")  # needs no parsing


@dataclass(frozen=True)
class Values:
    """A model's numbers for one run: its kernel, and parameter values with overrides applied.

    ``read`` gives the mathematics, which a run of a model seen before does not have at hand.
    """

    read: Callable[[], HybridSystem]
    program: Program
    kernel: PythonKernel
    parameters: Sequence[Number] = ()

    @property
    def system(self) -> HybridSystem:
        """The mathematics."""
        return self.read()

    def number(self, value: Any, where: str) -> Number:
        """Turn a number or an expression of parameters into a finite number.

        Raises
        ------
        UsageError
            It is neither, or has no finite value.
        """
        arithmetic = self.kernel.arithmetic
        try:
            number = self._evaluate(value, where)
        except DOMAIN_ERRORS:
            number = arithmetic.functions["nan"]
        if not arithmetic.isfinite(number):
            raise UsageError(f"{where}: {value} has no finite value")
        return number

    def _evaluate(self, value: Any, where: str) -> Number:
        arithmetic = self.kernel.arithmetic
        if isinstance(value, str) and _NUMBER.fullmatch(value.strip()):
            return arithmetic.constant(Fraction(value.strip()))
        if isinstance(value, str):
            return self.routine(value, where, len(self.parameters))(*self.parameters)[0]
        if isinstance(value, bool) or value is None:
            raise UsageError(f"{where}: a number or an expression is wanted, not {value}")
        if hasattr(value, "_mpf_"):
            return arithmetic.zero + value if arithmetic.name == "mpmath" else float(value)
        try:
            return arithmetic.constant(Fraction(value))
        except (TypeError, ValueError, OverflowError):
            raise UsageError(f"{where}: a finite number or an expression is wanted, not {value!r}") from None

    def routine(self, value: Any, where: str, known: int) -> Callable[..., Sequence[Number]]:
        """Return a function of the first ``known`` parameters for a number or an expression of them."""
        if not isinstance(value, str) or _NUMBER.fullmatch(value.strip()):
            number = self.number(value, where)
            return lambda *_: (number,)
        from hsdsl.elaborate import parameter_expression
        from hsdsl.lower import lower_expressions

        arithmetic, names = self.kernel.arithmetic, self.program.parameters
        expression = parameter_expression(self.system, value, where, allowed=names[:known])
        routine = compile_routines(lower_expressions(self.system, {"value": expression}), arithmetic, where)()[0]
        missing = (arithmetic.zero,) * (len(names) - known)
        return lambda *parameters: routine(*parameters, *missing)

    def constant(self, name: str) -> tuple[Number, ...]:
        """Evaluate one of the program's constants; its numbers must be finite."""
        values = self.kernel.constant(name, self.parameters)
        if not all(map(self.kernel.arithmetic.isfinite, values)):
            raise UsageError(f"{name} has no finite value with these parameters")
        return values

    def has(self, name: str) -> bool:
        """Whether the file gives this constant."""
        return self.kernel.has_constant(name)


def with_parameters(values: Values, overrides: Mapping[str, Any]) -> Values:
    """Evaluate the parameters in file order, derived ones anew, and check the bounds the file gives them."""
    program = values.program
    for name in overrides:
        if name not in program.parameters:
            raise UsageError(f"the model has no parameter '{name}'", _elsewhere(name, program))
    found: list[Number] = []
    earlier = Values(values.read, program, values.kernel, found)
    for i, name in enumerate(program.parameters):
        if name in overrides:
            found.append(earlier.number(overrides[name], f"parameter {name}"))
            continue
        try:
            found.append(earlier.constant(f"parameter_{i}")[0])
        except DOMAIN_ERRORS:
            raise UsageError(f"parameter {name} has no finite value with these parameters") from None
    values = replace(values, parameters=tuple(found))
    _check_bounds(values)
    return values


def _elsewhere(name: str, program: Program) -> str | None:
    """The hint for a name that is no parameter: how settings and initial values are reached, or the nearest one."""
    if name in KEYS:
        return f"write experiment.{name}"
    if name == "mode" or any(name in mode.states for mode in program.modes):
        return f"write initial.{name}"
    return did_you_mean(name, program.parameters)


def _check_bounds(values: Values) -> None:
    for i, (name, value) in enumerate(zip(values.program.parameters, values.parameters, strict=True)):
        for kind, sign in (("minimum", 1), ("maximum", -1)):
            if values.has(f"{kind}_{i}"):
                bound = values.constant(f"{kind}_{i}")[0]
                if sign * (value - bound) < 0:
                    raise UsageError(f"parameter {name} = {show(value)} is beyond its {kind} {show(bound)}")


def initial_state(values: Values, overrides: Mapping[str, Any]) -> tuple[int, tuple[str, ...], tuple[Number, ...]]:
    """Return the initial mode's index, its states and their values; ``overrides`` may name ``mode`` and states."""
    program = values.program
    names = [mode.name for mode in program.modes]
    wanted = overrides.get("mode")
    if wanted is not None and wanted not in names:
        raise UsageError(f"the model has no mode '{wanted}'", did_you_mean(str(wanted), names))
    index = program.initial_mode if wanted is None else names.index(wanted)
    mode = program.modes[index]
    given = dict(zip(program.initial_states, values.constant("initial"), strict=True))
    free = mode.final and not mode.states
    states = mode.states if not free else tuple(given)
    for name in overrides:
        if name != "mode" and name not in states:
            raise UsageError(f"mode {mode.name} has no state '{name}'", did_you_mean(name, states))
    for name, value in overrides.items():
        if name != "mode":
            given[name] = values.number(value, f"initial.{name}")
    if missing := [name for name in states if name not in given]:
        raise UsageError(
            f"mode {mode.name} starts with {', '.join(states)}, but no value is given for {', '.join(missing)}",
            f"--set initial.{missing[0]}=VALUE",
        )
    return index, states, tuple(given[name] for name in states)


def samples(values: Values, asked: Any) -> int | tuple[Number, ...]:
    """Return the times a run is sampled at, or how many equally spaced ones.

    Raises
    ------
    UsageError
        Neither a list of times nor a whole number of at least 2.
    """
    if isinstance(asked, Sequence) and not isinstance(asked, str):
        return tuple(values.number(t, "samples") for t in asked)  # pyright: ignore[reportUnknownVariableType]
    count = values.number(asked, "samples")
    if count != int(count) or count < 2:
        raise UsageError(f"samples must be a list of times or a whole number of at least 2, not {show(count)}")
    return int(count)
