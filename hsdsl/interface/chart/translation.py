# pyright: basic, reportArgumentType=false, reportAttributeAccessIssue=false, reportOperatorIssue=false, reportCallIssue=false
"""A model's mathematics as functions for another tool, with numbers for parameters and symbols for states."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import sympy as sp

from hsdsl.base.numbers.arithmetic import FLOAT64
from hsdsl.engine.preparation.values import with_parameters
from hsdsl.interface.chart.result import Refused
from hsdsl.interface.chart.scene import Scene
from hsdsl.language.system import TIME, Edge, Mode
from hsdsl.mathematics.lower.printer import KernelPrinter


@dataclass(frozen=True)
class PlainEdge:
    """An edge: it fires when ``guard`` rises through zero and ``condition`` holds there.

    ``condition`` is `sympy.true` where there is none; ``reset`` gives the target's states.
    """

    source: int
    target: int
    guard: sp.Expr
    condition: Any
    reset: tuple[sp.Expr, ...]

    @property
    def conditional(self) -> bool:
        """Whether it has an `if`."""
        return self.condition != sp.true


@dataclass(frozen=True)
class PlainMode:
    """A mode over the symbols ``x0, x1, ...`` and ``t``, numbers instead of parameters."""

    name: str
    states: tuple[str, ...]
    symbols: tuple[sp.Symbol, ...]
    flow: tuple[sp.Expr, ...]
    edges: tuple[PlainEdge, ...]
    final: bool


@dataclass(frozen=True)
class PlainModel:
    """A scene's model for another tool: no sampled inputs; walls are left out, for no tool knows them."""

    modes: tuple[PlainMode, ...]
    start: int
    x: tuple[float, ...]

    @property
    def conditional(self) -> bool:
        """Whether any edge has an `if`."""
        return any(edge.conditional for mode in self.modes for edge in mode.edges)


T = sp.Symbol("t", real=True)


def translate(scene: Scene) -> PlainModel:
    """Put numbers in for parameters and numbered symbols for states.

    Raises Refused: the model has sampled inputs.
    """
    system = scene.model.system
    if any(hasattr(signal, "times") for signal in system.inputs):
        raise Refused("sampled inputs are not translated")
    values = with_parameters(scene.model.pipeline.values(FLOAT64), scene.parameters).parameters
    named = zip(system.parameters, values, strict=True)
    numbers = {sp.Symbol(parameter.name, real=True): sp.Float(value, 17) for parameter, value in named}
    index = {mode.name: k for k, mode in enumerate(system.modes)}
    modes = tuple(_mode(mode, index, numbers) for mode in system.modes)
    start = scene.model.simulate(0, initial=scene.initial, parameters=scene.parameters)
    first = start.arcs[0]
    x = tuple(float(v) for v in start.values[0][: len(first.states)])
    return PlainModel(modes, index[first.mode], x)


def _mode(mode: Mode, index: dict[str, int], numbers: dict[sp.Symbol, Any]) -> PlainMode:
    symbols = tuple(sp.Symbol(f"x{i}", real=True) for i in range(len(mode.states)))
    names = dict(zip((sp.Symbol(name, real=True) for name in mode.states), symbols, strict=True))

    def plain(expression: Any) -> sp.Expr:
        return in_floats(sp.sympify(expression).xreplace(names | numbers | {TIME: T}))

    def edge(e: Edge) -> PlainEdge:
        guard, condition = plain(e.surface.residual), plain(sp.true if e.condition is None else e.condition)
        return PlainEdge(index[e.source], index[e.target], guard, condition, tuple(map(plain, e.reset)))

    flow = tuple(map(plain, mode.flow))
    return PlainMode(mode.name, mode.states, symbols, flow, tuple(map(edge, mode.edges)), mode.final)


def in_floats(expression: Any) -> Any:
    """Write constants as floats, except those that are floats anyway (integer exponents, square roots)."""
    constants = [a for a in expression.atoms(sp.Number, sp.NumberSymbol) if not a.is_Integer]
    rounded = {a: sp.Float(a, 17) for a in constants if not (a.is_Rational and a.q & (a.q - 1) == 0)}
    return expression.xreplace(rounded)


Functions = Mapping[str, Any]
"""A tool's own functions by their names in kernels."""


class _Printer(KernelPrinter):
    """The operations of a kernel with numbers as Python writes them, for a tool that has some of the functions."""

    def __init__(self, functions: Functions) -> None:
        super().__init__()
        self.functions = functions

    def constant(self, value: Fraction) -> str:
        number = float(value)
        return f"{number:.0f}" if number.is_integer() and abs(number) < 2**53 else repr(number)

    def call(self, name: str, arguments: list[str]) -> str:
        if name not in self.functions:
            raise Refused(f"`{'select' if name == 'below' else name}` is not translated")
        return super().call(name, arguments)

    def _print_solution(self, expr: Any) -> str:
        raise Refused("`solve` is not translated")


def as_function(
    mode: PlainMode, expressions: tuple[sp.Expr, ...], functions: Functions = FLOAT64.functions
) -> Callable[..., Any]:
    """Return ``f(t, x0, x1, ...) -> tuple``; the symbols are ours, so nothing of the file is ever evaluated.

    Raises Refused: the tool lacks a function of the model.
    """
    return sp.lambdify((T, *mode.symbols), expressions, [dict(functions)], printer=_Printer(functions), cse=True)
