"""Routines of a program as MATLAB: functions of time, the states and the parameters, each a column of values."""

from __future__ import annotations

import ast
import re
from collections.abc import Mapping, Sequence

from hsdsl.engine.backends.printer import C_OPERATORS, Language, number_text

_WORDS = """
break case catch classdef continue do else elseif end end_try_catch end_unwind_protect endfor endfunction endif
endswitch endwhile enumeration events for function global if methods otherwise parfor persistent properties return spmd
switch try until unwind_protect while arguments import
"""
KEYWORDS = frozenset(_WORDS.split())
BUILT_IN = ("sin", "cos", "tan", "atan", "atan2", "sinh", "cosh", "tanh", "asinh", "exp", "abs", "sign", "floor")
_FUNCTIONS = frozenset((*BUILT_IN, "min", "max", "zeros", "pi", "eps", "Inf", "NaN", "i", "j", "e"))
_PLAIN = re.compile(rf"\bhs_({'|'.join(BUILT_IN)})\(")
_HELPER = re.compile(r"\bhs_(\w+)\(")
_TEMPORARY = re.compile(r"\b[vw]\d+\b")

# what MATLAB answers with a complex number has no value here
HELPERS = {
    "sqrt": ("x", "x >= 0", "sqrt(x)"),
    "log": ("x", "x > 0", "log(x)"),
    "asin": ("x", "abs(x) <= 1", "asin(x)"),
    "acos": ("x", "abs(x) <= 1", "acos(x)"),
    "acosh": ("x", "x >= 1", "acosh(x)"),
    "atanh": ("x", "abs(x) < 1", "atanh(x)"),
    "pow": ("x, y", "x >= 0 || y == floor(y)", "x ^ y"),
    "heaviside": ("x", "x == x", "(1 + sign(x)) / 2"),
    "choose": ("test, x, other", "test", "x"),
}


def literal(value: float) -> str:
    """Write a number without loss."""
    return number_text(value, "NaN", "Inf", lambda number: repr(number).removesuffix(".0"))


def _results(values: Sequence[str]) -> list[str]:
    return [f"out = zeros({len(values)}, 1);", *(f"out({i}) = {value};" for i, value in enumerate(values, start=1))]


MATLAB = Language(
    literal=literal,
    assign="{name} = {value};",
    results=_results,
    divide="({left} / {right})",
    choose="hs_choose({test}, {body}, {other})",
    call="hs_{name}({arguments})",
    fold="{name}({left}, {right})",
    truths=("false", "true"),
    operators={**C_OPERATORS, ast.NotEq: "~=", ast.Not: "~"},
)


def body(definition: ast.FunctionDef, names: Mapping[str, str]) -> str:
    """The statements of a routine, indented; ``out`` has its values."""
    return "\n".join(f"  {_PLAIN.sub(_without_prefix, line)}" for line in MATLAB.body(definition, names))


def _without_prefix(match: re.Match[str]) -> str:
    return f"{match[1]}("


def reserved(source: str) -> frozenset[str]:
    """What no variable of a function made from a text may be called."""
    own = ("t", "x", "p", "d", "s", "m", "out")
    return KEYWORDS | _FUNCTIONS | frozenset(own) | frozenset(_TEMPORARY.findall(source))


def helpers(text: str) -> str:
    """The functions that a text calls and MATLAB lacks."""
    lines: list[str] = []
    for name in sorted(set(_HELPER.findall(text)) & HELPERS.keys()):
        arguments, where, value = HELPERS[name]
        lines.append(f"function value = hs_{name}({arguments})\n  if {where}\n    value = {value};\n")
        lines[-1] += f"  else\n    value = {'other' if name == 'choose' else 'NaN'};\n  end\nend\n"
    return "\n".join(lines)
