# pyright: basic
"""Input of a rule: a model as mathematics, with the places of its parts in the file, and its numbers to 200 bits."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from fractions import Fraction
from functools import cached_property
from typing import Any, NamedTuple

import sympy as sp
from sympy.logic.boolalg import BooleanFunction

from hsdsl.analysis.lint.source_expressions import Definition, SourceExpression, unused, written
from hsdsl.analysis.lint.units import Units
from hsdsl.base.defaults import DEFAULTS, least_relaxation
from hsdsl.base.errors import Span
from hsdsl.base.functions import FUNCTIONS
from hsdsl.base.graphs import closure
from hsdsl.language.elaborate import Elaboration
from hsdsl.language.expression import numeric, parse, symbolic
from hsdsl.language.expression.algebra import lie_derivative
from hsdsl.language.expression.parse import Tree
from hsdsl.language.expression.scope import symbol
from hsdsl.language.schema import documents as schema
from hsdsl.language.source import Key, Node, Scalar, descend
from hsdsl.language.system import TIME, Edge, HybridSystem, Mode, SampledInput, Surface
from hsdsl.mathematics.decisions.dynamics import Dynamics


class EdgePart(NamedTuple):
    """A transition as mathematics and as written, its position in its mode, and its path in the file."""

    edge: Edge
    document: schema.TransitionDocument
    index: int
    path: tuple[str | int, ...]

    @property
    def target_span(self) -> Span:
        """Where the mode it leads to is written, or the surface of one that stays."""
        return (self.document.when if self.document.target is None else self.document.to).place.span


class ModePart(NamedTuple):
    """A mode as mathematics and as written; ``key`` is its name in the file, with its place."""

    mode: Mode
    document: schema.ModeDocument
    key: Key
    edges: tuple[EdgePart, ...]


def edge_parts(mode: Mode, key: str, document: schema.ModeDocument) -> tuple[EdgePart, ...]:
    """The transitions of a mode that have a surface: neither events nor those that fire together with others."""
    edges = [edge for edge in mode.edges if not edge.of_event]
    places = [(i, written) for i, written in enumerate(document.transitions) if _has_surface(written)]
    pairs = zip(edges, places, strict=True)
    return tuple(EdgePart(edge, written, i, ("modes", str(key), "transitions", i)) for edge, (i, written) in pairs)


def _has_surface(written: schema.TransitionDocument) -> bool:
    on = written.on if isinstance(written, schema.PartTransitionDocument) else None
    return written.event is None and on is None


class Subject:
    """A model to look at: its mathematics, its keys and scalars with their places, and the nodes of the file.

    In ``system`` parameters are symbols, `let` and expression inputs are substituted. What is derived is computed once,
    and shared by all rules.
    """

    def __init__(self, reading: Elaboration) -> None:
        self.reading = reading
        self.system: HybridSystem = reading.system
        self.document: schema.ModelDocument = reading.document
        self.root: Node = reading.root

    @cached_property
    def modes(self) -> tuple[ModePart, ...]:
        """Every mode, in file order."""
        pairs = zip(self.system.modes, self.document.modes.items(), strict=False)  # those of events come last
        return tuple(ModePart(mode, document, key, edge_parts(mode, key, document)) for mode, (key, document) in pairs)

    @property
    def edges(self) -> Iterator[tuple[ModePart, EdgePart]]:
        """Every transition with its mode, in file order."""
        return ((part, edge) for part in self.modes for edge in part.edges)

    @cached_property
    def states(self) -> dict[str, Key]:
        """Every state with its first place in the file."""
        found: dict[str, Key] = {}
        for part in self.modes:
            for key in part.document.flow or ():
                found.setdefault(str(key), key)
        return found

    @cached_property
    def expressions(self) -> tuple[SourceExpression, ...]:
        """Every expression of the file."""
        return tuple(written(self.document))

    def written_in(self, mode: str) -> tuple[SourceExpression, ...]:
        """The expressions that belong to a mode."""
        return self._by_mode.get(mode, ())

    @cached_property
    def _by_mode(self) -> dict[str | None, tuple[SourceExpression, ...]]:
        found: dict[str | None, list[SourceExpression]] = {}
        for expression in self.expressions:
            found.setdefault(expression.mode, []).append(expression)
        return {mode: tuple(expressions) for mode, expressions in found.items()}

    @cached_property
    def unused(self) -> frozenset[Definition]:
        """The parameters, inputs and `let` names that nothing depends on."""
        return unused(self.document, self.expressions)

    @cached_property
    def starts(self) -> tuple[str, ...]:
        """The modes in which runs of this file start: the initial one, and those that a `reference` sets."""
        set_by = (reference.settings.get("initial.mode") for reference in self.document.reference)  # pyright: ignore
        names = (self.system.initial.mode, *(scalar.value for scalar in set_by if scalar is not None))
        return tuple(dict.fromkeys(names))

    @cached_property
    def reachable(self) -> frozenset[str]:
        """The modes that transitions lead to from where runs start, taking every transition to be possible."""
        targets = {m.name: {edge.target for edge in m.edges if not m.final} for m in self.system.modes}
        return frozenset(closure(self.starts, targets.__getitem__))

    @cached_property
    def numbers(self) -> dict[Any, Number]:
        """The value of each parameter in this file, as a number; see `hsdsl.analysis.lint.subject`."""
        return self.system.parameter_values(evaluate)

    @cached_property
    def start(self) -> dict[Any, Number]:
        """The point at which a run of this file starts: parameters, initial values, inputs, and the time 0."""
        found = {**self.numbers, TIME: rational(0)}
        found.update({symbol(i.name): sample_at(i, found[TIME], found) for i in self.system.inputs})
        found.update({symbol(name): evaluate(value, self.numbers) for name, value in self.system.initial.values})
        return found

    def mode(self, name: str) -> ModePart:
        return next(part for part in self.modes if part.mode.name == name)

    def setting(self, name: str) -> Number:
        """A number of `experiment`; None where the file says nothing."""
        value = getattr(self.system.experiment, name)
        return None if value is None else evaluate(value, self.numbers)

    @property
    def relaxed(self) -> bool:
        """Whether runs of this file take the relaxed scheme by default."""
        return (self.system.experiment.scheme or DEFAULTS["scheme"]) == "relaxed"

    @property
    def relaxation(self) -> Number:
        """The relaxation of this file's runs; unless it is given, at most as large a part of the run as of 1."""
        given = self.setting("relaxation")
        return least_relaxation(rational(DEFAULTS["relaxation"]), self.setting("until")) if given is None else given

    def read(self, scalar: Scalar) -> Number:
        """The value of an expression of parameters in this file."""
        value = symbolic.number(parse(scalar.value), self.reading.top, scalar.value)
        return evaluate(value.expr, self.numbers)

    @cached_property
    def units(self) -> Units:
        """The units that the file gives, and those of its expressions."""
        return Units(self.document, self.expressions, of_parts=self.system.units)

    @cached_property
    def dynamics(self) -> Dynamics:
        """The mathematics of the rules about domains, guards and flows, with what is known of them so far."""
        return Dynamics(self.system)

    def value(self, expression: SourceExpression, node: Tree | None = None) -> Any:
        """The SymPy expression of a part of an expression, `let` and inputs substituted."""
        scope = self.reading.top if expression.mode is None else self.reading.scopes[expression.mode]
        return symbolic.number(expression.tree if node is None else node, scope, expression.scalar.value).expr

    def node(self, *path: str | int) -> Node | None:
        """The node that keys and indices lead to, such as ``node("modes", "free", "transitions", 0)``."""
        return descend(self.root, path)


