"""Routines of a program as Python functions over arrays of JAX."""

from __future__ import annotations

import ast
from collections.abc import Mapping, Sequence

from hsdsl.engine.backends.printer import C_OPERATORS, Language, number_text


def literal(value: float) -> str:
    """Write a number without loss."""
    return number_text(value, "NAN", "INF")


def _results(values: Sequence[str]) -> list[str]:
    return [f"return ({''.join(f'{value}, ' for value in values).rstrip()})"]


JAX = Language(
    literal=literal,
    assign="{name} = {value}",
    results=_results,
    divide="f_div({left}, {right})",
    choose="jnp.where({test}, {body}, {other})",
    call="f_{name}({arguments})",
    fold="f_{name}({left}, {right})",
    truths=("jnp.asarray(False)", "jnp.asarray(True)"),
    operators={**C_OPERATORS, ast.And: "&", ast.Or: "|", ast.Not: "~"},
)


def function(name: str, definition: ast.FunctionDef, data: Mapping[str, str], signature: str) -> str:
    """One routine as a function of this name; states are ``x[0], ...``, sizes ``s[0], ...``."""
    names = (argument.arg for argument in definition.args.args)
    states = {name: f"{name[0]}[{name[1:]}]" for name in names if name[0] in "xs"}
    body = "\n".join(f"    {line}" for line in JAX.body(definition, {"t": "t", **data, **states}))
    return f"def {name}({signature}):\n{body}\n"
