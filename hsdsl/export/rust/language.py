"""Routines of a program as Rust functions, and texts of a model as literals."""

from __future__ import annotations

import ast
from collections.abc import Iterable, Iterator, Mapping

from hsdsl.backends.printer import C_OPERATORS, Language, number_text, stored


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


def _language(condition: bool) -> Language:
    return Language(
        literal=literal,
        assign="let {name} = {value};",
        results=(lambda values: stored(f"truth({value})" for value in values)) if condition else stored,
        divide="div({left}, {right}, &mut bad)",
        choose="(if {test} {{ {body} }} else {{ {other} }})",
        call="f_{name}({arguments}, &mut bad)",
        fold="{name}({left}, {right})",
        truths=("false", "true"),
        operators=C_OPERATORS,
    )


def _each_apart(definition: ast.FunctionDef, names: Mapping[str, str]) -> Iterator[str]:
    """Outputs, of which one that has no value, or needs what has none, is not-a-number."""
    language, names = _language(False), dict(names)
    *statements, last = definition.body
    assert isinstance(last, ast.Return) and isinstance(last.value, ast.Tuple)
    lost = set[str]()

    def fails(value: ast.expr, text: str) -> str:
        """The statement that says whether what a value needs is lost; none where it always has a value."""
        used = sorted({node.id for node in ast.walk(value) if isinstance(node, ast.Name)} & lost)
        needed = " | ".join(f"lost_{name}" for name in used)
        return f"let mut bad = {needed or 'false'};" if "&mut bad" in text else f"let bad = {needed};" if needed else ""

    for statement in statements:
        assert isinstance(statement, ast.Assign) and isinstance(statement.targets[0], ast.Name)
        name, text = statement.targets[0].id, language.expression_of(statement.value, names)
        before, own = fails(statement.value, text), language.assign.format(name=name, value=text)
        yield f"{before} {own} let lost_{name} = bad;" if before else own
        names[name] = name
        lost |= {name} if before else set()
    for i, value in enumerate(last.value.elts):
        text = language.expression_of(value, names)
        before, own = fails(value, text), f"out[{i}] = {text};"
        yield f"{before} {own} if bad {{ out[{i}] = f64::NAN; }}" if before else own


def function(name: str, definition: ast.FunctionDef, data: Mapping[str, str]) -> str:
    """One routine as a function; its states, then their sizes are ``x[0], ...``."""
    arguments = [argument.arg for argument in definition.args.args if argument.arg[0] in "xs"]
    states = {argument: f"x[{i}]" for i, argument in enumerate(arguments)}
    names = {"t": "t", **data, **states}
    language = _language(definition.name.startswith("condition"))
    lines = _each_apart(definition, names) if definition.name == "outputs" else language.body(definition, names)
    body = "\n".join(f"    {line}" for line in lines)
    signature = "p: &[f64], t: f64, x: &[f64], out: &mut [f64]"
    if definition.name == "outputs":
        return f"fn {name}({signature}) -> bool {{\n{body}\n    false\n}}\n"
    return f"fn {name}({signature}) -> bool {{\n    let mut bad = false;\n{body}\n    bad\n}}\n"
