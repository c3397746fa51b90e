"""Routines of a program as syntax trees by name, and the names of the numbers that they are bound to."""

from __future__ import annotations

import ast
from collections.abc import Sequence

from hsdsl.mathematics.program import ModeProgram, Program, Routines


def definitions(routines: Routines) -> dict[str, ast.FunctionDef]:
    """The functions of a text of routines; what names the parameters that one is given is left out."""
    bind = ast.parse(routines.source).body[0]
    assert isinstance(bind, ast.FunctionDef)
    found = {node.name: node for node in bind.body if isinstance(node, ast.FunctionDef)}
    for node in found.values():
        node.body = [part for part in node.body if not _names_a_parameter(part)]
    return found


def mode_definitions(mode: ModeProgram) -> dict[str, ast.FunctionDef]:
    """The routines of a mode; gradients, resets, spreads have all states."""
    found, n = definitions(mode.routines), len(mode.states)
    states, sizes = [f"x{i}" for i in range(n)], [f"s{i}" for i in range(n)]
    for name, definition in found.items():
        names = ["t", *states, *(sizes if name.startswith("spread") else [])]
        definition.args = ast.arguments([], [ast.arg(name) for name in names], None, [], [], None, [])
    for k, places in enumerate(mode.slopes):
        _fill(found[f"gradient_{k}"], places, [_name("q_0_1")] * (n + 1))
    for k, edge in enumerate(mode.edges):
        count = len(edge.target_states)
        for name, letter in ((f"reset_{k}", "x"), (f"spread_{k}", "s")):
            _fill(found[name], edge.changes, [_name(f"{letter}{i}") for i in range(count)])
    return found


def _name(name: str) -> ast.expr:
    return ast.Name(name, ast.Load())


def _fill(definition: ast.FunctionDef, places: Sequence[int], whole: list[ast.expr]) -> None:
    """Put a routine's results in their places among others."""
    last = definition.body[-1]
    assert isinstance(last, ast.Return) and isinstance(last.value, ast.Tuple)
    for place, value in zip(places, last.value.elts, strict=True):
        whole[place] = value
    last.value.elts = whole


def _names_a_parameter(part: ast.stmt) -> bool:
    return isinstance(part, ast.Assign) and isinstance(part.value, ast.Subscript)


def data_names(program: Program) -> list[str]:
    """Names of the numbers that a mode is bound to: parameters, lines of segments of inputs, switches, contacts."""
    names = [f"p{i}" for i in range(len(program.parameters))]
    names += [f"{letter}{i}" for i in range(len(program.inputs)) for letter in "abc"]
    names += [f"k{i}" for i in range(len(program.switches))]
    return names + [f"d{i}" for i in range(program.contact_count)]


def parameters_in(*nodes: ast.AST) -> set[int]:
    """The numbers of the parameters that parts of routines name."""
    names = [node.id for part in nodes for node in ast.walk(part) if isinstance(node, ast.Name)]
    return {int(name[1:]) for name in names if name[0] == "p" and name[1:].isdigit()}