INSIDE, ON, BEYOND = -1, 0, 1
_DEEPEST = 4  # derivatives along the flow that are examined
Number = Any  # an mpmath number; NaN where there is no value
Point = Mapping[sp.Symbol, Number]

ROUND_OFF = 32 * 2.0**-53  # of a surface, relative to its sides: the unit of float64 as in the meaning of a model
_OWN = ("sqrt", "select")  # made of other functions
_NAMES: dict[Any, str] = {function: name for name, (function, *_) in FUNCTIONS.items() if name not in _OWN}
_NAMES |= {sp.Abs: "abs"}
_COMPARED = {sp.Eq: "__eq__", sp.Ne: "__ne__", sp.Lt: "__lt__", sp.Le: "__le__", sp.Gt: "__gt__", sp.Ge: "__ge__"}


def evaluate(expr: Any, point: Point) -> Number:
    """The value of an expression; NaN where it has none, or where a symbol has no value at the point."""
    done: dict[Any, Number] = dict(point)

    def value(part: Any) -> Number:
        if part not in done:
            done[part] = _value(part, value)
        return done[part]

    return value(expr)


def holds(condition: Any, point: Point) -> bool | None:
    """Whether a condition holds at a point; None where a side has no value."""
    if condition is None or condition == sp.true:
        return True
    if condition == sp.false:
        return False
    if isinstance(condition, BooleanFunction):
        parts = [holds(part, point) for part in condition.args]
        if isinstance(condition, sp.Not):
            return None if parts[0] is None else not parts[0]
        decisive = isinstance(condition, sp.Or)
        if decisive in parts:
            return decisive
        return None if None in parts else not decisive
    left, right = (evaluate(side, point) for side in condition.args)
    if not (numeric.finite(left) and numeric.finite(right)):
        return None
    return bool(getattr(left, _COMPARED[type(condition)])(right))


