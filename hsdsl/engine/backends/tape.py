"""A tape's lines as text: what coefficient 0 of each is, and what coefficient k > 0 is, in Python and in C.

Coefficient 0 is the operation itself, in the language of routines (`hsdsl.mathematics.program`). The others are the recurrences of
`recurrences.py`, in C those of `runtime/c/hs_series.h`; the text of both is the same up to how things are named. A
division by k is a product with ``inverse[k]``, which is 1/k rounded: coefficients wait for each other, and a division
takes long.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from hsdsl.mathematics.program import Operation

VALUES = {
    "constant": "{c}",
    "add": "{u} + {v}",
    "sub": "{u} - {v}",
    "neg": "-{u}",
    "offset": "{u} + {c}",
    "scale": "{c}*{u}",
    "slope": "{zero}",
    "mul": "{u}*{v}",
    "square": "{u}*{u}",
    "div": "{u}/{v}",
    "under": "{c}/{u}",
    "sqrt": "sqrt({u})",
    "pow": "pow({u}, {c})",
    "atan2": "atan2({u}, {v})",
    "below": "below({u}, {c}, {v}, {w})",
}
VALUE = "{kind}({u})"  # of a function
COEFFICIENTS = {
    "constant": "{zero}",
    "add": "{u} + {v}",
    "sub": "{u} - {v}",
    "neg": "-{u}",
    "offset": "{u}",
    "scale": "{c}*{u}",
    "slope": "k*{u}",
    "mul": "{call}product(k, {U}, {V})",
    "square": "{call}square(k, {U})",
    "div": "({u} - {call}behind(k, {V}, {Z})) / {V}[0]",
    "under": "-{call}behind(k, {U}, {Z}) / {U}[0]",
    "sqrt": "{call}root(k, {Z}, {u}{bad})",
    "pow": "{call}power(k, {Z}, {U}, {c}{bad})",
    "atan2": "({call}behind(k, {A}, {G}) + {call}behind(k, {B}, {W})) * {call}inverse[k]",
    "below": "{call}below({U}[0], {c}, {v}, {w})",
}
COEFFICIENT = "{call}behind(k, {V}, {G}) * {call}inverse[k]"
# where a sum goes along a polynomial of time
SHORT = {
    "mul": "{call}few(k, {U}, {V}, {last}) + {U}[0]*{v}",
    "div": "({u} - {call}few(k, {V}, {Z}, {last})) / {V}[0]",
    "under": "-{call}few(k, {U}, {Z}, {last}) / {U}[0]",
}
SHORT_COEFFICIENT = "{call}few(k, {V}, {G}, {last}) * {call}inverse[k]"


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
        Prefix of the name of a recurrence; its last argument where it may have no value.
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
    return template.format(kind=operation.kind, zero=language.zero, **_operands(operation, language, language.value))


def coefficient_of(line: int, operation: Operation, language: Language) -> str:
    """Write coefficient k > 0 of the operation that is this line."""
    kind, degree = operation.kind, operation.degree
    short = degree is not None
    template = SHORT.get(kind, SHORT_COEFFICIENT) if short else COEFFICIENTS.get(kind, COEFFICIENT)
    wholes = dict(zip("UVGWAB", map(language.series, operation.lines), strict=False))
    return template.format(
        Z=language.series(line),
        last=language.least(degree) if degree and degree > 1 else "1",
        zero=language.zero,
        call=language.call,
        bad=language.bad,
        **wholes,
        **_operands(operation, language, language.newest),
    )


def _operands(operation: Operation, language: Language, name: Callable[[int], str]) -> dict[str, str]:
    named = dict(zip("uvw", map(name, operation.lines), strict=False))
    return named if operation.constant is None else named | {"c": language.constant(operation.constant)}
