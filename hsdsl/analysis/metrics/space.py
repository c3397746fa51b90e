# pyright: basic, reportArgumentType=false, reportAttributeAccessIssue=false, reportOperatorIssue=false, reportAssignmentType=false, reportIncompatibleMethodOverride=false, reportCallIssue=false, reportOptionalMemberAccess=false
"""The hybrid quotient space of a model (Def. 12), in numbers: domains, guards and resets from the mathematics.

Guards are the exit part: where the surface is zero, `if` holds and the flow does not point back (L_f r >= 0, where no
input and no time is in it). What is affine is recognised exactly, by constant derivatives at these parameter values;
the rest becomes compiled formulas.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

import numpy as np
import sympy as sp

from hsdsl.analysis.metrics.geometry import (
    CurvedGate,
    Domain,
    Formula,
    Gate,
    Space,
    affine,
    compiled,
    gate_of,
    stacked,
    unit_rows,
)
from hsdsl.base import functions
from hsdsl.base.errors import UsageError
from hsdsl.base.numbers.rational import Exact, matrix
from hsdsl.language.expression.algebra import lie_derivative
from hsdsl.language.expression.scope import symbol
from hsdsl.language.expression.timebox import deep_stack
from hsdsl.language.system import TIME, Edge, HybridSystem, Mode
from hsdsl.mathematics.decisions.dynamics import alternatives
from hsdsl.mathematics.lower.straight import Definition, Gradient, print_routines

MOST_SAMPLES = 200  # of an input that a guard depends on


def make_space(system: HybridSystem, parameters: Sequence[float]) -> Space:
    """Make a model's space at given parameter values, in file order.

    Raises :class:`UsageError` for a final mode entered with different states and for an input of too many samples.
    """
    with deep_stack():
        return _Maker(system, parameters).space()


class _Maker:
    """One model at one set of parameter values."""

    def __init__(self, system: HybridSystem, parameters: Sequence[float]) -> None:
        self.system = system
        given = zip(system.parameters, parameters, strict=True)
        self.values = {symbol(p.name): sp.Rational(*Fraction(float(v)).as_integer_ratio()) for p, v in given}
        self.inputs = {symbol(i.name): i for i in system.inputs}
        self.timed = any(self._moves(e) for m in system.modes for e in _geometric(m))
        self.states = [self._states_of(mode) for mode in system.modes]
        self.symbols = [tuple(map(symbol, states)) + (TIME,) * self.timed for states in self.states]

    def space(self) -> Space:
        """Everything, guards in pieces."""
        domains = tuple(self._domain(j, mode) for j, mode in enumerate(self.system.modes))
        gates: list[Gate] = []
        curved: list[CurvedGate] = []
        for j, mode in enumerate(self.system.modes):
            for edge in mode.edges:
                for clause in clauses(edge.condition):
                    self._guard(j, edge, clause, domains, gates, curved)
        names = tuple(mode.name for mode in self.system.modes)
        return Space(names, domains, tuple(gates), tuple(curved), self._kept(), self.timed)

    def _states_of(self, mode: Mode) -> tuple[str, ...]:
        if mode.states or not mode.final:
            return mode.states
        entered = {e.target_states for e in self.system.edges if e.target == mode.name}
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
        return placed.xreplace({name: self._input(self.inputs[name]) for name in used})

    def _input(self, given) -> sp.Expr:
        if len(given.times) > MOST_SAMPLES:
            raise UsageError(
                f"distances: a guard depends on the input {given.name}, which has more than {MOST_SAMPLES} samples"
            )
        times, values = (
            [sp.Rational(v) if isinstance(v, Fraction) else v.xreplace(self.values) for v in row]
            for row in (given.times, given.values)
        )
        result = values[0]
        for before, after, low, high in zip(times, times[1:], values, values[1:], strict=False):
            if given.hold == "zero" or before == after:
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
            row = as_affine(residual, self.symbols[j])
            if row is None:
                curved.append(self._formula((residual,), j))
                curved_texts.append(surface.text)
            else:
                rows.append(row)
                texts.append(surface.text)
        coordinates = self.states[j] + ("t",) * self.timed
        rows = matrix(rows, 1 + len(coordinates))
        return Domain(mode.name, coordinates, *unit_rows(rows), tuple(curved), (*texts, *curved_texts), rows)

    def _guard(self, j: int, edge: Edge, clause, domains, gates: list[Gate], curved: list[CurvedGate]) -> None:
        k = [m.name for m in self.system.modes].index(edge.target)
        surface = self._place(edge.surface.residual)
        conditions = [self._place(c) for c in clause]
        if (rate := self._rate(edge, surface, self.system.modes[j])) is not None:
            conditions.append(-rate)
        reset = [self._place(r) for r in edge.reset] + [TIME] * self.timed
        flat = [as_affine(e, self.symbols[j]) for e in (surface, *reset)]
        if any(f is None for f in flat):
            domain = domains[j]
            flat_part = affine(domain.normals, -domain.levels)
            both = stacked([*domain.curved, self._formula(conditions, j), flat_part])
            image = [*map(symbol, edge.target_states), *(TIME,) * self.timed]
            marks = equations(surface, reset, self.symbols[j], image)
            made = self._formula((surface,), j), both, self._formula(reset, j), formula(marks, self.symbols[k])
            curved.append(CurvedGate(edge.name, j, k, *made))
            return
        rows = [(c, as_affine(c, self.symbols[j])) for c in conditions]
        bent = (*domains[j].curved, *(self._formula((c,), j) for c, r in rows if r is None))
        width = 1 + len(self.symbols[j])
        inequalities = matrix([*domains[j].rows, *(r for _, r in rows if r is not None)], width)
        gate = gate_of(edge.name, (j, k), flat[0], inequalities, matrix(flat[1:], width), domains[k].rows, bent)
        gates += [] if gate is None else [gate]

    def _rate(self, edge: Edge, surface: sp.Expr, mode: Mode) -> sp.Expr | None:
        """The surface's derivative along the flow; None where time or an input is in it."""
        rate = lie_derivative(edge.surface.residual, mode.vector_field)
        if self._moves(rate):
            return None
        return self._place(lie_derivative(surface, mode.vector_field) if self._moves(edge.surface.residual) else rate)

    def _kept(self) -> tuple[tuple[int, ...], ...] | None:
        common = [n for n in self.states[0] if all(n in states for states in self.states)]
        for mode in self.system.modes:
            for edge in mode.edges:
                values = edge.values
                common = [n for n in common if self._unchanged(edge, values[n], n)]
        common += ["t"] * self.timed
        names = [states + ("t",) * self.timed for states in self.states]
        return tuple(tuple(own.index(n) for n in common) for own in names) if common else None

    def _unchanged(self, edge: Edge, value: sp.Expr, name: str) -> bool:
        """Whether a reset leaves a state alone, if only because the guard fixes it."""
        change = sp.expand(self._place(value) - symbol(name))
        if change == 0:
            return True
        surface = sp.expand(self._place(edge.surface.residual))
        return bool(surface.free_symbols) and sp.cancel(change / surface).is_number

    def _formula(self, expressions, j: int) -> Formula:
        return formula(expressions, self.symbols[j])


