"""Routines of a program as syntax trees by name, and the names of the numbers that they are bound to."""

from __future__ import annotations

import ast

from hsdsl.program import Program, Routines


def definitions(routines: Routines) -> dict[str, ast.FunctionDef]:
    """The functions of a text of routines; what names the parameters that one is given is left out."""
    bind = ast.parse(routines.source).body[0]
    assert isinstance(bind, ast.FunctionDef)
    found = {node.name: node for node in bind.body if isinstance(node, ast.FunctionDef)}
    for node in found.values():
        node.body = [part for part in node.body if not _names_a_parameter(part)]
    return found


def _names_a_parameter(part: ast.stmt) -> bool:
    return isinstance(part, ast.Assign) and isinstance(part.value, ast.Subscript)


def data_names(program: Program) -> list[str]:
    """Names of the numbers that a mode is bound to: parameters, the line of each input's segment, switches."""
    names = [f"p{i}" for i in range(len(program.parameters))]
    names += [f"{letter}{i}" for i in range(len(program.inputs)) for letter in "abc"]
    return names + [f"k{i}" for i in range(len(program.switches))]


def parameters_in(*nodes: ast.AST) -> set[int]:
    """The numbers of the parameters that parts of routines name."""
    names = [node.id for part in nodes for node in ast.walk(part) if isinstance(node, ast.Name)]
    return {int(name[1:]) for name in names if name[0] == "p" and name[1:].isdigit()}
