"""One routine of a program as a C function, or as one that calls pieces of bounded size."""

from __future__ import annotations

import ast
from collections.abc import Mapping
from textwrap import dedent

from hsdsl.backends.c.pieces import LARGE, Assignment, pieces
from hsdsl.backends.c.printer import expression_of, function_body

_FUNCTION = """\
static int {name}(const hs_real *restrict p, hs_real t, const hs_real *restrict x, hs_real *restrict out) {{
  int bad = 0;
  (void)p, (void)t, (void)x, (void)out;
{body}
  return bad;
}}
"""
_PIECE = """\
static HS_APART int {name}(const hs_real *restrict p, hs_real t, const hs_real *restrict x, hs_real *restrict v,
    hs_real *restrict out) {{
  int bad = 0;
  (void)p, (void)t, (void)x, (void)v, (void)out;
{body}
  return bad;
}}
"""
_WHOLE = """\
static int {name}(const hs_real *restrict p, hs_real t, const hs_real *restrict x, hs_real *restrict out) {{
  hs_real v[{size}];
  return {calls};
}}
"""


def routine_function(name: str, text: str, data: Mapping[str, str]) -> str:
    """A routine, its text being that of a Python function from its arguments on; ``data`` names what it closes over."""
    definition = ast.parse(dedent(f"    def routine{text}")).body[0]
    assert isinstance(definition, ast.FunctionDef)
    names = {**data, **_named(definition)}
    if _size(definition) <= LARGE:
        return _FUNCTION.format(name=name, body=function_body(definition, names))
    assignments, locals_ = _assignments(definition, names)
    found = pieces(assignments)
    parts = [f"{name}_{i}" for i in range(len(found))]
    bodies = ("\n".join(f"  {statement}" for statement in piece) for piece in found)
    whole = _WHOLE.format(
        name=name, size=max(1, locals_), calls=" || ".join(f"{part}(p, t, x, v, out)" for part in parts)
    )
    return "".join((*(_PIECE.format(name=part, body=body) for part, body in zip(parts, bodies, strict=True)), whole))


def _size(definition: ast.FunctionDef) -> int:
    last = definition.body[-1]
    assert isinstance(last, ast.Return) and isinstance(last.value, ast.Tuple)
    return len(definition.body) - 1 + len(last.value.elts)


def _assignments(definition: ast.FunctionDef, names: dict[str, str]) -> tuple[list[Assignment], int]:
    """The statements of a routine, with its own names in an array, and how many there are."""
    found: list[Assignment] = []
    own: dict[str, int] = {}

    def add(target: str, value: ast.expr) -> None:
        used = {node.id for node in ast.walk(value) if isinstance(node, ast.Name)}
        found.append(Assignment(target, expression_of(value, names), [own[name] for name in used & own.keys()]))

    *statements, last = definition.body
    for i, statement in enumerate(statements):
        assert isinstance(statement, ast.Assign) and isinstance(statement.targets[0], ast.Name)
        add(f"v[{i}]", statement.value)
        own[statement.targets[0].id] = i
        names[statement.targets[0].id] = f"v[{i}]"
    assert isinstance(last, ast.Return) and isinstance(last.value, ast.Tuple)
    for i, value in enumerate(last.value.elts):
        add(f"out[{i}]", value)
    return found, len(statements)


def _arguments(definition: ast.FunctionDef) -> dict[str, str]:
    if not definition.args.args:
        return {}
    time, *others = (argument.arg for argument in definition.args.args)
    return {time: time} | {name: f"x[{i}]" for i, name in enumerate(others)}


def _named(definition: ast.FunctionDef) -> dict[str, str]:
    """What a routine's arguments are called in C: those of its head, or those that it takes out of all."""
    found = _arguments(definition)
    while definition.body and (match := _taken(definition.body[0])):
        name, i = match
        found[name] = f"x[{i - 1}]" if i else "t"
        del definition.body[0]
    return found


def _taken(part: ast.stmt) -> tuple[str, int] | None:
    """The argument that a statement ``name = given[i]`` names."""
    match part:
        case ast.Assign(targets=[ast.Name(id=name)], value=ast.Subscript(slice=ast.Constant(value=int(i)))):
            return name, i
        case _:
            return None
