"""Taylor coefficients along a flow: a tape turned into one Python function, over any number type.

The text has one line an operation and names nothing but lines, constants and the recurrences.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from hsdsl.arithmetic import Arithmetic, Number
from hsdsl.backends.python import compile_routines
from hsdsl.backends.recurrences import integral, power, product, quotient, root
from hsdsl.kernel import Taylor
from hsdsl.program import Operation, Tape

TEMPLATES = {
    "constant": "{c} if k == 0 else zero",
    "add": "{u}[k] + {v}[k]",
    "sub": "{u}[k] - {v}[k]",
    "neg": "-{u}[k]",
    "offset": "{u}[k] + {c} if k == 0 else {u}[k]",
    "scale": "{c}*{u}[k]",
    "mul": "product(k, {u}, {v})",
    "div": "quotient(k, {z}, {u}[k], {v})",
    "under": "quotient(k, {z}, {c} if k == 0 else zero, {u})",
    "sqrt": "root(k, {z}, {u}, sqrt)",
    "pow": "power(k, {z}, {u}, {c}, pow)",
    "atan2": "atan2({u}[0], {v}[0]) if k == 0 else integral(k, {u}, {g}) + integral(k, {v}, {w})",
}
FUNCTION = "{kind}({u}[0]) if k == 0 else integral(k, {u}, {v})"
HELPERS: dict[str, Any] = {
    "product": product,
    "quotient": quotient,
    "root": root,
    "power": power,
    "integral": integral,
    "range": range,
}


def compile_tape(tape: Tape, dimension: int, arithmetic: Arithmetic, name: str) -> Callable[[Sequence[Number]], Taylor]:
    """Compile a tape; what is returned takes the data and returns the routine bound to it."""
    constants = compile_routines(tape.constants, arithmetic, f"constants of {name}")
    numbers = {"zero": arithmetic.zero, "one": arithmetic.zero + 1}
    namespace: dict[str, Any] = {"__builtins__": {}, **arithmetic.functions, **HELPERS, **numbers}
    exec(compile(text_of(tape, dimension), f"<hsdsl series of {name}>", "exec"), namespace)

    def bind(data: Sequence[Number]) -> Taylor:
        return Taylor(*namespace["bind"](*constants(*data)[0]()))

    return bind


def text_of(tape: Tape, dimension: int) -> str:
    """Write ``bind(constants)``, which returns the two functions of a `Taylor`."""
    states, first = range(1, dimension + 1), dimension + 1
    lines = [_line(first + i, operation) for i, operation in enumerate(tape.operations)]
    own, after = range(first, first + tape.needed), range(first + tape.needed, first + len(lines))
    body = [f"def bind({', '.join(f'c{i}' for i in range(tape.constant_count))}):", "  def flow(order, t, x):"]
    body += ["    l0 = [t, one] + [zero]*order", *(f"    l{i} = [x[{i - 1}]]" for i in states)]
    body += [f"    l{i} = []" for i in own]
    body += ["    for k in range(order + 1):", "      m = k + 1"]
    body += [f"      {lines[i - first]}" for i in own]
    body += [f"      l{i}.append(l{tape.flow[i - 1]}[k]/m)" for i in states]
    every = "".join(f"l{i}, " for i in range(first + tape.needed))
    body += [f"    return ({every})", "  def surfaces(order, lines):", f"    ({every}) = lines"]
    body += [f"    l{i} = []" for i in after]
    body += ["    for k in range(order + 1):", "      pass", *(f"      {lines[i - first]}" for i in after)]
    found = "".join("None, " if line is None else f"l{line}[:order + 1], " for line in tape.surfaces)
    return "\n".join([*body, f"    return ({found})", "  return flow, surfaces", ""])


def _line(number: int, operation: Operation) -> str:
    template = TEMPLATES.get(operation.kind, FUNCTION)
    names = dict(zip("uvgw", (f"l{i}" for i in operation.lines), strict=False))
    text = template.format(kind=operation.kind, z=f"l{number}", c=f"c{operation.constant}", **names)
    return f"l{number}.append({text})"
