"""Settings and start of a run or of many: options and overrides as numbers, checked.

Where a run goes on from a `run.final.state`, the executions of events that wait after the first are numbers of its
start.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from typing import Any

import numpy as np

from hsdsl.base.defaults import kept_digits, least_relaxation
from hsdsl.base.errors import UsageError
from hsdsl.base.limits import current
from hsdsl.base.names import did_you_mean, nth_memory, without_memory
from hsdsl.base.numbers.arithmetic import TIE, Arithmetic, Number
from hsdsl.base.numbers.columns import Column, each
from hsdsl.base.parts import meant, numbers_of
from hsdsl.engine.backends.python import compile_routines
from hsdsl.engine.execution import Array
from hsdsl.engine.integrators import FALLBACK, Method
from hsdsl.engine.integrators.stepper import State
from hsdsl.engine.preparation.options import DEFAULT, FILE, SCALE, Options, names_of
from hsdsl.engine.preparation.values import InstanceTable, Row, Values, at, check_memory
from hsdsl.engine.simulate import Settings
from hsdsl.engine.simulate.problem import Waits
from hsdsl.engine.simulate.stops import show
from hsdsl.mathematics.program import ModeProgram, Program

EVERY, COUNT = "every=", "count="  # before the time between samples, and before their number, which may do without
_NUMBERED = re.compile(r"(.+@.+)\[(\d+)\]")


def settings_of(options: Options, values: Values, overrides: Mapping[str, Any]) -> Settings:
    """The settings of a single run; ``overrides`` are recorded in them.

    Raises UsageError: a number that is out of its range, or a method that cannot serve this model.
    """
    arithmetic = values.kernel.arithmetic
    numbers: dict[str, Any] = {"step": None, "tolerance": None} | setting_columns(options, values.alone())
    numbers["max_transitions"] = int(numbers["max_transitions"])
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


def setting_columns(options: Options, table: InstanceTable) -> dict[str, Any]:
    """The numbers of the settings of every instance, by their names in `Settings`."""
    scales = [name for name in options.values if name.startswith(SCALE)]
    columns = {
        name: _column(options, table, name)
        for name in ("until", "max_transitions", "relaxation", options.size, *scales)
    }
    most = columns["max_transitions"]
    table.refuse((most < 0) | (most % 1 != 0), lambda i: f"max_transitions must be a whole number, not {at(most, i)}")
    table.refuse(columns["until"] < 0, lambda i: f"until must not be negative, not {at(columns['until'], i)}")
    for name in ("relaxation", options.size, *scales):
        table.refuse(columns[name] <= 0, lambda i, name=name: f"{name} must be positive, not {at(columns[name], i)}")
    if options.values["relaxation"].origin == DEFAULT:
        columns["relaxation"] = each(least_relaxation, columns["relaxation"], columns["until"])
    return columns | {"scale": {name.removeprefix(SCALE): columns.pop(name) for name in scales}}


def _column(options: Options, table: InstanceTable, name: str) -> Column:
    option, program = options.values[name], table.values.program
    state = name.removeprefix(SCALE)
    if state != name and state not in program.all_states:
        raise UsageError(f"{name}: the model has no state '{state}'", meant(state, program.all_states))
    if option.origin != FILE:
        return table.expression(option.value, name)
    place = program.scaled_states.index(state) if state != name else 0
    return table.constant("scale" if state != name else name, name)[place]


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
            f"use method '{FALLBACK}', whose coefficients are exact",
        )
    kinked = next((mode.name for mode in program.flows if mode.tape is None), None)
    if method is not None and method.is_series and kinked is not None:
        raise UsageError(
            f"method '{method.name}' needs smooth flows; that of mode {kinked} has abs, sign, min, max, "
            "floor or select of a state",
            f"use method '{FALLBACK}'",
        )


def initial_state(values: Values, overrides: Mapping[str, Any]) -> tuple[int, tuple[str, ...], Row]:
    """The initial mode's index, its states and their values; ``overrides`` may name ``mode`` and states."""
    overrides = start_of_parts(values.program, overrides)
    index, states = initial_layout(values, overrides)
    return index, states, initial_columns(values.alone(), states, overrides, {})


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
    valued = {*program.initial_states, *overrides}
    if missing := [name for name in states if name not in valued]:
        raise UsageError(
            f"mode {mode.name} starts with {', '.join(states)}, but no value is given for {', '.join(missing)}",
            f"--set initial.{missing[0]}=VALUE",
        )
    return index, states


