# pyright: basic
# pyright: basic, reportArgumentType=false, reportAttributeAccessIssue=false, reportOperatorIssue=false, reportCallIssue=false
"""Surfaces, rates, domains and guards of a model with the values of its parameters, and questions about them.

Sampled inputs are names that take any value between their least and their largest, at any time. Parameters have the
values of the file; `--set` has no effect. A `Proof` puts together questions that were answered `never`; points and
bounds of a search are written as people read them.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cached_property
from typing import Any

import sympy as sp

from hsdsl.base.errors import Decided
from hsdsl.base.functions import absolute, maximum, minimum, replaced
from hsdsl.language.expression.algebra import derivative, lie_derivative
from hsdsl.language.expression.scope import symbol
from hsdsl.language.system import TIME, Edge, HybridSystem, Mode, SampledInput, Surface
from hsdsl.mathematics.decisions.decide import MOST_PARTS, Decider
from hsdsl.mathematics.decisions.polynomial import linear_in
from hsdsl.mathematics.decisions.search import (
    UNKNOWN,
    Answer,
    Constraint,
    Ranges,
    SearchRange,
    at_most_zero,
    at_point,
    enclosure,
    parts_of,
    too_large,
    zero,
)

MOST_DERIVED = 4000  # parts of an expression as a tree: derivatives are made of it as one
MOST_COMPARISONS = 6  # of an `if`: its normal form can double with each
_LARGEST = Fraction(10) ** 100  # of values that are looked for: beyond, products overflow
Clause = tuple[Constraint, ...]


class Dynamics:
    """A hybrid system with numbers for its parameters, and a decider of questions about it."""

    def __init__(self, system: HybridSystem) -> None:
        self.system = system
        self.modes = {mode.name: mode for mode in system.modes}
        self.decider = Decider()
        self.remembered = self.decider.remembered
        self._values = system.parameter_values(lambda value, earlier: replaced(value, earlier, {}))
        self._done: dict[Any, Any] = {}

    def placed(self, expr: Any) -> Any:
        """An expression with the parameters' values."""
        return replaced(expr if isinstance(expr, sp.Basic) else sp.sympify(expr), self._values, self._done)

    def residual(self, surface: Surface) -> Any:
        """The surface function r."""
        return self.placed(surface.residual)

    def flow(self, mode: Mode) -> dict[Any, Any]:
        """The derivative of each state, by symbol."""
        return {s: self.placed(f) for s, f in mode.vector_field.items()}

    def rate(self, mode: Mode, expr: Any | None) -> Any | None:
        """L_f of an expression; None where it is too large, or follows an input that is interpolated."""
        return self.remembered(("rate", mode.name, expr), lambda: self.along(expr, self.flow(mode)))

    def along(self, expr: Any | None, flow: Mapping[Any, Any]) -> Any | None:
        """The derivative of an expression along a flow; None where that is not known."""
        if expr is None or parts_of(expr) > MOST_DERIVED or too_large([expr], MOST_PARTS):
            return None
        return None if expr.free_symbols & self._moving else lie_derivative(expr, flow)

    def gradient(self, mode: Mode, expr: Any) -> list[Any] | None:
        """The derivatives of an expression by time and the mode's states; None where it is too large."""
        if too_large([expr], MOST_PARTS):
            return None
        present = expr.free_symbols
        return [derivative(expr, s) if s in present else sp.S.Zero for s in (TIME, *map(symbol, mode.states))]

    def domain(self, mode: Mode, without: Edge | None = None) -> Clause:
        """Where a mode's states belong (M1): every edge without `if`, and every wall."""
        surfaces = (surface for surface, edge in bounding(mode) if edge is None or edge is not without)
        return tuple(at_most_zero(self.residual(surface)) for surface in surfaces)

    def condition(self, edge: Edge, holds: bool = True) -> list[Clause] | None:
        """An `if`, or its contrary, as alternatives: each a list of constraints that hold together.

        One empty alternative is always true; no alternative is never; None is not known, for one of many comparisons.
        """
        if edge.condition is None:
            return [()] if holds else []
        placed = self.placed(edge.condition)
        placed = placed if holds else sp.Not(placed)
        if len(placed.atoms(sp.core.relational.Relational)) > MOST_COMPARISONS:
            return None
        return alternatives(placed)

    def guard(self, edge: Edge, pointing_out: bool = True) -> list[Clause] | None:
        """The guard (M2) as alternatives: on the surface, in the domain, `if` holds, the flow does not point back.

        None where the `if` is not understood.
        """
        mode = self.modes[edge.source]
        residual = self.residual(edge.surface)
        rate = self.rate(mode, residual) if pointing_out else None
        outward = () if rate is None else (at_most_zero(-rate),)
        base = (zero(residual), *self.domain(mode, without=edge), *outward)
        conditions = self.condition(edge)
        return None if conditions is None else [(*base, *clause) for clause in conditions]

    def carried(self, expr: Any, edge: Edge) -> Any:
        """An expression of the target's states, in the states before the reset (M7)."""
        moves = self.remembered(("moves", edge.source, edge.name), lambda: self._moves(edge))
        return replaced(expr, moves, {}) if expr.free_symbols & moves.keys() else expr

    def _moves(self, edge: Edge) -> dict[Any, Any]:
        moves = {symbol(s): self.placed(r) for s, r in edge.values.items()}
        return {s: r for s, r in moves.items() if s != r}

    def value(self, expr: Any, point: Mapping[Any, float]) -> float:
        """An expression at a point of all its names; NaN where it has no real value."""
        return at_point(expr, point)

    @cached_property
    def incoming(self) -> dict[str, list[Edge]]:
        """The edges that lead to each mode."""
        edges = self.system.edges
        return {name: [edge for edge in edges if edge.target == name] for name in self.modes}

    @cached_property
    def starting_point(self) -> dict[Any, float]:
        """Where the run starts: states, inputs and time."""
        mode = self.modes[self.system.initial.mode]
        states = {symbol(name): float(value) for name, value in self.start.items()}
        return {s: r.typical for s, r in self.ranges(mode).items()} | states | {TIME: 0.0}

    def ask(self, mode: Mode, constraints: Iterable[Constraint], prove: bool = False) -> Answer:
        """Whether there is a point of a mode's states, inputs and time where all constraints hold."""
        return self.decider.decide(tuple(dict.fromkeys(constraints)), self.ranges(mode), prove)

    def ask_any(
        self, mode: Mode, alternatives: Sequence[Clause] | None, *more: Constraint, prove: bool = False
    ) -> Answer:
        """The same for alternatives: the first point found; `never` where none has one."""
        if alternatives is None:
            return UNKNOWN
        answers: list[Answer] = []
        for clause in alternatives:
            answer = self.ask(mode, (*clause, *more), prove)
            if answer.somewhere:
                return answer
            answers.append(answer)
        unknown = [a for a in answers if a.verdict == "unknown"]
        weakest = [a for a in answers if a.decided == "interval"]
        return (unknown or weakest or answers or [Answer("never", "symbolic")])[0]

    def vanishes(self, mode: Mode, expr: Any, given: Clause) -> Decided | None:
        """Say how it is known that an expression is zero wherever constraints hold; None where it is not known."""
        return self.decider.vanishes(expr, given, self.ranges(mode))

    def ranges(self, mode: Mode) -> Ranges:
        """What is known of the values of a mode's states, of the sampled inputs and of time."""
        states = ((symbol(s), self._of_state(s)) for s in mode.states)
        return self.remembered(("ranges", mode.states), lambda: {**dict(states), **self._common})

    def _of_state(self, name: str) -> SearchRange:
        typical = float(self.start.get(name, Fraction(1)))
        reach = 10 * max(1.0, abs(typical), min(self._levels.get(name, 0.0), float(_LARGEST)))
        return SearchRange(None, None, (-reach, reach), typical)

    @cached_property
    def start(self) -> dict[str, Fraction]:
        """The initial values, to thirty digits."""
        return {name: _middle(self.placed(value)) for name, value in self.system.initial.values}

    @cached_property
    def until(self) -> Fraction:
        """The end of the experiment."""
        return _middle(self.placed(self.system.experiment.until))

    @cached_property
    def _levels(self) -> dict[str, float]:
        """The largest level of each state in a surface, or a branch of one, that is of it alone."""
        found: dict[str, float] = {}
        for p in map(self.decider.normal_forms.of, self._branches()):
            for name in p.names if len(p.names) == 1 else ():
                coefficient = linear_in(p, name)
                level = abs(p.terms.get((), Fraction(0)) / coefficient) if coefficient else Fraction(0)
                found[name.name] = max(found.get(name.name, 0.0), float(min(level, _LARGEST)))
        return found

    def _branches(self) -> Iterator[Any]:
        """The surfaces of all modes, and what they take `min`, `max` and `abs` of."""
        for mode in self.system.modes:
            for surface in (*(edge.surface for edge in mode.edges), *mode.walls):
                residual = self.residual(surface)
                yield residual
                for kinked in residual.atoms(absolute, maximum, minimum):
                    yield from kinked.args

    @cached_property
    def _common(self) -> Ranges:
        inputs = {symbol(given.name): self._of_input(given) for given in self.system.inputs}
        end = max(self.until, Fraction(0))
        return {**inputs, TIME: SearchRange(Fraction(0), end, (0.0, float(end)), 0.0)}

    def _of_input(self, given: SampledInput) -> SearchRange:
        values = [v if isinstance(v, Fraction) else _middle(self.placed(v)) for v in given.values]
        low, high = min(values), max(values)
        return SearchRange(low, high, (float(low), float(high)), float(values[0]))

    @cached_property
    def inputs(self) -> frozenset[Any]:
        """The sampled inputs."""
        return frozenset(symbol(given.name) for given in self.system.inputs)

    @cached_property
    def timed(self) -> frozenset[Any]:
        """Time and the sampled inputs: jumps and kinks of what depends on these alone are at known times."""
        return self.inputs | {TIME}

    @cached_property
    def held(self) -> frozenset[Any]:
        """The inputs that jump at their samples."""
        return frozenset(symbol(given.name) for given in self.system.inputs if given.jump_times)

    @cached_property
    def _moving(self) -> frozenset[Any]:
        """The inputs that are interpolated between samples: what depends on them has a rate of its own."""
        return frozenset(symbol(given.name) for given in self.system.inputs if given.hold == "linear")


