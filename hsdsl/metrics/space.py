# SymPy's types are wider than what it takes and returns.
# pyright: basic, reportArgumentType=false, reportAttributeAccessIssue=false, reportOperatorIssue=false, reportAssignmentType=false, reportIncompatibleMethodOverride=false, reportCallIssue=false, reportOptionalMemberAccess=false
"""The hybrid quotient space of a model (Def. 12), in numbers: domains, guards and resets from the mathematics.

Guards are the exit part: where the surface is zero, `if` holds and the flow does not point back (L_f r >= 0, where no
input and no time is in it). What is affine is recognised exactly, by constant derivatives at these parameter values.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np
import sympy as sp

from hsdsl import functions
from hsdsl.arithmetic import DOMAIN_ERRORS, FLOAT64
from hsdsl.backends.python import compile_routines
from hsdsl.errors import UsageError
from hsdsl.expression.stack import deep_stack
from hsdsl.lower.routines import Definition, print_routines
from hsdsl.metrics.geometry import CurvedGate, Domain, Gate, Space
from hsdsl.metrics.polyhedra import pieces_of
from hsdsl.system import TIME, Edge, HybridSystem, Mode

__all__ = ["Space", "make_space"]

MOST_SAMPLES = 200  # of an input that a guard depends on


def make_space(system: HybridSystem, parameters: Sequence[float]) -> Space:
    """Make a model's space at given parameter values.

    Parameters
    ----------
    system : HybridSystem
        The model.
    parameters : sequence of float
        A value for each parameter, in file order.

    Raises
    ------
    UsageError
        A final mode is entered with different states, or a guard depends on an input of too many samples.
    """
    with deep_stack():
        return _Maker(system, parameters).space()


@dataclass(frozen=True)
class _Affine:
    """``gradient @ x + constant``."""

    gradient: np.ndarray
    constant: float


class _Maker:
    """One model at one set of parameter values."""

    def __init__(self, system: HybridSystem, parameters: Sequence[float]) -> None:
        self.system = system
        given = zip(system.parameters, parameters, strict=True)
        self.values = {_symbol(p.name): sp.Rational(*Fraction(float(v)).as_integer_ratio()) for p, v in given}
        self.inputs = {_symbol(i.name): i for i in system.inputs}
        self.timed = any(self._moves(e) for m in system.modes for e in _geometric(m))
        self.states = [self._states_of(mode) for mode in system.modes]
        self.symbols = [tuple(map(_symbol, states)) + (TIME,) * self.timed for states in self.states]

    def space(self) -> Space:
        """Everything, guards in pieces."""
        domains = tuple(self._domain(j, mode) for j, mode in enumerate(self.system.modes))
        gates: list[Gate] = []
        curved: list[CurvedGate] = []
        for j, mode in enumerate(self.system.modes):
            for edge in mode.edges:
                for clause in _clauses(edge.condition):
                    self._guard(j, edge, clause, domains, gates, curved)
        names = tuple(mode.name for mode in self.system.modes)
        return Space(names, domains, tuple(gates), tuple(curved), self._kept(), self.timed)

    def _states_of(self, mode: Mode) -> tuple[str, ...]:
        if mode.states or not mode.final:
            return mode.states
        entered = {e.target_states for m in self.system.modes for e in m.edges if e.target == mode.name}
        if len(entered) > 1:
            raise UsageError(
                f"distances: the final mode {mode.name} is entered with different states, so it is no single domain",
                "give it a flow, or a mode of its own for each",
            )
        if entered:
            return entered.pop()
        return tuple(name for name, _ in self.system.initial.values) if mode.name == self.system.initial.mode else ()

    def _moves(self, expression: sp.Basic) -> bool:
        return bool(expression.free_symbols & {TIME, *self.inputs})

    def _place(self, expression: sp.Expr) -> sp.Expr:
        """Put in parameter values, and an input as a function of time."""
        placed = sp.sympify(expression).xreplace(self.values)
        used = placed.free_symbols & set(self.inputs)
        return placed.xreplace({symbol: self._input(self.inputs[symbol]) for symbol in used})

    def _input(self, given) -> sp.Expr:
        if len(given.times) > MOST_SAMPLES:
            raise UsageError(
                f"distances: a guard depends on the input {given.name}, which has more than {MOST_SAMPLES} samples"
            )
        times, values = (
            [sp.Rational(*v.as_integer_ratio()) if isinstance(v, Fraction) else v.xreplace(self.values) for v in row]
            for row in (given.times, given.values)
        )
        result = values[0]
        for before, after, low, high in zip(times, times[1:], values, values[1:], strict=False):
            if given.hold == "zero":
                result += (high - low) * (1 + functions.sign(TIME - after)) / 2
            else:
                ramp = functions.absolute(TIME - before) - functions.absolute(TIME - after) + after - before
                result += (high - low) / (after - before) * ramp / 2
        return result

    def _domain(self, j: int, mode: Mode) -> Domain:
        surfaces = [e.surface for e in mode.edges if e.condition is None] + list(mode.walls)
        rows, curved, texts, curved_texts = [], [], [], []
        for surface in surfaces:
            residual = self._place(surface.residual)
            row = _affine(residual, self.symbols[j])
            if row is None:
                curved.append(self._scalar(residual, j))
                curved_texts.append(surface.text)
            else:
                rows.append(row)
                texts.append(surface.text)
        coordinates = self.states[j] + ("t",) * self.timed
        normals, levels = _stack(rows, len(coordinates))
        return Domain(mode.name, coordinates, normals, levels, tuple(curved), (*texts, *curved_texts))

    def _guard(self, j: int, edge: Edge, clause, domains, gates: list[Gate], curved: list[CurvedGate]) -> None:
        k = [m.name for m in self.system.modes].index(edge.target)
        surface = self._place(edge.surface.residual)
        conditions = [self._place(c) for c in clause]
        mode = self.system.modes[j]
        rate = surface.diff(TIME) + sum(
            (surface.diff(_symbol(s)) * self._place(f) for s, f in zip(mode.states, mode.flow, strict=True)), sp.S.Zero
        )
        raw = edge.surface.residual.diff(TIME) + sum(
            (edge.surface.residual.diff(_symbol(s)) * f for s, f in zip(mode.states, mode.flow, strict=True)), sp.S.Zero
        )
        if not self._moves(sp.sympify(raw)):
            conditions.append(-sp.sympify(rate))
        reset = [self._place(r) for r in edge.reset] + [TIME] * self.timed
        flat = [_affine(e, self.symbols[j]) for e in (surface, *reset)]
        if any(f is None for f in flat):
            both = (*domains[j].curved, *(self._scalar(c, j) for c in conditions), *_flat_conditions(domains[j]))
            curved.append(CurvedGate(edge.name, j, k, self._scalar(surface, j), both, self._vector(reset, j)))
            return
        rows = [(c, _affine(c, self.symbols[j])) for c in conditions]
        normals, levels = _stack([r for _, r in rows if r is not None], len(self.symbols[j]))
        bent = (*domains[j].curved, *(self._scalar(c, j) for c, r in rows if r is None))
        linear = np.array([f.gradient for f in flat[1:]]).reshape(len(reset), len(self.symbols[j]))
        gates += pieces_of(
            edge.name, (j, domains[j]), (k, domains[k]), (flat[0].gradient, -flat[0].constant),
            (np.vstack([domains[j].normals, normals]), np.concatenate([domains[j].levels, levels])),
            (linear, np.array([f.constant for f in flat[1:]])), bent,
        )  # fmt: skip

    def _kept(self) -> tuple[tuple[int, ...], ...] | None:
        common = [n for n in self.states[0] if all(n in states for states in self.states)]
        for mode in self.system.modes:
            for edge in mode.edges:
                reset = dict(zip(edge.target_states, edge.reset, strict=True))
                common = [n for n in common if self._unchanged(edge, reset[n], n)]
        common += ["t"] * self.timed
        names = [states + ("t",) * self.timed for states in self.states]
        return tuple(tuple(own.index(n) for n in common) for own in names) if common else None

    def _unchanged(self, edge: Edge, value: sp.Expr, name: str) -> bool:
        """Whether a reset leaves a state alone, if only because the guard fixes it."""
        change = sp.expand(self._place(value) - _symbol(name))
        if change == 0:
            return True
        surface = sp.expand(self._place(edge.surface.residual))
        return bool(surface.free_symbols) and sp.cancel(change / surface).is_number

    def _scalar(self, expression: sp.Expr, j: int):
        function = self._compiled((expression,), j)
        return lambda x: float(function(x)[0])

    def _vector(self, expressions, j: int):
        function = self._compiled(tuple(expressions), j)
        return lambda x: np.array(function(x), dtype=float)

    def _compiled(self, expressions, j: int):
        """Compile over numbered coordinates; NaN outside the expressions' real domain."""
        numbered = [_symbol(f"x{i}") for i in range(len(self.symbols[j]))]
        mapping = dict(zip(self.symbols[j], numbered, strict=True))
        results = tuple(sp.sympify(e).xreplace(mapping) for e in expressions)
        routine = compile_routines(
            print_routines([Definition("value", tuple(numbered), results)], ()), FLOAT64, "geometry"
        )()[0]

        def evaluate(x):
            try:
                return routine(*map(float, x))
            except DOMAIN_ERRORS:
                return (np.nan,) * len(results)

        return evaluate


