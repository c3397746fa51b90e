"""Numbers of a model: its parameters with overrides, and constants, of one run or of many.

Each number of an instance is computed by the routine of a single run, and is the same to the last bit.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import partial
from itertools import repeat
from operator import index
from typing import TYPE_CHECKING, Any, SupportsIndex

import numpy as np

from hsdsl.base.errors import UsageError
from hsdsl.base.numbers.arithmetic import DOMAIN_ERRORS, FLOAT64, Arithmetic, Number, multiprecision
from hsdsl.base.numbers.columns import COLUMNS, Column, varies
from hsdsl.base.parts import meant, of_all
from hsdsl.engine.backends.python import PythonKernel, compile_routines
from hsdsl.engine.execution import Array
from hsdsl.engine.preparation.options import KEYS, names_of
from hsdsl.engine.simulate.stops import show
from hsdsl.mathematics.program import Program

if TYPE_CHECKING:
    from hsdsl.language.system import HybridSystem


_NUMBER = re.compile(r"-?[0-9]{1,30}(\.[0-9]{0,30})?([eE][+-]?[0-9]{1,2})?")  # needs no parsing
LEAST_DIGITS, MOST_DIGITS = 16, 10_000
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
        return self.alone().constant(name, name)

    def has(self, name: str) -> bool:
        """Whether the file gives this constant."""
        return name in self.kernel.constants

    def alone(self) -> InstanceTable:
        """A table of one instance, which refuses by an exception."""
        return InstanceTable(self, parameters=self.parameters)


_SIGNALS = (*DOMAIN_ERRORS, FloatingPointError)


@dataclass
class InstanceTable:
    """Numbers of so many instances, by columns; ``parameters`` has those of each parameter.

    ``refused`` has the instances without numbers, and why; with ``strict`` a refusal is an exception.
    """

    values: Values
    count: int = 1
    parameters: Sequence[Column] = ()
    refused: dict[int, str] = field(default_factory=dict[int, str])
    strict: bool = True

    @staticmethod
    def of_many(values: Values, count: int) -> InstanceTable:
        """A table of instances whose numbers may be arrays."""
        return InstanceTable(replace(values, kernel=values.kernel.over(COLUMNS)), count, strict=False)

    def refuse(self, bad: Column, why: Callable[[int], str]) -> None:
        """Note why instances have no numbers, where ``bad`` is true of them; the first reason counts."""
        if bad is False:
            return
        for instance in np.flatnonzero(np.broadcast_to(bad, self.count)).tolist():
            if self.strict:
                raise UsageError(why(instance))
            self.refused.setdefault(instance, why(instance))

    def of(self, routine: Routine, what: str, *further: Column) -> Row:
        """The columns of a routine of the parameters, and of further columns."""
        arguments = (*self.parameters, *further) if further else self.parameters
        try:
            if self.strict:
                found = routine(*arguments)
            else:
                with np.errstate(divide="raise", invalid="raise", over="ignore"):
                    found = routine(*arguments)
        except _SIGNALS:
            found = self._one_by_one(routine, arguments)
        for column in found:
            self.refuse(self._lacks(column), lambda _: f"{what} has no finite value with these parameters")
        return tuple(map(_finite, found))

    def _one_by_one(self, routine: Routine, arguments: Sequence[Column]) -> Row:
        """The columns of a routine that some instances have no value of."""
        rows = [_attempt(routine, row) for row in self.rows(arguments)]
        nan, width = self.values.kernel.arithmetic.functions["nan"], max(map(len, rows), default=0)
        columns = zip(*(row or (nan,) * max(1, width) for row in rows), strict=True)
        return tuple(column[0] if self.strict else np.array(column, float) for column in columns)

    def rows(self, columns: Sequence[Column]) -> Iterable[Row]:
        """The numbers of each instance."""
        if self.strict or not columns:
            return repeat(tuple(columns), self.count)
        return zip(*(column_of(column, self.count).tolist() for column in columns), strict=True)

    def _lacks(self, column: Column) -> Column:
        """Whether the numbers of a column are not finite."""
        if varies(column):
            return ~np.isfinite(column)
        return not self.values.kernel.arithmetic.isfinite(column)

    def constant(self, name: str, what: str) -> Row:
        """The columns of one of the program's constants."""
        return self.of(self.values.kernel.constants[name], what)

    def expression(self, value: Any, what: str) -> Column:
        """A number or an expression of all parameters."""
        return self.of(self.values.routine(value, what, len(self.values.program.parameters)), what)[0]

    def given(self, column: Column, what: str) -> Column:
        """The numbers that a call gives to the instances."""
        self.refuse(self._lacks(column), lambda i: f"{what}: {at(column, i)} has no finite value")
        return _finite(column)


