"""Taylor coefficients along a flow: the recurrences, a tape's lines as text, and that text as two Python functions.

Coefficient 0 of a line is the operation itself, in the language of routines (`program`). Coefficient k > 0 is a sum
over earlier coefficients of the line and of its operands: A. Griewank and A. Walther, *Evaluating Derivatives*,
Sec. 13.2 (doi:10.1137/1.9780898717761). In C the recurrences are those of `runtime/c/hs_series.h`; the text of a line
is the same up to how things are named (`TapeLanguage`).

Sums go from the middle outwards, two terms at a time: a processor can begin with them before the newest coefficients
are known. Both engines add in the same order. A division by k is a product with ``inverse[k]``, which is 1/k rounded:
coefficients wait for each other, and a division takes long.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Any, NamedTuple, NoReturn

from hsdsl.base.numbers.arithmetic import DOMAIN_ERRORS, Arithmetic, Number
from hsdsl.engine.backends.python import compile_routines
from hsdsl.engine.kernel import Series, Taylor
from hsdsl.mathematics.program import Operation, Tape

INTEGER_POWERS = 64  # of a series that begins with zero: repeated products


def pairs(k: int, a: Series, b: Series, first: int) -> Number:
    """Sum a[j] b[k - j] for j from ``first`` to k - ``first``."""
    low: Number = 0
    high: Number = 0 if k % 2 else a[k // 2] * b[k // 2]
    for j in range((k - 1) // 2, first - 1, -1):
        low = low + a[j] * b[k - j]
        high = high + a[k - j] * b[j]
    return low + high


def product(k: int, a: Series, b: Series) -> Number:
    """Coefficient k of a b."""
    return pairs(k, a, b, 0)


def behind(k: int, a: Series, b: Series) -> Number:
    """Sum a[j] b[k - j] for j from 1 to k: what is known of a product before b[k] is."""
    return pairs(k, a, b, 1) + a[k] * b[0]


def few(k: int, a: Series, b: Series, last: int) -> Number:
    """Sum the same for j from 1 to ``last`` > 0, where a has no further coefficients."""
    total = a[last] * b[k - last]
    for j in range(last - 1, 0, -1):
        total = total + a[j] * b[k - j]
    return total


def symmetric(k: int, a: Series, first: int) -> Number:
    """Sum a[j] a[k - j] for j from ``first`` to k - ``first``: all but the middle one come twice."""
    total: Number = 0
    for j in range((k - 1) // 2, first - 1, -1):
        total = total + a[j] * a[k - j]
    total = 2 * total
    return total if k % 2 else total + a[k // 2] * a[k // 2]


def square(k: int, a: Series) -> Number:
    """Coefficient k of a**2."""
    return symmetric(k, a, 0)


def root(k: int, z: Series, a: Number) -> Number:
    """Coefficient k of z = sqrt(a), ``a`` being coefficient k of the radicand."""
    return (a - symmetric(k, z, 1)) / (2 * z[0])


def power(k: int, z: Series, a: Series, c: Number) -> Number:
    """Coefficient k of z = a**c for a constant c; where a begins with zero only whole c have a series."""
    if a[0] == 0 and c == int(c) and 0 <= c <= INTEGER_POWERS:
        return _repeated(k, a, int(c))
    total = c * a[k] * k * z[0]
    for j in range(k - 1, 0, -1):
        total = total + (c * j - (k - j)) * a[j] * z[k - j]
    return total / (k * a[0])


def _repeated(k: int, a: Series, c: int) -> Number:
    z: list[Number] = [1] + [0] * k
    for _ in range(c):
        z = [z[0] * a[0], *(product(i, a, z) for i in range(1, k + 1))]
    return z[k]


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


class TapeLanguage(NamedTuple):
    """How one language names things."""

    series: Callable[[int], str]  # a line's coefficients, as a whole,
    value: Callable[[int], str]  # coefficient 0,
    newest: Callable[[int], str]  # and coefficient k, where k is what is being computed
    constant: Callable[[int], str]  # of the tape
    zero: str
    call: str  # before the name of a recurrence
    bad: str  # its last argument where it may have no value
    least: Callable[[int], str]  # the lesser of k and a number


def value_of(operation: Operation, language: TapeLanguage) -> str:
    """Write coefficient 0 of an operation."""
    template = VALUES.get(operation.kind, VALUE)
    return template.format(kind=operation.kind, zero=language.zero, **_operands(operation, language, language.value))


def coefficient_of(line: int, operation: Operation, language: TapeLanguage) -> str:
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


def _operands(operation: Operation, language: TapeLanguage, name: Callable[[int], str]) -> dict[str, str]:
    named = dict(zip("uvw", map(name, operation.lines), strict=False))
    return named if operation.constant is None else named | {"c": language.constant(operation.constant)}


HELPERS: dict[str, Any] = {f.__name__: f for f in (behind, few, power, product, range, root, square)}
INVERSE = "    inverse = [zero, *(one/m for m in range(1, order + 2))]"
PYTHON = TapeLanguage(
    series="l{}".format,
    value="l{}[0]".format,
    newest="l{}[k]".format,
    constant="c{}".format,
    zero="zero",
    call="",
    bad="",
    least="min(k, {})".format,
)


def compile_tape(tape: Tape, dimension: int, arithmetic: Arithmetic, name: str) -> Callable[[Sequence[Number]], Taylor]:
    """Compile a tape; what is returned takes the data and returns the routines bound to it."""
    constants = compile_routines(tape.constants, arithmetic, f"constants of {name}")
    numbers = {"zero": arithmetic.zero, "one": arithmetic.zero + 1}
    namespace: dict[str, Any] = {"__builtins__": {}, **arithmetic.functions, **HELPERS, **numbers}
    exec(compile(text_of(tape, dimension), f"<hsdsl series of {name}>", "exec"), namespace)

    def bind(data: Sequence[Number]) -> Taylor:
        of_flow, of_surfaces = constants(*data)
        return Taylor(
            _bound(namespace["flow_of"], (of_flow,)), _bound(namespace["surfaces_of"], (of_flow, of_surfaces))
        )

    return bind


def _bound(make: Callable[..., Any], constants: Iterable[Callable[[], Sequence[Number]]]) -> Any:
    """Bind constants; where one of them has no value there are no coefficients."""
    try:
        return make(*(c for routine in constants for c in routine()))
    except DOMAIN_ERRORS as problem:
        kept = problem

        def without(*_: Any) -> NoReturn:
            raise kept

        return without


def text_of(tape: Tape, dimension: int) -> str:
    """Write ``flow_of(constants)`` and ``surfaces_of(constants)``, which return the functions of a `Taylor`."""
    states, first, count = range(1, dimension + 1), dimension + 1, tape.constant_count
    own, after = range(first, first + tape.needed), range(first + tape.needed, first + len(tape.operations))
    body = [f"def flow_of({_names('c', range(count))}):", "  def flow(order, t, x):", INVERSE]
    body += ["    l0 = [t, one] + [zero]*order", *(f"    l{i} = [x[{i - 1}]]" for i in states)]
    body += _values(tape, own, first)
    body += [f"    l{i}.append(l{tape.flow[i - 1]}[0])" for i in states]
    body += ["    for k in range(1, order + 1):", "      m = k + 1", *_coefficients(tape, own, first)]
    body += [f"      l{i}.append(l{tape.flow[i - 1]}[k]*inverse[m])" for i in states]
    every = _names("l", range(first + tape.needed))
    body += [f"    return ({every})", "  return flow"]
    body += [f"def surfaces_of({_names('c', range(count + tape.surface_constant_count))}):"]
    body += ["  def surfaces(order, lines):", f"    ({every}) = lines", INVERSE, *_values(tape, after, first)]
    body += ["    for k in range(1, order + 1):", "      pass", *_coefficients(tape, after, first)]
    found = "".join("None, " if line is None else f"l{line}[:order + 1], " for line in tape.surfaces)
    return "\n".join([*body, f"    return ({found})", "  return surfaces", ""])


def _names(letter: str, numbers: Iterable[int]) -> str:
    return "".join(f"{letter}{i}, " for i in numbers)


def _values(tape: Tape, lines: range, first: int) -> list[str]:
    return [f"    l{i} = [{value_of(tape.operations[i - first], PYTHON)}]" for i in lines]


def _coefficients(tape: Tape, lines: range, first: int) -> list[str]:
    return [f"      l{i}.append({coefficient_of(i, tape.operations[i - first], PYTHON)})" for i in lines]
