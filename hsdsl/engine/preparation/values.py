"""Numbers of a model: parameters with overrides, constants and initial states, of one run or of many instances.

Each number of an instance is computed by the routine of a single run, and is the same to the last bit.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from typing import TYPE_CHECKING, Any

from hsdsl.base.errors import UsageError
from hsdsl.base.names import did_you_mean, without_memory
from hsdsl.base.numbers.arithmetic import DOMAIN_ERRORS, Number
from hsdsl.base.parts import meant, numbers_of, of_all
from hsdsl.engine.backends.python import PythonKernel, compile_routines
from hsdsl.engine.preparation.options import KEYS, names_of
from hsdsl.engine.simulate.stops import show
from hsdsl.mathematics.program import Program

if TYPE_CHECKING:
    from hsdsl.language.system import HybridSystem

_NUMBER = re.compile(r"-?[0-9]{1,30}(\.[0-9]{0,30})?([eE][+-]?[0-9]{1,2})?")  # needs no parsing
Row = tuple[Number, ...]
Routine = Callable[..., Row]


@dataclass(frozen=True)
class Values:
    """A model's kernel, and its parameters' values; ``read`` gives the mathematics, which a cached model lacks."""

    read: Callable[[], HybridSystem]
    program: Program
    kernel: PythonKernel
    parameters: Row = ()

    @property
    def system(self) -> HybridSystem:
        """The mathematics."""
        return self.read()

    def number(self, value: Any, where: str) -> Number:
        """The finite number of a number or of an expression of parameters.

        Raises UsageError: it is neither, or has no finite value.
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
        value = value.tolist() if hasattr(value, "tolist") else value  # those of NumPy
        if isinstance(value, str) and not _NUMBER.fullmatch(value.strip()):
            return self.routine(value, where, len(self.parameters))(*self.parameters)[0]
        if isinstance(value, bool) or value is None:
            raise UsageError(f"{where}: expected a number or an expression, got {value}")
        if hasattr(value, "_mpf_"):
            return (
                arithmetic.zero + value if arithmetic.name == "mpmath" else arithmetic.constant(Fraction(float(value)))
            )
        try:
            return arithmetic.constant(Fraction(value))
        except (TypeError, ValueError, OverflowError):
            raise UsageError(f"{where}: expected a finite number or an expression, got {value!r}") from None

    def routine(self, value: Any, where: str, known: int) -> Routine:
        """A function of the first ``known`` parameters for a number or an expression of them."""
        if not isinstance(value, str) or _NUMBER.fullmatch(value.strip()):
            number = self.number(value, where)
            return lambda *_: (number,)
        from hsdsl.language.elaborate import parameter_expression
        from hsdsl.mathematics.lower import lower_expressions

        arithmetic, names = self.kernel.arithmetic, self.program.parameters
        expression = parameter_expression(self.system, value, where, allowed=names[:known])
        routine = compile_routines(lower_expressions(self.system, {"value": expression}), arithmetic, where)()[0]
        missing = (arithmetic.zero,) * (len(names) - known)
        return lambda *parameters: routine(*parameters, *missing)

    def evaluate(self, expressions: dict[str, Any]) -> dict[str, Number]:
        """SymPy expressions of parameters as numbers; NaN for one without a value."""
        from hsdsl.mathematics.lower import lower_expressions

        arithmetic = self.kernel.arithmetic
        routines = compile_routines(lower_expressions(self.system, expressions), arithmetic, "expressions")()
        rows = (_attempt(routine, self.parameters) for routine in routines)
        return {
            name: row[0] if row else arithmetic.functions["nan"] for name, row in zip(expressions, rows, strict=True)
        }

    def constant(self, name: str) -> Row:
        """One of the program's constants; its numbers must be finite."""
        return self.alone().constant(name, name)[0]

    def has(self, name: str) -> bool:
        """Whether the file gives this constant."""
        return self.kernel.has_constant(name)

    def alone(self) -> InstanceTable:
        """A table of one instance, which refuses by an exception."""
        return InstanceTable(self, [self.parameters], strict=True)