def _finite(column: Column) -> Column:
    """A column with not-a-number where it is not finite, which further arithmetic takes without a warning."""
    return np.where(np.isfinite(column), column, np.nan) if varies(column) else column


def at(column: Column, instance: int) -> Number:
    """The number of an instance."""
    return column[instance].item() if varies(column) else column


def column_of(column: Column, count: int) -> Array:
    """A column as an array with one number for each instance."""
    return np.broadcast_to(np.asarray(column, float), count)


def _attempt(routine: Routine, row: Row) -> Row:
    try:
        return routine(*row)
    except DOMAIN_ERRORS:
        return ()


def with_parameters(values: Values, overrides: Mapping[str, Any]) -> Values:
    """The values of a single run with these overrides."""
    table = InstanceTable(values)
    evaluate_parameters(table, overrides, {})
    return replace(values, parameters=table.parameters)


def evaluate_parameters(table: InstanceTable, shared: Mapping[str, Any], varied: Mapping[str, Column]) -> None:
    """Evaluate the parameters in file order, derived ones anew, and check the bounds of the file."""
    values, program = table.values, table.values.program
    for name in (*shared, *varied):
        if name not in program.parameters:
            raise UsageError(f"the model has no parameter '{name}'", _elsewhere(name, program))
    table.parameters = found = list[Column]()  # n tuples of up to n parameters would take n**2 steps
    for i, name in enumerate(program.parameters):
        what = f"parameter {name}"
        if name in varied:
            column = table.given(varied[name], what)
        elif name in shared:
            (column,) = table.of(values.routine(shared[name], what, i), what)
        else:
            (column,) = table.constant(f"parameter_{i}", what)
        found.append(column)
    table.parameters = tuple(found)
    for i, name in enumerate(program.parameters):
        for kind, sign in (("minimum", 1), ("maximum", -1)):
            if values.has(f"{kind}_{i}"):
                (bound,), own = table.constant(f"{kind}_{i}", f"the {kind} of {name}"), table.parameters[i]
                table.refuse(sign * (own - bound) < 0, partial(_beyond, name, kind, own, bound))


def _beyond(name: str, kind: str, own: Column, bound: Column, instance: int) -> str:
    return f"parameter {name} = {show(at(own, instance))} is beyond its {kind} {show(at(bound, instance))}"


def _elsewhere(name: str, program: Program) -> str | None:
    """The hint for a name that is no parameter: how settings and initial values are reached, or the nearest one."""
    if name in KEYS:
        return f"write experiment.{name}"
    if name == "mode" or name in map(of_all, names_of(program, "initial")) or name in program.all_states:
        return f"write initial.{name}"
    if any(name == sampled.name for sampled in program.inputs):
        return "it is an input: give its values in the file by parameters, and override these"
    return meant(name, program.parameters)


def whole(value: Any, name: str, least: int) -> int:
    """An argument that must be a whole number.

    Raises UsageError: it is none, or below ``least``.
    """
    if isinstance(value, bool) or not isinstance(value, SupportsIndex):
        raise UsageError(f"{name} must be a whole number, not {value!r}")
    if index(value) < least:
        raise UsageError(f"{name} must be at least {least}, not {value}")
    return index(value)


def check_memory(most: int, count: int, what: str, columns: int) -> None:
    """Refuse more numbers than ``most`` bytes hold: so many of ``what``, each with so many numbers."""
    needed = 8 * count * columns
    if needed > most:
        sentence = f"{count:.6g} {what} of {columns:.6g} numbers take {needed:.3g} bytes"
        hint = f"allow more with --limit memory={10 * needed:.0e}"
        raise UsageError(f"{sentence}, and the limit 'memory' is {most:.3g}", hint)


def arithmetic_of(precision: int | None) -> Arithmetic:
    """The arithmetic of a run: float64, or mpmath with a number of decimal digits."""
    if precision is None:
        return FLOAT64
    if not LEAST_DIGITS <= precision <= MOST_DIGITS:
        raise UsageError(f"precision is {LEAST_DIGITS} to {MOST_DIGITS} decimal digits, not {precision}")
    return multiprecision(precision)
