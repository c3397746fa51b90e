"""Numbers of a run's settings: its options, evaluated with the parameters it has, and checked."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from operator import index
from typing import Any, SupportsIndex

import numpy as np

from hsdsl.base.defaults import kept_digits, least_relaxation
from hsdsl.base.errors import UsageError
from hsdsl.base.limits import current
from hsdsl.base.numbers.arithmetic import FLOAT64, TIE, Arithmetic, Number, multiprecision
from hsdsl.base.parts import meant
from hsdsl.engine.integrators import AUTO, Method
from hsdsl.engine.preparation.options import DEFAULT, FILE, SCALE, Options
from hsdsl.engine.preparation.values import InstanceTable, Values
from hsdsl.engine.simulate import Settings
from hsdsl.engine.simulate.stops import show
from hsdsl.mathematics.program import Program

EVERY, COUNT = "every=", "count="  # before the time between samples, and before their number, which may do without
LEAST_DIGITS, MOST_DIGITS = 16, 10_000


def settings_of(options: Options, values: Values, overrides: Mapping[str, Any]) -> Settings:
    """The settings of a single run; ``overrides`` are recorded in them.

    Raises UsageError: a number that is out of its range, or a method that cannot serve this model.
    """
    arithmetic = values.kernel.arithmetic
    numbers: dict[str, Any]
    (numbers,) = setting_columns(options, values.alone())
    numbers = {"step": None, "tolerance": None} | numbers
    until, step, tolerance = numbers["until"], numbers["step"], numbers["tolerance"]
    if step is not None and until > 0 and until + step == until:
        raise UsageError(f"a step of {step} is lost in the round-off of until = {until}", "take a larger step")
    check_method(options.method, values.program, arithmetic)
    if tolerance is not None and tolerance < 2 * arithmetic.unit:
        kind = f"{arithmetic.digits} digits" if arithmetic.digits else "float64"
        raise UsageError(
            f"a tolerance of {float(tolerance):.3g} is below the precision of {kind}, {float(2 * arithmetic.unit):.2g}",
            "take a larger tolerance, or more digits by --precision",
        )
    method = options.method and options.method.for_tolerance(tolerance, arithmetic)
    return Settings(
        scheme=options.scheme,
        completion=options.values["completion"].value,
        method=method,
        **numbers,
        samples=_samples(options, values, until),
        overrides=overrides,
        memory=current().memory,
    )


def setting_columns(options: Options, columns: InstanceTable) -> list[dict[str, Any]]:
    """The numbers of the settings of every instance, by their names in `Settings`."""
    scales = [name for name in options.values if name.startswith(SCALE)]
    names = ("until", "max_transitions", "relaxation", options.size, *scales)
    numbers = zip(*(_column(options, columns, name) for name in names), strict=True)
    rows: list[dict[str, Any]] = [dict(zip(names, row, strict=True)) for row in numbers]
    by_default, refused = options.values["relaxation"].origin == DEFAULT, columns.refused
    for i, row in enumerate(rows):
        if i not in refused and (why := _refusal(row)):
            columns.refuse(i, why)
        if i not in refused:
            row["max_transitions"] = int(row["max_transitions"])
            if by_default:
                row["relaxation"] = least_relaxation(row["relaxation"], row["until"])
        row["scale"] = {name.removeprefix(SCALE): row.pop(name) for name in scales}
    return rows


def _column(options: Options, columns: InstanceTable, name: str) -> Sequence[Number]:
    option, program = options.values[name], columns.values.program
    state = name.removeprefix(SCALE)
    if state != name and state not in program.all_states:
        raise UsageError(f"{name}: the model has no state '{state}'", meant(state, program.all_states))
    if option.origin != FILE:
        return columns.expression(option.value, name)
    place = program.scaled_states.index(state) if state != name else 0
    return [row[place] for row in columns.constant("scale" if state != name else name, name)]


def _refusal(row: Mapping[str, Any]) -> str | None:
    most = row["max_transitions"]
    if most < 0 or most != int(most):
        return f"max_transitions must be a whole number, not {most}"
    for name, number in row.items():
        if name == "until" and number < 0:
            return f"until must not be negative, not {number}"
        if not number > 0 and name not in ("until", "max_transitions"):
            return f"{name} must be positive, not {number}"
    return None


def following_digits(settings: Settings, options: Options, arithmetic: Arithmetic) -> Settings:
    """The settings with a default tolerance that follows the digits of the numbers.

    A method of fixed order would need steps shorter by as many orders of magnitude: with one the tolerance stays.
    """
    left_open = options.size == "tolerance" and options.values["tolerance"].origin == DEFAULT
    method = settings.method
    if not left_open or arithmetic.digits is None or method is None or not method.is_series:
        return settings
    tolerance = arithmetic.constant(Fraction(1, 10 ** kept_digits(arithmetic.digits)))
    return replace(settings, tolerance=tolerance, method=method.for_tolerance(tolerance, arithmetic))


def _samples(options: Options, values: Values, until: Number) -> int | tuple[Number, ...] | None:
    """The times a run is sampled at, or how many equally spaced ones; `every=TIME` are its multiples."""
    option = options.values.get("samples")
    if option is None:
        return None
    value: Any = option.value
    given: Any = value.tolist() if type(value) is np.ndarray else value  # pyright: ignore[reportUnknownMemberType]
    if option.origin == FILE and values.has("sample_times"):
        return values.constant("sample_times")
    if option.origin == FILE and values.has("every"):
        return _multiples(values.constant("every")[0], until, values)
    if isinstance(given, str) and given.startswith(EVERY):
        return _multiples(values.number(given.removeprefix(EVERY), "samples"), until, values)
    given = given.removeprefix(COUNT) if isinstance(given, str) else given
    if isinstance(given, Sequence) and not isinstance(given, str):
        return tuple(values.number(t, "samples") for t in given)  # pyright: ignore[reportUnknownVariableType]
    count = values.constant("sample_count")[0] if option.origin == FILE else values.number(given, "samples")
    if count != int(count) or count < 2:
        raise UsageError(f"samples must be a list of times or a whole number of at least 2, not {show(count)}")
    _check_samples(int(count), values)
    return int(count)


def _multiples(step: Number, until: Number, values: Values) -> tuple[Number, ...]:
    """The multiples of a time up to the end."""
    if not step > 0:
        raise UsageError(f"the time between samples must be positive, not {show(step)}")
    count = int(until / step * (1 + TIE)) + 1
    _check_samples(count, values)
    return tuple(min(k * step, until) for k in range(count))


def _check_samples(count: int, values: Values) -> None:
    width = max(len(mode.states) for mode in values.program.modes)
    check_memory(current().memory, count, "samples", 1 + width + len(values.program.outputs))


def check_method(method: Method | None, program: Program, arithmetic: Arithmetic) -> None:
    """Refuse a method that lacks digits, and Taylor series of a flow that has none everywhere."""
    if method is not None and method.digits is not None and (arithmetic.digits or 0) > method.digits:
        raise UsageError(
            f"the coefficients of method '{method.name}' are known to {method.digits} digits, too few for a precision "
            f"of {arithmetic.digits}",
            f"use method '{AUTO}', whose coefficients are exact",
        )
    kinked = next((mode.name for mode in program.flows if mode.tape is None), None)
    if method is not None and method.is_series and kinked is not None:
        raise UsageError(
            f"method '{method.name}' needs smooth flows; that of mode {kinked} has abs, sign, min, max, "
            "floor or select of a state",
            f"use method '{AUTO}'",
        )


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
    """The arithmetic of a run: float64, or mpmath's with so many decimal digits."""
    if precision is None:
        return FLOAT64
    if not LEAST_DIGITS <= precision <= MOST_DIGITS:
        raise UsageError(f"precision is {LEAST_DIGITS} to {MOST_DIGITS} decimal digits, not {precision}")
    return multiprecision(precision)