@dataclass
class InstanceTable:
    """Numbers of instances; ``rows`` has their parameters.

    ``refused`` has the instances without numbers, and why; with ``strict`` a refusal is an exception.
    """

    values: Values
    rows: list[Row]
    refused: dict[int, str] = field(default_factory=dict[int, str])
    strict: bool = False

    def refuse(self, instance: int, why: str) -> None:
        """Note why an instance has no numbers; the first reason counts."""
        if self.strict:
            raise UsageError(why)
        self.refused.setdefault(instance, why)

    def of(self, routine: Routine, what: str) -> list[Row]:
        """The values of a routine of the parameters, of every instance."""
        try:
            rows = [routine(*row) for row in self.rows]
        except DOMAIN_ERRORS:
            attempts = [_attempt(routine, row) for row in self.rows]
            width = max(map(len, attempts))
            rows = [row or (self.values.kernel.arithmetic.functions["nan"],) * max(1, width) for row in attempts]
        isfinite = self.values.kernel.arithmetic.isfinite
        for i, numbers in enumerate(rows):
            if not all(map(isfinite, numbers)):
                self.refuse(i, f"{what} has no finite value with these parameters")
        return rows

    def constant(self, name: str, what: str) -> list[Row]:
        """One of the program's constants, of every instance."""
        constant = self.values.kernel.constant
        return self.of(lambda *row: constant(name, row), what)

    def expression(self, value: Any, what: str) -> list[Number]:
        """A number or an expression of all parameters, of every instance."""
        routine = self.values.routine(value, what, len(self.values.program.parameters))
        return [row[0] for row in self.of(routine, what)]

    def given(self, column: Sequence[Number], what: str) -> list[Number]:
        """The numbers that a call gives to the instances."""
        isfinite = self.values.kernel.arithmetic.isfinite
        for i in (i for i, value in enumerate(column) if not isfinite(value)):
            self.refuse(i, f"{what}: {column[i]} has no finite value")
        return list(column)


def _attempt(routine: Routine, row: Row) -> Row:
    try:
        return routine(*row)
    except DOMAIN_ERRORS:
        return ()


def with_parameters(values: Values, overrides: Mapping[str, Any]) -> Values:
    """The values of a single run with these overrides."""
    columns = InstanceTable(values, [()], strict=True)
    evaluate_parameters(columns, overrides, {})
    return replace(values, parameters=columns.rows[0])


def evaluate_parameters(
    columns: InstanceTable, shared: Mapping[str, Any], varied: Mapping[str, Sequence[Number]]
) -> None:
    """Evaluate the parameters in file order, derived ones anew, and check the bounds of the file."""
    values = columns.values
    program = values.program
    for name in (*shared, *varied):
        if name not in program.parameters:
            raise UsageError(f"the model has no parameter '{name}'", _elsewhere(name, program))
    for i, name in enumerate(program.parameters):
        what = f"parameter {name}"
        if name in varied:
            column = columns.given(varied[name], what)
        elif name in shared:
            column = [row[0] for row in columns.of(values.routine(shared[name], what, i), what)]
        else:
            column = [row[0] for row in columns.constant(f"parameter_{i}", what)]
        columns.rows = [(*row, number) for row, number in zip(columns.rows, column, strict=True)]
    for i, name in enumerate(program.parameters):
        for kind, sign in (("minimum", 1), ("maximum", -1)):
            bounds = columns.constant(f"{kind}_{i}", f"the {kind} of {name}") if values.has(f"{kind}_{i}") else ()
            for k, (bound,) in enumerate(bounds):
                if sign * (columns.rows[k][i] - bound) < 0:
                    value = show(columns.rows[k][i])
                    columns.refuse(k, f"parameter {name} = {value} is beyond its {kind} {show(bound)}")


def _elsewhere(name: str, program: Program) -> str | None:
    """The hint for a name that is no parameter: how settings and initial values are reached, or the nearest one."""
    if name in KEYS:
        return f"write experiment.{name}"
    if name == "mode" or name in map(of_all, names_of(program, "initial")) or name in program.all_states:
        return f"write initial.{name}"
    if any(name == sampled.name for sampled in program.inputs):
        return "it is an input: give its values in the file by parameters, and override these"
    return meant(name, program.parameters)


def initial_state(values: Values, overrides: Mapping[str, Any]) -> tuple[int, tuple[str, ...], Row]:
    """The initial mode's index, its states and their values; ``overrides`` may name ``mode`` and states."""
    overrides = start_of_parts(values.program, overrides)
    index, states = initial_layout(values, overrides)
    columns = initial_columns(values.alone(), states, overrides, {})
    return index, states, tuple(column[0] for column in columns)


