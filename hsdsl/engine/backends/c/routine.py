"""One routine of a program as a C function, or as one that calls pieces of bounded size."""

from __future__ import annotations

import ast
from collections.abc import Mapping
from dataclasses import replace
from textwrap import dedent

from hsdsl.engine.backends.c.pieces import LARGE, Assignment, pieces
from hsdsl.engine.backends.c.printer import C, function_body

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
  return {status};
}}
"""
_APART = """\
static int {name}(const hs_real *restrict p, hs_real t, const hs_real *restrict x, hs_real *restrict out) {{
  hs_real v[{size}];
  int bad = 0;
  (void)p, (void)t, (void)x, (void)v;
{body}
  return 0;
}}
"""
_WHOLE = """\
static int {name}(const hs_real *restrict p, hs_real t, const hs_real *restrict x, hs_real *restrict out) {{
  hs_real v[{size}];
  return {calls};
}}
"""


def routine_function(name: str, text: str, data: Mapping[str, str], apart: bool = False) -> str:
    """A routine, its text being that of a Python function from its arguments on; ``data`` names what it closes over.

    With ``apart`` a value that there is none of is not-a-number, and the others are what they are.
    """
    definition = ast.parse(dedent(f"    def routine{text}")).body[0]
    assert isinstance(definition, ast.FunctionDef)
    names = {**data, **_named(definition)}
    small = _size(definition) <= LARGE
    assignments, locals_ = _assignments(definition, dict(names)) if apart or not small else ([], 0)
    if apart := apart and any("&bad" in one.value for one in assignments):
        assignments, locals_ = _each_apart(assignments, locals_), 2 * locals_
    if small and not apart:
        return _FUNCTION.format(name=name, body=function_body(definition, names))
    if not small:
        return _in_pieces(name, assignments, max(1, locals_), "0" if apart else "bad")
    body = "\n".join(f"  {one.target} = {one.value};" for one in assignments)
    return _APART.format(name=name, size=max(1, locals_), body=body)


def _in_pieces(name: str, assignments: list[Assignment], size: int, status: str) -> str:
    found = pieces(assignments)
    parts = [f"{name}_{i}" for i in range(len(found))]
    bodies = ("\n".join(f"  {statement}" for statement in piece) for piece in found)
    functions = (_PIECE.format(name=part, body=body, status=status) for part, body in zip(parts, bodies, strict=True))
    calls = " || ".join(f"{part}(p, t, x, v, out)" for part in parts)
    return "".join((*functions, _WHOLE.format(name=name, size=size, calls=calls)))


def _failing(assignments: list[Assignment]) -> list[bool]:
    """Whether each value may be none."""
    found: list[bool] = []
    for one in assignments:
        found.append("&bad" in one.value or any(found[i] for i in one.needs))
    return found


def _each_apart(assignments: list[Assignment], locals_: int) -> list[Assignment]:
    """Let each value be none where it, or what it needs, is none: ``v`` has behind the values whether they are lost."""
    fails = _failing(assignments)

    def apart(i: int, one: Assignment) -> Assignment:
        lost = " | ".join(f"(v[{locals_ + k}] != 0)" for k in sorted(one.needs) if fails[k])
        result = f"{one.target} = bad ? (hs_real)NAN : {one.target}"
        kept = f"v[{locals_ + i}] = (hs_real)bad" if i < locals_ else result
        return replace(one, target=f"bad = {lost or 0}, {one.target}", value=f"{one.value}, {kept}")

    return [apart(i, one) if fails[i] else one for i, one in enumerate(assignments)]


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
        found.append(Assignment(target, C.expression_of(value, names), [own[name] for name in used & own.keys()]))

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
