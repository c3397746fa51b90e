# pyright: basic, reportArgumentType=false, reportAttributeAccessIssue=false, reportOperatorIssue=false, reportCallIssue=false
"""A model's mathematics as functions for another tool, and the loop around one that stops at its events.

States are symbols there and parameters numbers. The loop resets, changes the mode and goes on.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from fractions import Fraction
from typing import Any, NamedTuple

import numpy as np
import sympy as sp

from hsdsl.base.numbers.arithmetic import FLOAT64, TIE
from hsdsl.interface.chart.scene import Array, Refused, Result, Scene
from hsdsl.language.system import TIME, Edge, Mode
from hsdsl.mathematics.lower.printer import KernelPrinter


class PlainEdge(NamedTuple):
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
        return self.condition != sp.true


class PlainMode(NamedTuple):
    """A mode over the symbols ``x0, x1, ...`` and ``t``, numbers instead of parameters."""

    name: str
    states: tuple[str, ...]
    symbols: tuple[sp.Symbol, ...]
    flow: tuple[sp.Expr, ...]
    edges: tuple[PlainEdge, ...]
    final: bool


class PlainModel(NamedTuple):
    """A scene's model for another tool: no sampled inputs; walls are left out, for no tool knows them."""

    modes: tuple[PlainMode, ...]
    start: int
    x: tuple[float, ...]

    @property
    def conditional(self) -> bool:
        return any(edge.conditional for mode in self.modes for edge in mode.edges)


T = sp.Symbol("t", real=True)


def translate(scene: Scene) -> PlainModel:
    """Put numbers in for parameters and numbered symbols for states.

    Raises Refused: the model has sampled inputs.
    """
    system = scene.model.system
    if any(hasattr(signal, "times") for signal in system.inputs):
        raise Refused("sampled inputs are not translated")
    values = scene.model.pipeline.values(parameters=scene.parameters).parameters
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

    def written(self, value: Fraction) -> str:
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


MOST_SECONDS = 60.0


class ToolArc(NamedTuple):
    """An arc by a tool: its end, the event that ended it (None: the end of the run), and values at the samples."""

    end: float
    x: Sequence[float]
    edge: int | None
    values: Array


Integrate = Callable[[float, int, float, Sequence[float], Array, float], ToolArc]
"""``integrate(tolerance, mode, t, x, times, until)``: from t to the first event or ``until``, sampled at ``times``."""


def by_arcs(scene: Scene, model: PlainModel, integrate: Integrate) -> Callable[[float], Result]:
    """Make ``run(tolerance)``: one arc after the other, until the scene's end or a final mode."""
    choices = [[_alternatives(mode, edge.guard) for edge in mode.edges] for mode in model.modes]
    resets = [[as_function(mode, edge.reset) for edge in mode.edges] for mode in model.modes]
    places = [
        [(i, mode.states.index(name)) for i, name in enumerate(scene.states) if name in mode.states]
        for mode in model.modes
    ]
    flows = [as_function(mode, mode.flow) for mode in model.modes]
    grid, until = scene.grid, float(scene.grid[-1])
    tie = TIE * max(abs(float(grid[0])), abs(until))
    most = 10 * len(scene.exact.transitions) + 100

    def run(tolerance: float) -> Result:
        values = np.full((len(grid), len(scene.states)), np.nan)
        passed: list[tuple[int, int]] = []  # where each arc's samples end, and its mode
        t, x, k, first, count = float(grid[0]), model.x, model.start, 0, 0
        began = time.perf_counter()
        problem, passed_by = None, 0
        while True:
            mode, begin = model.modes[k], t
            arc = integrate(tolerance, k, t, x, grid[first:], until)
            last = first + len(arc.values)
            for i, j in places[k]:
                values[first:last, i] = arc.values[:, j]
            passed.append((last, k))
            first, t = last, arc.end
            if arc.edge is None:
                break
            taken = next((i for i, holds in choices[k][arc.edge] if holds(t, *arc.x)[0]), None)
            if taken is None:
                passed_by = passed_by + 1 if t <= begin else 0
                if passed_by > len(mode.edges):
                    problem = f"stays at t = {t:.6g}, at a guard whose conditions do not hold"
                    break
                # A point just beyond a surface that is passed, where the tool does not find it again
                nudge = min(tie, until - t)
                x = [float(value) + nudge * rate for value, rate in zip(arc.x, flows[k](t, *arc.x), strict=True)]
                t += nudge
                if t >= until:
                    break
                continue
            count += 1
            x = resets[k][taken](t, *arc.x)
            k = mode.edges[taken].target
            if model.modes[k].final or t >= until:
                break
            if count > most or time.perf_counter() - began > MOST_SECONDS:
                problem = f"gave up at t = {t:.6g} after {count} transitions"
                break
        return Result(values, lambda: _modes(passed, model, len(grid)), lambda: count, problem)

    return run


Choice = tuple[int, Callable[..., tuple[bool]]]


def _alternatives(mode: PlainMode, guard: object) -> list[Choice]:
    """The edges with the same guard, in the order of the file, and their conditions."""
    edges = [i for i, edge in enumerate(mode.edges) if edge.guard == guard]
    return [(i, as_function(mode, (mode.edges[i].condition,))) for i in edges]


def _modes(passed: Sequence[tuple[int, int]], model: PlainModel, samples: int) -> Array:
    modes, first = np.full(samples, "", dtype=object), 0
    for last, k in passed:
        modes[first:last] = model.modes[k].name
        first = last
    return modes