def _symbol(name: str) -> sp.Symbol:
    return sp.Symbol(name, real=True)


def _geometric(mode: Mode):
    """Every expression that shapes the space."""
    yield from (wall.residual for wall in mode.walls)
    for edge in mode.edges:
        yield edge.surface.residual
        yield from (sp.sympify(r) for r in edge.reset)
        if edge.condition is not None:
            yield edge.condition


def _affine(expression: sp.Expr, symbols) -> _Affine | None:
    """The expression as an affine function, None where it is none."""
    expression = sp.expand(expression)
    own = set(symbols)
    if any(f.free_symbols & own for f in expression.atoms(functions.sign, functions.floor, sp.sign, sp.floor)):
        return None
    gradient = [sp.expand(expression.diff(s)) for s in symbols]
    if any(g.free_symbols & own for g in gradient):
        return None
    constant = expression.xreplace(dict.fromkeys(symbols, sp.S.Zero))
    numbers = np.array([float(sp.N(v, 20)) for v in (*gradient, constant)])
    return _Affine(numbers[:-1], float(numbers[-1])) if np.all(np.isfinite(numbers)) else None


def _stack(rows: list[_Affine], size: int) -> tuple[np.ndarray, np.ndarray]:
    normals = np.array([r.gradient for r in rows]).reshape(len(rows), size)
    return normals, np.array([-r.constant for r in rows])


