"""A tape as C functions that write Taylor coefficients: coefficient 0 of every line, then a loop over the others.

The constants of a tape are arguments, so that modes which differ in numbers alone share one function.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable

from hsdsl.backends.c.printer import expression
from hsdsl.backends.tape import Language, coefficient_of, value_of
from hsdsl.program import Tape

_LINE = re.compile(r"\bl(\d+)\b")
_FLOW = """\
static int NAME(const hs_real *restrict c, int order, hs_real t, const hs_real *restrict x,
                hs_real *restrict lines) {{
  int bad = 0;
  const int length = order + 2;
  (void)c, (void)t, (void)x;
{pointers}
  l0[0] = t;
  l0[1] = 1.0;
  for (int k = 2; k < length; k++) l0[k] = 0.0;
{values}
  if (bad) return bad;
  for (int k = 1; k <= order; k++) {{
{coefficients}
  }}
  return bad;
}}
"""
_SURFACES = """\
static int NAME(const hs_real *restrict c, int order, hs_real *restrict lines) {{
  int bad = 0;
  const int length = order + 2;
{pointers}
  (void)c, (void)l0;
{values}
  if (bad) return bad;
  for (int k = 1; k <= order; k++) {{
{coefficients}
  }}
  return bad;
}}
"""


def line_count(tape: Tape, dimension: int) -> int:
    """How many lines there are: time, the states, operations."""
    return 1 + dimension + len(tape.operations)


def flow_lines(tape: Tape, dimension: int) -> str:
    """Write the function of the lines that the flow needs; its name is to be put in for ``NAME``.

    The states' newest coefficients stay in variables ``w``: each waits for the one before, and memory is slower.
    """
    first, states = dimension + 1, range(1, dimension + 1)

    def value(line: int) -> str:
        return "t" if line == 0 else f"x[{line - 1}]" if line < first else f"v{line}"

    def newest(line: int) -> str:
        return "l0[k]" if line == 0 else f"w{line}" if line < first else f"v{line}"

    own = range(first, first + tape.needed)
    values = [f"l{i}[0] = {value(i)};" for i in states] + _values(tape, own, first, value)
    values += [f"hs_real w{i} = l{i}[1] = {value(tape.flow[i - 1])}; (void)w{i};" for i in states]
    coefficients = _coefficients(tape, own, first, newest)
    coefficients += [f"const hs_real u{i} = {newest(tape.flow[i - 1])} * hs_inverse[k + 1];" for i in states]
    coefficients += [f"w{i} = l{i}[k + 1] = u{i};" for i in states]
    return _filled(_FLOW, values, coefficients)


def surface_lines(tape: Tape, dimension: int) -> str:
    """Write the function of the further lines, which surfaces need."""
    first = dimension + 1
    own = range(first + tape.needed, first + len(tape.operations))

    def value(line: int) -> str:
        return f"v{line}" if line in own else f"l{line}[0]"

    def newest(line: int) -> str:
        return f"v{line}" if line in own else f"l{line}[k]"

    return _filled(_SURFACES, _values(tape, own, first, value), _coefficients(tape, own, first, newest))


def _values(tape: Tape, lines: Iterable[int], first: int, name: Callable[[int], str]) -> list[str]:
    found: list[str] = []
    language = _language("c{}".format, "n{}".format, "q_0_1")
    for i in lines:
        operation = tape.operations[i - first]
        names = {f"n{line}": name(line) for line in operation.lines}
        names[f"c{operation.constant}"] = f"c[{operation.constant}]"
        found.append(f"const hs_real v{i} = {expression(value_of(operation, language), names)};")
        found.append(f"l{i}[0] = v{i};")
    return found


def _coefficients(tape: Tape, lines: Iterable[int], first: int, name: Callable[[int], str]) -> list[str]:
    found: list[str] = []
    language = _language("c[{}]".format, name, "0.0")
    for i in lines:
        found.append(f"const hs_real v{i} = {coefficient_of(i, tape.operations[i - first], language)};")
        found.append(f"l{i}[k] = v{i};")
    return found


def _language(constant: Callable[[int], str], name: Callable[[int], str], zero: str) -> Language:
    return Language(
        series="l{}".format,
        value=name,
        newest=name,
        constant=constant,
        zero=zero,
        call="hs_",
        bad=", &bad",
        least="k < {0} ? k : {0}".format,
    )


def _filled(template: str, values: list[str], coefficients: list[str]) -> str:
    used = sorted({0, *(int(i) for text in (*values, *coefficients) for i in _LINE.findall(text))})
    return template.format(
        pointers="\n".join(f"  hs_real *const l{i} = lines + {i} * length;" for i in used),
        values="\n".join(f"  {text}" for text in values),
        coefficients="\n".join(f"    {text}" for text in coefficients),
    )
