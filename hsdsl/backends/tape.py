"""A tape's lines as text: what coefficient 0 of each is, and what coefficient k > 0 is, in Python and in C.

Coefficient 0 is the operation itself, in the language of routines (`hsdsl.program`). The others are the recurrences of
`recurrences.py`, in C those of `runtime/c/hs_series.h`; the text of both is the same up to how a line is named.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from hsdsl.program import Operation

VALUES = {
    "constant": "{c}",
    "add": "{u} + {v}",
    "sub": "{u} - {v}",
    "neg": "-{u}",
    "offset": "{u} + {c}",
    "scale": "{c}*{u}",
    "mul": "{u}*{v}",
    "square": "{u}*{u}",
    "div": "{u}/{v}",
    "under": "{c}/{u}",
    "sqrt": "sqrt({u})",
    "pow": "pow({u}, {c})",
    "atan2": "atan2({u}, {v})",
}
VALUE = "{kind}({u})"  # of a function
COEFFICIENTS = {
    "constant": "{zero}",
    "add": "{u} + {v}",
    "sub": "{u} - {v}",
    "neg": "-{u}",
    "offset": "{u}",
    "scale": "{c}*{u}",
    "mul": "{call}product(k, {U}, {V}, {last})",
    "square": "{call}square(k, {U})",
    "div": "{call}quotient(k, {Z}, {u}, {V}, {last})",
    "under": "{call}quotient(k, {Z}, {zero}, {U}, {last})",
    "sqrt": "{call}root(k, {Z}, {u}{bad})",
    "pow": "{call}power(k, {Z}, {U}, {c}, {last}{bad})",
    "atan2": "{call}integral(k, {U}, {G}, k) + {call}integral(k, {V}, {W}, k)",
}
COEFFICIENT = "{call}integral(k, {U}, {V}, {last})"


@dataclass(frozen=True)
class Language:
    """How one language names things.

    Attributes
    ----------
    series : callable
        A line's coefficients, as a whole.
    value, newest : callable
        Coefficient 0 of a line, and coefficient k where k is what is being computed.
    constant : callable
        A constant of the tape.
    zero : str
        The number.
    call, bad : str
        What stands before the name of a recurrence; its last argument where it may have no value.
    least : callable
        The lesser of k and a number.
    """

    series: Callable[[int], str]
    value: Callable[[int], str]
    newest: Callable[[int], str]
    constant: Callable[[int], str]
    zero: str
    call: str
    bad: str
    least: Callable[[int], str]


def value_of(operation: Operation, language: Language) -> str:
    """Write coefficient 0 of an operation."""
    template = VALUES.get(operation.kind, VALUE)
    return template.format(kind=operation.kind, **_operands(operation, language, language.value))


def coefficient_of(line: int, operation: Operation, language: Language) -> str:
    """Write coefficient k > 0 of the operation that is this line."""
    template, degree = COEFFICIENTS.get(operation.kind, COEFFICIENT), operation.degree
    wholes = dict(zip("UVGW", map(language.series, operation.lines), strict=False))
    return template.format(
        Z=language.series(line),
        last="k" if degree is None else "1" if degree == 1 else language.least(degree),
        zero=language.zero,
        call=language.call,
        bad=language.bad,
        **wholes,
        **_operands(operation, language, language.newest),
    )


def _operands(operation: Operation, language: Language, name: Callable[[int], str]) -> dict[str, str]:
    named = dict(zip("uv", map(name, operation.lines), strict=False))
    return named if operation.constant is None else named | {"c": language.constant(operation.constant)}