def alternatives(condition: Any) -> list[Clause]:
    """A condition as alternatives: each a list of constraints that hold together."""
    found: list[Clause] = []
    for clause in sp.Or.make_args(sp.to_dnf(condition, simplify=False)):
        literals = sp.And.make_args(clause)
        if sp.false not in literals:
            known = (literal for literal in literals if literal != sp.true and not isinstance(literal, sp.Ne))
            found.append(tuple(map(_constraint, known)))
    return found


def _constraint(literal: Any) -> Constraint:
    if isinstance(literal, sp.Eq):
        return zero(literal.lhs - literal.rhs)
    return Constraint(literal.lts - literal.gts, "< 0" if literal.rel_op in "<>" else "<= 0")


def bounding(mode: Mode) -> Iterator[tuple[Surface, Edge | None]]:
    """The surfaces that bound a mode, with their edges: those without `if`, and walls."""
    yield from ((edge.surface, edge) for edge in mode.edges if edge.condition is None)
    yield from ((wall, None) for wall in mode.walls)


def _middle(expr: Any) -> Fraction:
    low, high = enclosure(expr) or (Fraction(0), Fraction(0))
    return min(max((low + high) / 2, -_LARGEST), _LARGEST)


@dataclass
class Proof:
    """What is known to have no point in a mode, by the answers found; where ``timed``, within the run's time alone."""

    dynamics: Dynamics
    mode: Mode
    found: list[Answer] = field(default_factory=list[Answer])
    timed: bool = False

    def never(self, alternatives: Sequence[Clause], *more: Constraint) -> bool:
        """Whether there is no point where one of the alternatives and more constraints hold."""
        answers: list[Answer] = []
        for clause in alternatives:
            answers.append(self.dynamics.ask(self.mode, (*clause, *more), prove=True))
            if not answers[-1].never:
                return False
        self.found += answers
        self.timed |= any(TIME in c.expr.free_symbols for clause in (*alternatives, more) for c in clause)
        return True

    @property
    def decided(self) -> Decided:
        """How it is known."""
        return "interval" if any(answer.decided == "interval" for answer in self.found) else "symbolic"

    @property
    def searched(self) -> tuple[tuple[Any, float, float], ...]:
        """The bounds that all of it holds within: what was examined in every question."""
        ends: dict[Any, tuple[float, float]] = {}
        for answer in self.found:
            for name, low, high in answer.searched:
                first, last = ends.get(name, (low, high))
                ends[name] = max(first, low), min(last, high)
        if self.timed:
            ends[TIME] = float("-inf"), float(self.dynamics.until)
        return tuple((name, *limits) for name, limits in ends.items())


