"""Generated text of routines, compiled to Python functions over a number type."""

from __future__ import annotations

import re
from collections.abc import Callable
from fractions import Fraction
from typing import Any

from hsdsl.arithmetic import Arithmetic
from hsdsl.kernel import Routine
from hsdsl.program import Routines

_CONSTANT = re.compile(r"\bq_(m?)(\d+)_(\d+)\b")


def compile_routines(routines: Routines, arithmetic: Arithmetic, name: str) -> Callable[..., tuple[Routine, ...]]:
    """Compile generated text; returns its ``bind``.

    Floats are written into the text as literals (the interpreter is fastest on those); other numbers are names.
    """
    namespace: dict[str, Any] = {"__builtins__": {}, "inf": float("inf"), **arithmetic.functions}
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