def rational(value: Fraction | int) -> Number:
    """An exact number, rounded to 200 bits."""
    exact: Any = sp.Rational(Fraction(value).numerator, Fraction(value).denominator)
    return numeric.of_rational(exact)


def sample_at(given: SampledInput, time: Number, point: Point) -> Number:
    """The value of a sampled input just after a time."""
    times, values = ([_number(v, point) for v in row] for row in (given.times, given.values))
    last = max((i for i, t in enumerate(times) if t <= time), default=None)
    if last is None:
        return values[0]
    if given.hold == "zero" or last + 1 == len(times):
        return values[last]
    share = (time - times[last]) / (times[last + 1] - times[last])
    return values[last] + share * (values[last + 1] - values[last])


def _number(value: Any, point: Point) -> Number:
    return rational(value) if isinstance(value, Fraction) else evaluate(value, point)


def _value(expr: Any, value: Callable[[Any], Number]) -> Number:
    """The value of an expression from those of its parts."""
    if expr.is_Rational:
        return numeric.of_rational(expr)
    if expr == sp.pi:
        return numeric.PI
    if expr == sp.E:
        return numeric.apply("exp", [numeric.of_rational(sp.S.One)])
    parts = [value(part) for part in expr.args]
    if not parts or not all(numeric.finite(part) for part in parts):
        return numeric.NAN
    if expr.is_Add:
        return numeric.total(parts)
    if expr.is_Mul:
        return numeric.product(parts)
    if expr.is_Pow:
        return numeric.power(*parts)
    name = _NAMES.get(type(expr))
    return numeric.NAN if name is None else numeric.apply(name, parts)


def side(surface: Surface, point: Point) -> int | None:
    """Whether a point is inside, on (within round-off) or beyond a surface; None where it has no value there."""
    residual = evaluate(surface.residual, point)
    if not numeric.finite(residual):
        return None
    size = abs(evaluate(surface.left, point)) + abs(evaluate(surface.right, point))
    if abs(residual) <= ROUND_OFF * size:
        return ON
    return BEYOND if residual > 0 else INSIDE


def leaves(mode: Mode, surface: Surface, point: Point) -> bool | None:
    """Whether the flow carries a point of a surface beyond it; None where low derivatives do not decide it.

    The sign is that of the first of L_f r, L_f^2 r, ... that is not 0 within round-off. Sampled inputs
    count as constant.
    """
    rate: Any = surface.residual
    for _ in range(_DEEPEST):
        rate = lie_derivative(rate, mode.vector_field)
        value = evaluate(rate, point)
        if not numeric.finite(value):
            return None
        if abs(value) > ROUND_OFF * sum(abs(evaluate(term, point)) for term in sp.Add.make_args(sp.expand(rate))):
            return bool(value > 0)
    return None