def closed(clause: Iterable[Constraint]) -> Clause:
    """Constraints with their ends: where one is at its end, round-off decides."""
    return tuple(c._replace(relation="<= 0") if c.relation == "< 0" else c for c in clause)


def strict(clause: Iterable[Constraint]) -> Clause:
    """Inequalities without their ends, where they are more than numbers."""
    return tuple(c._replace(relation="< 0") if c.relation == "<= 0" and not c.expr.is_number else c for c in clause)


MOST_NAMES = 8


def at(dynamics: Dynamics, mode: Mode, answer: Answer, about: Iterable[Any]) -> str:
    """``at x = 14, v = 0``: the states of a point that expressions depend on; time and inputs where they do."""
    needed = {s for expr in about if expr is not None for s in expr.free_symbols}
    order = [s for s in dynamics.ranges(mode) if s in needed]
    parts = [f"{s.name} = {number(answer.point[s])}" for s in order if s in answer.point and s is not TIME]
    parts = [*parts[:MOST_NAMES], *(["..."] if len(parts) > MOST_NAMES else [])]
    if TIME in order:
        parts.append(f"t = {number(answer.point[TIME])}")
    return f"at {', '.join(parts)}" if parts else "everywhere"


def number(value: float) -> str:
    """Six digits; what is within round-off of a shorter number as that."""
    return "0" if abs(value) < 1e-12 else f"{value:.6g}"


def within(searched: Iterable[tuple[Any, float, float]]) -> str:
    """Say within which bounds something is known, as `` within |x| <= 10``; empty where it holds without bounds."""
    limits = ", ".join(_limits(s.name, low, high) for s, low, high in searched)
    return f" within {limits}" if limits else ""


def _limits(name: str, low: float, high: float) -> str:
    if low == -high:
        return f"|{name}| <= {number(high)}"
    if math.isinf(low):
        return f"{name} <= {number(high)}"
    return f"{name} >= {number(low)}" if math.isinf(high) else f"{number(low)} <= {name} <= {number(high)}"
