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
        return namespace["bind"](*constants(*data)[0]())

    return bind


def text_of(tape: Tape, dimension: int) -> str:
    """Write ``bind(constants)``, which returns ``taylor(order, t, x)``."""
    states = range(1, dimension + 1)
    first = dimension + 1
    lines = [_line(first + i, operation) for i, operation in enumerate(tape.operations)]
    body = [f"def bind({', '.join(f'c{i}' for i in range(tape.constant_count))}):", "  def taylor(order, t, x):"]
    body += ["    l0 = [t, one] + [zero]*order", *(f"    l{i} = [x[{i - 1}]]" for i in states)]
    body += [f"    l{first + i} = []" for i in range(len(lines))]
    body += ["    for k in range(order):", "      m = k + 1"]
    body += [f"      {line}" for line in lines]
    body += [f"      l{i}.append(l{tape.flow[i - 1]}[k]/m)" for i in states]
    body += ["    k = order", *(f"    {line}" for line in _for_surfaces(tape, lines, first))]
    surfaces = ", ".join("None" if line is None else f"l{line}" for line in tape.surfaces)
    body += [f"    return ({''.join(f'l{i}, ' for i in states)}), ({surfaces}{', ' if tape.surfaces else ''})"]
    return "\n".join([*body, "  return taylor", ""])


def _line(number: int, operation: Operation) -> str:
    template = TEMPLATES.get(operation.kind, FUNCTION)
    names = dict(zip("uvgw", (f"l{i}" for i in operation.lines), strict=False))
    text = template.format(kind=operation.kind, z=f"l{number}", c=f"c{operation.constant}", **names)
    return f"l{number}.append({text})"


def _for_surfaces(tape: Tape, lines: list[str], first: int) -> list[str]:
    """The last coefficient of what the surfaces need: the states have theirs already."""
    wanted, needed = [line for line in tape.surfaces if line is not None], set[int]()
    while wanted:
        line = wanted.pop()
        if line >= first and line not in needed:
            needed.add(line)
            wanted += tape.operations[line - first].lines
    return [lines[line - first] for line in sorted(needed)]
