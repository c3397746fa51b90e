"""One routine of a program as a C function."""

from __future__ import annotations

import ast
from collections.abc import Mapping

from hsdsl.engine.backends.printer import C_OPERATORS, Language, number_text, stored


def literal(value: float) -> str:
    """Write a number without loss."""
    return number_text(value, "NAN", "INFINITY", float.hex)


def constant(value: float) -> str:
    """Write a number of a routine, of the type that it computes with."""
    text = literal(value)
    return text if text.endswith(("NAN", "INFINITY", "INFINITY)")) else f"((hs_real){text.strip('()')})"


C = Language(
    literal=constant,
    assign="const hs_real {name} = {value};",
    results=stored,
    divide="hs_div({left}, {right}, &bad)",
    choose="({test} ? {body} : {other})",
    call="hs_{name}({arguments}, &bad)",
    fold="hs_{name}({left}, {right})",
    truths=("0", "1"),
    operators=C_OPERATORS,
)


def function_body(definition: ast.FunctionDef, names: Mapping[str, str]) -> str:
    """Print the body of a routine; ``names`` says what its arguments and data are called in C.

    Raises ValueError: the text is not of the language of routines.
    """
    return "\n".join(f"  {line}" for line in C.body(definition, names))
