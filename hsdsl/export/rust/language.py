"""Routines of a program as Rust functions, and texts of a model as literals."""

from __future__ import annotations

import ast
from collections.abc import Iterable, Mapping, Sequence

from hsdsl.backends.printer import C_OPERATORS, Language, number_text


def literal(value: float) -> str:
    """Write a number without loss: the shortest decimals that are read as it."""
    return number_text(value, "f64::NAN", "f64::INFINITY")


def string(text: str) -> str:
    """A string literal: signs that are not plain ASCII, quotes and backslashes as escapes."""
    return '"' + "".join(s if s.isascii() and s.isprintable() and s not in '"\\' else _escape(s) for s in text) + '"'


def _escape(sign: str) -> str:
    return f"\\u{{{ord(sign):x}}}" if not 0xD800 <= ord(sign) < 0xE000 else "?"


def array(items: Iterable[str]) -> str:
    """An array."""
    return f"[{', '.join(items)}]"


def numbers(values: Iterable[float]) -> str:
    """An array of numbers."""
    return array(literal(float(value)) for value in values)


def _results(values: Sequence[str]) -> list[str]:
    return [f"out[{i}] = {value};" for i, value in enumerate(values)]


def _conditions(values: Sequence[str]) -> list[str]:
    return [f"out[{i}] = truth({value});" for i, value in enumerate(values)]


def _language(condition: bool) -> Language:
    return Language(
        literal=literal,
        assign="let {name} = {value};",
        results=_conditions if condition else _results,
        divide="div({left}, {right}, &mut bad)",
        choose="(if {test} {{ {body} }} else {{ {other} }})",
        call="f_{name}({arguments}, &mut bad)",
        fold="{name}({left}, {right})",
        truths=("false", "true"),
        operators=C_OPERATORS,
    )


def function(name: str, definition: ast.FunctionDef, data: Mapping[str, str]) -> str:
    """One routine as a function; its states, then their sizes are ``x[0], ...``."""
    arguments = [argument.arg for argument in definition.args.args if argument.arg[0] in "xs"]
    states = {argument: f"x[{i}]" for i, argument in enumerate(arguments)}
    language = _language(definition.name.startswith("condition"))
    body = "\n".join(f"    {line}" for line in language.body(definition, {"t": "t", **data, **states}))
    signature = "p: &[f64], t: f64, x: &[f64], out: &mut [f64]"
    return f"fn {name}({signature}) -> bool {{\n    let mut bad = false;\n{body}\n    bad\n}}\n"
