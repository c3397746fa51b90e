# pyright: basic, reportArgumentType=false, reportAttributeAccessIssue=false, reportOperatorIssue=false, reportAssignmentType=false, reportIncompatibleMethodOverride=false, reportCallIssue=false, reportOptionalMemberAccess=false
"""The hybrid quotient space of a model (Def. 12), in numbers: domains, guards and resets from the mathematics.

Guards are the exit part: where the surface is zero, `if` holds and the flow does not point back (L_f r >= 0, where no
input and no time is in it). What is affine is recognised exactly, by constant derivatives at these parameter values.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

import sympy as sp

from hsdsl.analysis.metrics.formulas import Formula, affine, stacked
from hsdsl.analysis.metrics.geometry import CurvedGate, Domain, Gate, Space
from hsdsl.analysis.metrics.polyhedra import gate_of, unit_rows
from hsdsl.analysis.metrics.rational import matrix
from hsdsl.analysis.metrics.space.expressions import affine as as_affine
from hsdsl.analysis.metrics.space.expressions import clauses, equations, formula
from hsdsl.base import functions
from hsdsl.base.errors import UsageError
from hsdsl.language.expression.algebra import lie_derivative
from hsdsl.language.expression.scope import symbol
from hsdsl.language.expression.timebox import deep_stack
from hsdsl.language.system import TIME, Edge, HybridSystem, Mode

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