def _flat_conditions(domain: Domain):
    return tuple((lambda x, n=n, c=c: float(n @ x - c)) for n, c in zip(domain.normals, domain.levels, strict=True))


def _clauses(condition) -> list[list[sp.Expr]]:
    """A condition as alternatives, each a list of expressions that are at most 0 (closed: strict counts as not)."""
    if condition is None:
        return [[]]
    normal = sp.to_dnf(condition, simplify=False)
    if normal == sp.true:
        return [[]]
    if normal == sp.false:
        return []
    return [
        [e for literal in sp.And.make_args(clause) for e in _literal(literal)] for clause in sp.Or.make_args(normal)
    ]


def _literal(literal) -> list[sp.Expr]:
    if isinstance(literal, sp.Not):
        literal = literal.args[0].negated
    if literal == sp.true or isinstance(literal, sp.Ne):
        return []
    if isinstance(literal, (sp.Ge, sp.Gt)):
        return [literal.rhs - literal.lhs]
    if isinstance(literal, (sp.Le, sp.Lt)):
        return [literal.lhs - literal.rhs]
    if isinstance(literal, sp.Eq):
        return [literal.lhs - literal.rhs, literal.rhs - literal.lhs]
    raise UsageError(f"distances: the condition {literal} is no comparison of numbers")
