"""Generated text of routines, compiled to Python functions over a number type."""

from __future__ import annotations

import ast
import re
from collections.abc import Callable
from fractions import Fraction
from textwrap import indent
from typing import Any

from hsdsl.base.numbers.arithmetic import DOMAIN_ERRORS, Arithmetic
from hsdsl.engine.kernel import Routine
from hsdsl.mathematics.program import Routines

LOST = (*DOMAIN_ERRORS, UnboundLocalError)  # no value, also where a name is used whose statement had none
_CONSTANT = re.compile(r"\bq_(m?)(\d+)_(\d+)\b")


def compile_routines(routines: Routines, arithmetic: Arithmetic, name: str) -> Callable[..., tuple[Routine, ...]]:
    """Compile generated text; returns its ``bind``.

    Floats are written into the text as literals (the interpreter is fastest on those); other numbers are names.
    """
    namespace: dict[str, Any] = {"__builtins__": {}, "inf": float("inf"), "LOST": LOST, **arithmetic.functions}
    literal = arithmetic.name == "float64"

    def replace(match: re.Match[str]) -> str:
        value = arithmetic.constant(Fraction(int(match[2]) * (-1 if match[1] else 1), int(match[3])))
        if literal:
            return f"({value!r})" if match[1] else repr(value)
        namespace[match[0]] = value
        return match[0]

    text = _CONSTANT.sub(replace, routines.source)
    exec(compile(text, f"<hsdsl {name}>", "exec"), namespace)
    return namespace["bind"]


def each_apart(routines: Routines, name: str) -> Routines:
    """One of the routines, so that a value that there is none of is not-a-number, and the others are what they are."""
    bind = ast.parse(routines.source).body[0]
    assert isinstance(bind, ast.FunctionDef)
    routine = next(part for part in bind.body if isinstance(part, ast.FunctionDef) and part.name == name)
    *statements, last = routine.body
    assert isinstance(last, ast.Return) and isinstance(last.value, ast.Tuple)
    results = [f"result_{k}" for k in range(len(last.value.elts))]
    lines = [_tried(ast.unparse(statement), "pass") for statement in statements]
    for result, value in zip(results, last.value.elts, strict=True):
        lines.append(_tried(f"{result} = {ast.unparse(value)}", f"{result} = nan"))
    body = "".join([*lines, f"return ({''.join(f'{result}, ' for result in results)})\n"])
    function = f"def {name}({ast.unparse(routine.args)}):\n{indent(body, '    ')}return ({name},)\n"
    return Routines((name,), f"def bind({ast.unparse(bind.args)}):\n{indent(function, '    ')}")


def _tried(statement: str, otherwise: str) -> str:
    return f"try:\n    {statement}\nexcept LOST:\n    {otherwise}\n"
