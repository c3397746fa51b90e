# pyright: basic
"""Scenes: shapes, and their numbers in each mode, read as outputs are."""

from __future__ import annotations

from dataclasses import replace

from hsdsl.language.elaborate.modes import output_here, output_scope
from hsdsl.language.elaborate.symbols import SymbolTable
from hsdsl.language.expression.scope import Scope, Value
from hsdsl.language.source import Scalar
from hsdsl.language.system import ZERO, HybridSystem, Shape

Numbers = list[tuple[Scalar | None, Value | None]]  # each with what it means to the whole model; 0 where left out


def elaborate_scene(symbols: SymbolTable, scope: Scope | None = None) -> tuple[tuple[Shape, ...], Numbers]:
    """The shapes of a model, and the numbers of all of them."""
    shapes: list[Shape] = []
    numbers: Numbers = []
    scope = scope or output_scope(symbols)
    for document in symbols.document.scene:
        shapes.append(Shape(document.kind, len(document.points)))
        scalars = [*(scalar for point in document.points for scalar in point), *document.sizes]
        numbers += [(s, None if s is None else symbols.number(s, scope)) for s in scalars]
    return tuple(shapes), numbers


def scene_of(symbols: SymbolTable, numbers: Numbers, scope: Scope) -> tuple:
    """The numbers of a scene in a mode; None for one that it does not have."""
    found = (ZERO if s is None else output_here(symbols, s, value, scope) for s, value in numbers)
    return tuple(value.expr if isinstance(value, Value) else value for value in found)


def scene_as_outputs(system: HybridSystem) -> HybridSystem:
    """The system with the numbers of its scene as further outputs, which a run then records."""
    count = sum(shape.numbers for shape in system.scene)
    modes = tuple(replace(mode, outputs=(*mode.outputs, *mode.scene)) for mode in system.modes)
    outputs = (*system.outputs, *(f"scene {i}" for i in range(count)))  # no name of a model has a blank
    return replace(system, modes=modes, outputs=outputs)