def start_of_parts(program: Program, overrides: Mapping[str, Any]) -> Mapping[str, Any]:
    """Overrides of initial modes, `NAME.mode` of a part or `mode` of the whole, as numbers of modes.

    Raises UsageError: there is no such mode, or one of its states has no value.
    """
    if not program.parts:
        return overrides
    given: dict[str, Any] = dict(overrides)
    whole = given.pop("mode", None)
    try:
        numbers: dict[str, int] = {} if whole is None else dict(numbers_of(program.parts, str(whole)))
    except ValueError as problem:
        raise UsageError(f"the model has no mode '{whole}': {problem}") from None
    for part in program.parts:
        mode = given.pop(f"{part.name}.mode", None)
        if mode is not None and mode not in part.modes:
            raise UsageError(f"{part.name} has no mode '{mode}'", did_you_mean(str(mode), part.modes))
        if mode is not None and part.is_numbered:
            numbers[part.name] = part.modes.index(mode) + 1
        if part.name in given:
            raise UsageError(f"'{part.name}' is a part of the model", f"write initial.{part.name}.mode")
        for name in without_memory(part.states[numbers.get(part.name, part.start + 1) - 1]):
            if name not in given and name not in part.states[part.start]:
                raise UsageError(f"no value is given for {name}", f"--set initial.{name}=VALUE")
    return given | numbers


def initial_layout(values: Values, overrides: Mapping[str, Any]) -> tuple[int, tuple[str, ...]]:
    """The initial mode's index and its states, which must all have a value.

    Raises UsageError: the mode does not exist, lacks one of the states, or has one without a value.
    """
    program = values.program
    names = program.mode_names
    given = overrides.get("mode")
    if given is not None and given not in names:
        raise UsageError(f"the model has no mode '{given}'", did_you_mean(str(given), names))
    index = program.initial_mode if given is None else names.index(given)
    mode = program.modes[index]
    states = program.initial_states if mode.final and not mode.states else mode.states
    where, known = (f"mode {mode.name}", states) if not program.parts else ("the model", names_of(program, "initial"))
    for name in overrides:
        if name != "mode" and name not in states:
            raise UsageError(f"{where} has no state '{name}'", meant(name, known))
    if missing := [name for name in states if name not in (*program.initial_states, *overrides)]:
        raise UsageError(
            f"mode {mode.name} starts with {', '.join(states)}, but no value is given for {', '.join(missing)}",
            f"--set initial.{missing[0]}=VALUE",
        )
    return index, states


def initial_columns(
    columns: InstanceTable, states: Sequence[str], shared: Mapping[str, Any], varied: Mapping[str, Sequence[Number]]
) -> list[Sequence[Number]]:
    """The initial value of each state, of every instance; those that use a given one follow it."""
    numbers: dict[str, Sequence[Number]] = {}
    for name in states:
        if name in varied:
            numbers[name] = columns.given(varied[name], f"initial.{name}")
        elif name in shared:
            numbers[name] = columns.expression(shared[name], f"initial.{name}")
    if columns.values.program.initial_order and numbers:
        numbers = _following(columns, numbers) | numbers
    else:
        in_file = columns.constant("initial", "initial")
        numbers = dict(zip(columns.values.program.initial_states, zip(*in_file, strict=True), strict=False)) | numbers
    return [numbers[name] for name in states]


def _following(columns: InstanceTable, given: Mapping[str, Sequence[Number]]) -> dict[str, Sequence[Number]]:
    """The initial values of the file, those that use a given one computed from it."""
    program, arithmetic = columns.values.program, columns.values.kernel.arithmetic
    routines = compile_routines(program.initial_values, arithmetic, "initial")()
    zero: Sequence[Number] = [arithmetic.zero] * len(columns.rows)
    numbers: dict[str, Sequence[Number]] = {name: given.get(name, zero) for name in program.initial_states}
    for i, routine in zip(program.initial_order, routines, strict=True):
        name = program.initial_states[i]
        if name in given:
            continue
        rows = [(*row, *own) for row, *own in zip(columns.rows, *numbers.values(), strict=True)]
        joined = InstanceTable(columns.values, rows, strict=columns.strict)
        numbers[name] = [row[0] for row in joined.of(routine, f"initial.{name}")]
        for instance, why in joined.refused.items():
            columns.refuse(instance, why)
    return numbers