def initial_columns(
    table: InstanceTable, states: Sequence[str], shared: Mapping[str, Any], varied: Mapping[str, Column]
) -> Row:
    """The initial value of each state, of every instance; those that use a given one follow it."""
    program, numbers = table.values.program, dict[str, Column]()
    for name in states:
        if name in varied:
            numbers[name] = table.given(varied[name], f"initial.{name}")
        elif name in shared:
            numbers[name] = table.expression(shared[name], f"initial.{name}")
    if program.initial_order and numbers:
        numbers = _following(table, numbers) | numbers
    else:
        numbers = dict(zip(program.initial_states, table.constant("initial", "initial"), strict=False)) | numbers
    return tuple(numbers[name] for name in states)


def _following(table: InstanceTable, given: Mapping[str, Column]) -> dict[str, Column]:
    """The initial values of the file, those that use a given one computed from it."""
    program, arithmetic = table.values.program, table.values.kernel.arithmetic
    routines = compile_routines(program.initial_values, arithmetic, "initial")()
    numbers: dict[str, Column] = {name: given.get(name, arithmetic.zero) for name in program.initial_states}
    for i, routine in zip(program.initial_order, routines, strict=True):
        name = program.initial_states[i]
        if name not in given:
            (numbers[name],) = table.of(routine, f"initial.{name}", *numbers.values())
    return numbers


def waiting_apart(program: Program, initial: Mapping[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]:
    """Initial values of states, and those of executions that wait after the first of their event."""
    known = {mode.states[i] for mode in program.modes for queue in mode.queues for i in queue.values}
    waits = {name for name in initial if (found := _NUMBERED.fullmatch(name)) and found[1] in known}
    apart = {name: value for name, value in initial.items() if name not in waits}
    return apart, {name: initial[name] for name in waits}


def initial_waits(
    values: Values, mode: ModeProgram, x: State, given: Mapping[str, Any]
) -> dict[str, tuple[Waits, ...]]:
    """The executions that wait after the first of each queue where a run starts, in the order in which they are made.

    Raises UsageError: not as many are given as the number that wait says.
    """
    rest, found = dict(given), dict[str, tuple[Waits, ...]]()
    for queue in mode.queues:
        count = int(x[queue.waiting]) if len(x) == len(mode.states) else 0
        rows: list[Waits] = []
        for k in range(2, count + 1):
            names = [nth_memory(mode.states[i], k) for i in queue.values]
            if missing := [name for name in names if name not in rest]:
                raise UsageError(f"{queue.name} is {count}, but no value is given for {missing[0]}")
            rows.append(tuple(_number(values, name, rest.pop(name)) for name in names))
        if rows:
            found[queue.name] = tuple(sorted(rows, key=lambda row: row[0]))
    if rest:
        raise UsageError(f"fewer executions wait than have values: {min(rest)} is one too many")
    return found


def check_alone(mode: ModeProgram, start: Array) -> None:
    """Refuse starts of many instances, by states, in which others than the first of a queue wait.

    Raises UsageError: one does.
    """
    for queue in mode.queues if len(start) == len(mode.states) else ():
        if (start[queue.waiting] > 1).any():
            raise UsageError(
                f"{queue.name} is above 1, and many instances start with one execution that waits, or none"
            )


def _number(values: Values, name: str, given: Any) -> Number:
    return values.number(given, f"initial.{name}")
