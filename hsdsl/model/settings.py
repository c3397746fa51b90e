"""The numbers of a run: what it is asked, evaluated with the parameters it has, and checked."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from operator import index
from typing import Any, SupportsIndex

from hsdsl.arithmetic import FLOAT64, Arithmetic, Number, multiprecision
from hsdsl.defaults import kept_digits, least_relaxation
from hsdsl.errors import UsageError
from hsdsl.integrators import TaylorMethod
from hsdsl.limits import current
from hsdsl.model.options import DEFAULT, FILE, SCALE, Option, Options, check_digits, check_smooth, check_tolerance
from hsdsl.model.values import Values, samples
from hsdsl.names import did_you_mean
from hsdsl.simulate import Settings

LEAST_DIGITS, MOST_DIGITS = 16, 10_000


def settings_of(request: Options, values: Values) -> Settings:
    """Turn what a run is asked into numbers, and refuse those that make no run.

    Raises
    ------
    UsageError
        A number that is out of its range, or a method that cannot serve this model.
    """

    def number(key: str) -> Number:
        asked = request.values[key]
        if asked.origin == FILE:
            return values.constant(key)[0]
        return values.number(asked.value, key)

    def positive(key: str) -> Number:
        value = number(key)
        if not value > 0:
            raise UsageError(f"{key} must be positive, not {value}")
        return value

    until = number("until")
    if until < 0:
        raise UsageError(f"until must not be negative, not {until}")
    most = number("max_transitions")
    if most < 0 or most != int(most):
        raise UsageError(f"max_transitions must be a whole number, not {most}")
    step = positive("step") if request.size == "step" else None
    if step is not None and until > 0 and until + step == until:
        raise UsageError(f"a step of {step} is lost in round-off beside until = {until}", "take a larger step")
    check_digits(request.method, values.kernel.arithmetic)
    check_smooth(request.method, values.program)
    tolerance = positive("tolerance") if request.size == "tolerance" else None
    check_tolerance(tolerance, values.kernel.arithmetic)
    relaxation = positive("relaxation")
    if request.values["relaxation"].origin == "default":
        relaxation = least_relaxation(relaxation, until)
    method = request.method
    if isinstance(method, TaylorMethod):
        method = method.for_tolerance(tolerance, values.kernel.arithmetic)
    return Settings(
        scheme=request.scheme,
        method=method,
        step=step,
        tolerance=tolerance,
        relaxation=relaxation,
        until=until,
        max_transitions=int(most),
        scale=_scale(request, values),
        samples=_samples(request, values),
        memory=current().memory,
    )


def _scale(request: Options, values: Values) -> dict[str, Number]:
    """The given sizes of states."""
    program = values.program
    states = dict.fromkeys((*(s for mode in program.modes for s in mode.states), *program.initial_states))
    in_file = dict(zip(program.scaled_states, values.constant("scale") if values.has("scale") else (), strict=True))
    sizes: dict[str, Number] = {}
    for key, asked in request.values.items():
        name = key.removeprefix(SCALE)
        if name == key:
            continue
        if name not in states:
            raise UsageError(f"{key}: the model has no state '{name}'", did_you_mean(name, [*states]))
        size = in_file[name] if asked.origin == FILE else values.number(asked.value, key)
        if not size > 0:
            raise UsageError(f"{key} must be positive, not {size}")
        sizes[name] = size
    return sizes


def following_digits(settings: Settings, request: Options, arithmetic: Arithmetic) -> Settings:
    """Return the settings with a default tolerance that follows the digits of the numbers.

    A method of fixed order would need steps shorter by as many orders of magnitude: with one the tolerance stays.
    """
    left_open = request.size == "tolerance" and request.values["tolerance"].origin == DEFAULT
    if not left_open or arithmetic.digits is None or not isinstance(settings.method, TaylorMethod):
        return settings
    tolerance = arithmetic.constant(Fraction(1, 10 ** kept_digits(arithmetic.digits)))
    return replace(settings, tolerance=tolerance, method=settings.method.for_tolerance(tolerance, arithmetic))


def _samples(request: Options, values: Values) -> int | tuple[Number, ...] | None:
    asked = request.values.get("samples")
    if asked is None:
        return None
    found = _sampled(asked, values)
    if isinstance(found, int):
        width = max(len(mode.states) for mode in values.program.modes)
        check_memory(current().memory, found, "samples", 1 + width + len(values.program.outputs))
    return found


def _sampled(asked: Option, values: Values) -> int | tuple[Number, ...]:
    if asked.origin != FILE:
        return samples(values, asked.value)
    if values.has("sample_times"):
        return values.constant("sample_times")
    return samples(values, values.constant("sample_count")[0])


def whole(value: Any, name: str, least: int) -> int:
    """Return an argument that must be a whole number.

    Raises
    ------
    UsageError
        It is none, or below ``least``.
    """
    if isinstance(value, bool) or not isinstance(value, SupportsIndex):
        raise UsageError(f"{name} must be a whole number, not {value!r}")
    if index(value) < least:
        raise UsageError(f"{name} must be at least {least}, not {value}")
    return index(value)


def check_memory(most: int, count: int, what: str, columns: int) -> None:
    """Refuse more numbers than may be kept.

    Raises
    ------
    UsageError
        So many of ``what``, each with so many numbers, take more than ``most`` bytes.
    """
    wanted = 8 * count * columns
    if wanted > most:
        sentence = f"{count:.6g} {what} of {columns:.6g} numbers take {wanted:.3g} bytes"
        hint = f"allow more with --limit memory={10 * wanted:.0e}"
        raise UsageError(f"{sentence}, and the limit 'memory' is {most:.3g}", hint)


def arithmetic_of(precision: int | None) -> Arithmetic:
    """Return the arithmetic of a run: float64, or mpmath's with so many decimal digits.

    Raises
    ------
    UsageError
        Too few digits, or too many.
    """
    if precision is None:
        return FLOAT64
    if not LEAST_DIGITS <= precision <= MOST_DIGITS:
        raise UsageError(f"precision is {LEAST_DIGITS} to {MOST_DIGITS} decimal digits, not {precision}")
    return multiprecision(precision)
