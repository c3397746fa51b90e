"""Taylor coefficients along a flow: a tape turned into two Python functions, over any number type.

The text has one line an operation and names nothing but lines, constants and the recurrences.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Any, NoReturn

from hsdsl.base.numbers.arithmetic import DOMAIN_ERRORS, Arithmetic, Number
from hsdsl.engine.backends.recurrences import behind, few, power, product, root, square
from hsdsl.engine.backends.tape import Language, coefficient_of, value_of
from hsdsl.engine.backends.text import compile_routines
from hsdsl.engine.kernel import Taylor
from hsdsl.mathematics.program import Tape

HELPERS: dict[str, Any] = {
    "behind": behind,
    "few": few,
    "power": power,
    "product": product,
    "range": range,
    "root": root,
    "square": square,
}
INVERSE = "    inverse = [zero, *(one/m for m in range(1, order + 2))]"
PYTHON = Language(
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