def _geometric(mode: Mode):
    """Every expression that shapes the space."""
    yield from (wall.residual for wall in mode.walls)
    for edge in mode.edges:
        yield edge.surface.residual
        yield from edge.reset
        if edge.condition is not None:
            yield edge.condition


DIGITS = 60  # of a number that is not rational


def as_affine(expression: sp.Expr, symbols) -> Exact | None:
    """The expression as an affine function (its constant, then its slopes), None where it is none."""
    expression = sp.expand(expression)
    own = set(symbols)
    if any(f.free_symbols & own for f in expression.atoms(functions.sign, functions.floor, sp.sign, sp.floor)):
        return None
    gradient = [sp.expand(expression.diff(s)) for s in symbols]
    if any(g.free_symbols & own for g in gradient):
        return None
    constant = expression.xreplace(dict.fromkeys(symbols, sp.S.Zero))
    numbers = [_rational(v) for v in (constant, *gradient)]
    return None if None in numbers else np.array(numbers, dtype=object)


def _rational(value: sp.Expr) -> Fraction | None:
    if not value.is_Rational:
        value = sp.N(value, DIGITS)
        if not (value.is_Float and value.is_finite):
            return None
        value = sp.Rational(value)
    return Fraction(int(value.p), int(value.q))


def clauses(condition) -> list[list[sp.Expr]]:
    """A condition as alternatives, each a list of expressions that are at most 0 (closed: strict counts as not)."""
    found = [()] if condition is None else alternatives(condition)
    return [[e for c in clause for e in (c.expr, -c.expr)[: 1 + (c.relation == "= 0")]] for clause in found]


def formula(expressions, coordinates) -> Formula:
    """Compile expressions of some coordinates, with their derivatives."""
    numbered = [sp.Symbol(f"x{i}", real=True) for i in range(len(coordinates))]
    mapping = dict(zip(coordinates, numbered, strict=True))
    results = tuple(sp.sympify(e).xreplace(mapping) for e in expressions)
    slopes = Gradient(results, numbered)
    rows = tuple(entry for row in slopes.rows for entry in row)
    definitions = [
        Definition("value", tuple(numbered), results),
        Definition("jacobian", tuple(numbered), rows, slopes.statements),
    ]
    jumps = any(
        f.free_symbols & set(numbered)
        for e in results
        for f in e.atoms(functions.sign, functions.floor, sp.sign, sp.floor)
    )
    return compiled(print_routines(definitions, ()), (len(results), len(numbered)), jumps)


def equations(surface: sp.Expr, reset: Sequence[sp.Expr], own: Sequence[sp.Symbol], image: Sequence[sp.Symbol]):
    """Expressions of the image's coordinates that are 0 on it; none where the reset hides too much.

    A coordinate that the reset hands on, scaled or shifted, is known from the image; so is what is made of such ones.
    """
    known: dict[sp.Symbol, sp.Expr] = {}
    used: set[sp.Symbol] = set()
    for target, value in zip(image, reset, strict=True):
        symbols = value.free_symbols & set(own)
        if len(symbols) != 1:
            continue
        (source,) = symbols
        slope = sp.expand(value).diff(source)
        if source not in known and slope.is_number and slope != 0:
            known[source] = (_fresh(target) - value.xreplace({source: sp.S.Zero})) / slope
            used.add(target)
    vanishing = [(surface, surface.free_symbols)]
    vanishing += [
        (_fresh(target) - value, value.free_symbols)
        for target, value in zip(image, reset, strict=True)
        if target not in used
    ]
    back = {_fresh(target): target for target in image}
    given = set(known)
    return [
        sp.sympify(expression).xreplace(known).xreplace(back)
        for expression, symbols in vanishing
        if symbols & set(own) <= given
    ]


def _fresh(symbol: sp.Symbol) -> sp.Symbol:
    """The image's coordinate of a name, which the guard's mode may have as well."""
    return sp.Symbol(f"{symbol.name}'", real=True)
