# pyright: basic, reportArgumentType=false, reportAttributeAccessIssue=false, reportOperatorIssue=false, reportAssignmentType=false, reportIncompatibleMethodOverride=false, reportCallIssue=false, reportReturnType=false
"""The routines of one mode over numbered states, parameters and time, and what else a simulator asks of it.

`Terms` bounds the terms that expressions are computed from: so many units of round-off are in their values. This is
running error analysis (N. J. Higham, Accuracy and Stability of Numerical Algorithms, SIAM 2002, 3.3), to first order.
It sees what derivatives do not: terms that cancel, as in sin(x)**2 + cos(x)**2. A value that jumps counts with the
branch that it is on. `ordering` is the order in which a large and sparse implicit step eliminates states, and
`idle_states` are those that no surface, condition or deciding state depends on, now or in a later mode.
"""

from __future__ import annotations

from collections import ChainMap, defaultdict
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from heapq import heapify, heappop, heappush
from typing import Any, NamedTuple

import sympy as sp

from hsdsl.base.functions import absolute, below, floor, maximum, minimum, rebuilt, replaced, sign
from hsdsl.base.graphs import closure, filled
from hsdsl.base.names import without_memory
from hsdsl.language.expression.algebra import Shape
from hsdsl.language.expression.scope import symbol
from hsdsl.language.system import TIME, Edge, HybridSystem, Mode
from hsdsl.mathematics import program as lowered
from hsdsl.mathematics.completion import ConstrainedMode
from hsdsl.mathematics.lower.constants import Names
from hsdsl.mathematics.lower.straight import (
    Alike,
    Cut,
    Definition,
    Gradient,
    Statement,
    print_each,
    print_routines,
    shared,
)
from hsdsl.mathematics.lower.tape import make_tape

_NAN = symbol("nan")


def lowered_constrained(found: ConstrainedMode, names: Names) -> LoweredMode:
    """A mode with motion along its guards over numbered symbols."""
    flags = tuple(symbol(f"d{i}") for i in range(len(found.flags)))
    shared = names.shared | dict(zip(found.flags, flags, strict=True))
    return LoweredMode(found.mode, names._replace(data=(*names.data, *flags), shared=shared))


class _Surface(NamedTuple):
    """A surface: its residual, the shape of that and of the flow, the arguments with slopes, whether it is affine."""

    residual: sp.Basic
    shape: Shape
    slopes: tuple[int, ...]
    affine: bool


class LoweredMode:
    """A mode over numbered symbols."""

    def __init__(self, mode: Mode, names: Names) -> None:
        self.mode, self.names = mode, names
        self.states = tuple(symbol(f"x{i}") for i in range(len(mode.states)))
        self.arguments = (TIME, *self.states)
        self._mapping = names.shared | dict(zip(map(symbol, mode.states), self.states, strict=True))
        self._done: dict[sp.Basic, sp.Basic] = {}
        self.flow = self.place(mode.flow)
        self.residuals = self.place(s.residual for s in mode.surfaces)
        self._places = {argument: i for i, argument in enumerate(self.arguments)}
        self._sizes = tuple(symbol(f"s{i}") for i in range(len(self.states)))
        self._given = self._places | {s: len(self.arguments) + i for i, s in enumerate(self._sizes)}
        self._along = dict(zip(self.states, self.flow, strict=True))
        self._known: dict[tuple, tuple[tuple[int, ...], bool]] = {}
        self._surfaces = list(map(self._surface, self.residuals))

    def place(self, expressions) -> tuple[sp.Basic, ...]:
        """Expressions of the file's names over numbered symbols."""
        return tuple(replaced(sp.sympify(e), self._mapping, self._done) for e in expressions)

    def routines(self) -> lowered.Routines:
        """What a step computes, and the outputs."""
        return print_routines(self._routines(), self.names.data)

    def others(self) -> dict[str, Any]:
        """The other fields of a mode that are derived from its expressions."""
        mode, data = self.mode, self.names.data
        texts, expressions = zip(*_labelled(mode), strict=True) if mode.states or mode.surfaces else ((), ())
        return {
            "affine": all(surface.affine for surface in self._surfaces),
            "jacobian": self._jacobian(),
            "tape": make_tape(self.flow, self.residuals, self.states, data),
            "expressions": tuple(texts),
            "diagnosis": print_routines(
                (self._few(f"expression_{k}", (e,)) for k, e in enumerate(self.place(expressions))), data
            ),
        }

    def program(
        self, indices: dict[str, int], routines: lowered.Routines, others: Mapping[str, Any]
    ) -> lowered.ModeProgram:
        """The mode's routines, and its data for a loop."""
        mode = self.mode
        number = {name: i for i, name in enumerate(mode.states)}
        program = lowered.ModeProgram(
            name=mode.name,
            states=mode.states,
            final=mode.final,
            edges=tuple(_edge(edge, mode, indices) for edge in mode.edges),
            walls=tuple(wall.text for wall in mode.walls),
            flow_texts=mode.flow_texts,
            routines=routines,
            slopes=tuple(surface.slopes for surface in self._surfaces),
            slides=mode.slides or (),
            measured=mode.measured,
            derived=mode.derived,
            queues=tuple(
                lowered.Queue(q.waiting, number[q.waiting], tuple(map(number.__getitem__, q.values)), q.most)
                for q in mode.queues
            ),
            **others,
        )
        if not (program.jumps or may_hide(self.flow, self._places)):
            return program
        sizes = dict(zip(self.states, self._sizes, strict=True))

        def bounds(*flow: sp.Expr) -> Definition:
            terms = Terms(flow, sizes)
            return Definition("terms", (), terms.bounds, terms.statements)

        return replace(program, terms=print_each("terms", self.flow, bounds, sizes, self._given, self.names.data))

    def _surface(self, residual: sp.Basic) -> _Surface:
        """What is known of a surface: once for all that have one shape together with the flow of their states."""
        shape = Shape((residual,), self._along)
        key = shape.order(self._places), *shape.key
        if key not in self._known:
            slopes = Gradient((residual,), self._places)
            row = tuple(shape.symbols[argument] for argument in slopes.sparse[0])
            self._known[key] = row, self._is_affine(residual, slopes)
        row, affine = self._known[key]
        symbols = {number: symbol for symbol, number in shape.symbols.items()}
        return _Surface(residual, shape, tuple(self._places[symbols[number]] for number in row), affine)

    def _derivatives(self, k: int, surface: _Surface) -> Iterator[Alike]:
        """The slopes of a surface, and its rate along the flow."""

        def gradient():
            slopes = Gradient((surface.residual,), self._places)
            return tuple(slopes.sparse[0].values()), slopes.statements

        def rate():
            slopes = Gradient((surface.residual,), self._places)
            along = self._along | {TIME: sp.S.One}
            return (sp.Add(*(slope * along[a] for a, slope in slopes.sparse[0].items())),), slopes.statements

        order = surface.shape.order(self._places)
        for name, write in (("gradient", gradient), ("rate", rate)):
            yield Alike(f"{name}_{k}", (name, order), surface.shape, write, self._places)

    def _is_affine(self, residual: sp.Basic, slopes: Gradient) -> bool:
        """Whether a surface is affine in time and the states, in every choice that numbers of modes make."""
        choices = residual.atoms(below)
        if choices:
            flowing = {TIME, *(state for state, f in zip(self.states, self.flow, strict=True) if f != 0)}
            seen = {*without_memory(self.mode.states)}
            remembered = {state for state, name in zip(self.states, self.mode.states, strict=True) if name not in seen}
            chosen_by = (choice.args[0].free_symbols for choice in choices)
            if any(symbols & flowing and not symbols & remembered for symbols in chosen_by):
                return False  # a `select` by what flows; those of events change with transitions alone
            residual = _every_choice(residual)
            slopes = Gradient((residual,), self._places)
        own = residual.free_symbols & self._places.keys()
        if slopes.statements or any(slope.free_symbols & own for slope in slopes.sparse[0].values()):
            return False
        return residual.is_polynomial(*own)

    def _jacobian(self) -> lowered.Jacobian:
        """The derivatives of the flow; of derived states, unless varied, by derived ones alone, and no second ones."""
        varied, width = self.mode.varied, len(self.states)
        own = width - self.mode.derived
        parts = (
            (0, Gradient(self.flow[:own], self.states)),
            (own, Gradient(self.flow[own:], self.states[0 if varied else own :], letter="h")),
        )
        column = {state: i for i, state in enumerate(self.states)}
        rows = [(k, row) for first, part in parts for k, row in enumerate(part.sparse, first)]
        places = tuple(k * width + column[state] for k, row in rows for state in row)
        values = tuple(slope for _, row in rows for slope in row.values())
        definition = Definition("jacobian", self.arguments, values, [s for _, part in parts for s in part.statements])
        routines, order = print_routines((definition,), self.names.data), ordering(places, width)
        if not varied:
            return lowered.Jacobian(routines, places, width, order)
        inside = [k // width * own + k % width for k in places if k // width < own]
        return lowered.Jacobian(routines, places, width, order, own, varied, ordering(inside, own))

    def _routines(self):
        mode, arguments = self.mode, self.arguments
        outputs = self.place(_NAN if output is None else output for output in mode.outputs)
        yield Definition("flow", arguments, self.flow)
        yield Definition("surfaces", arguments, self.residuals)
        sides = self.place(absolute(s.left) + absolute(s.right) for s in mode.surfaces)
        yield Definition("magnitudes", arguments, sides)
        yield Definition("outputs", arguments, outputs)
        for k, surface in enumerate(self._surfaces):
            yield from self._derivatives(k, surface)
        for k, edge in enumerate(mode.edges):
            condition = sp.true if edge.condition is None else edge.condition
            for i, part in enumerate(condition.args if isinstance(condition, sp.And) else (condition,)):
                yield self._few(f"condition_{k}_{i}", self.place([part]))
        kept = dict(zip(self.states, self._sizes, strict=True))
        read = {x: maximum(absolute(x), s) for x, s in kept.items()}
        for k, edge in enumerate(mode.edges):
            changed = changed_by(edge, mode)
            reset = self.place(edge.reset[i] for i in changed)
            yield self._few(f"reset_{k}", reset)
            own = sum(i < len(edge.reset) - edge.derived for i in changed)
            terms = Terms(reset[:own], read)
            spreads = tuple(kept.get(r, -bound) for r, bound in zip(reset, terms.bounds, strict=False))
            spreads += tuple(map(absolute, reset[own:]))
            yield Definition(f"spread_{k}", (), spreads, terms.statements, self._given)

    def _few(self, name: str, results, statements=()) -> Definition:
        """A routine that names the few arguments it uses."""
        return Definition(name, self.arguments, tuple(results), statements, self._places)


def changed_by(edge: Edge, mode: Mode) -> tuple[int, ...]:
    """The states that an edge's reset changes, by their numbers in the target; all of another mode's."""
    if edge.target_states != mode.states:
        return tuple(range(len(edge.target_states)))
    return tuple(edge.reset.changes)


def _edge(edge: Edge, mode: Mode, indices: dict[str, int]) -> lowered.EdgeProgram:
    changed = changed_by(edge, mode)
    return lowered.EdgeProgram(
        name=edge.name,
        source=indices[edge.source],
        target=indices[edge.target],
        target_states=edge.target_states,
        conditional=edge.condition is not None,
        priority=edge.priority,
        text=edge.surface.text,
        changes=changed,
        change_texts=tuple(edge.reset_texts[i] for i in changed),
        condition_text=edge.condition_text or "",
        of_event=edge.of_event,
        strict=edge.strict,
    )


def _labelled(mode: Mode):
    """The expressions of a mode, each with a description for people."""
    for state, text, expression in zip(mode.states, mode.flow_texts, mode.flow, strict=True):
        yield f"the flow of {state}, {text}", expression
    for edge in mode.edges:
        yield f"the guard of {edge.name}, {edge.surface.text}", edge.surface.residual
        if edge.condition is not None:
            yield f"the condition of {edge.name}", edge.condition
    for wall in mode.walls:
        yield f"the domain's {wall.text}", wall.residual


def _every_choice(expr: sp.Basic) -> sp.Basic:
    """A sum with a term of its own for each of the expressions that numbers of modes choose from."""
    if not expr.has(below):
        return expr
    if isinstance(expr, below):
        return sp.Add(*(sp.Dummy() * _every_choice(choice) for choice in expr.args[2:]))
    return rebuilt(expr, tuple(map(_every_choice, expr.args)))


LEAST = 16  # unknowns: of fewer the dense elimination, which exchanges rows, is as fast
SPARSE = 4  # the dense factors have at least so many times as many entries


def ordering(places: Sequence[int], n: int) -> tuple[int, ...]:
    """An order with few entries of the factors; empty where the dense elimination is used.

    States that do not flow cost the dense elimination as much as others, and the sparse one nothing.
    """
    flowing = len({k // n for k in places})
    if not flowing or (n < LEAST and 2 * flowing > n) or SPARSE * len(places) > n * n:
        return ()
    order = _minimum_degree(places, n)
    position = {k: i for i, k in enumerate(order)}
    fill = filled([(position[k // n], position[k % n]) for k in places], n)
    return order if SPARSE * fill <= n * n else ()


def _minimum_degree(places: Sequence[int], n: int) -> tuple[int, ...]:
    """The order that takes an unknown with the fewest neighbours next; all that it leaves are then neighbours.

    Of several it takes the one with the fewest others before it in turn, for all of which a processor must wait.
    See A. George and J. W. H. Liu, The evolution of the minimum degree ordering algorithm, SIAM Review 31, 1989
    (doi:10.1137/1031001).
    """
    near: list[set[int]] = [set() for _ in range(n)]
    for i, j in (divmod(k, n) for k in places):
        if i != j:
            near[i].add(j)
            near[j].add(i)
    waiting = [(len(others), 0, i) for i, others in enumerate(near)]
    heapify(waiting)
    behind = [0] * n
    order = dict[int, None]()
    while waiting:
        degree, _, i = heappop(waiting)
        if i in order or degree != len(near[i]):  # it has lost or won neighbours since
            continue
        order[i] = None
        for j in near[i]:
            near[j] |= near[i]
            near[j] -= {i, j}
            behind[j] = max(behind[j], behind[i] + 1)
            heappush(waiting, (len(near[j]), behind[j], j))
    return tuple(order)


_CONSTANT, _SEEN, _HIDDEN = range(3)


def may_hide(expressions: Iterable[sp.Expr], moving: Collection[sp.Symbol]) -> bool:
    """Whether terms of a sum may cancel, unseen by what the last digits of states and time change in it.

    These change a product of states by as much as its last digits are. They do not change a constant, and hardly the
    cosine of a small angle. One such term of a sum is no harm: what cancels it is as large, and seen.
    """
    kinds: dict[sp.Basic, int] = {}

    def kind(expr: sp.Basic) -> int:
        if expr not in kinds:
            parts = [kind(part) for part in expr.args]
            kinds[expr] = _kind(expr, parts) if any(parts) else _SEEN if expr in moving else _CONSTANT
        return kinds[expr]

    def _kind(expr: sp.Basic, parts: list[int]) -> int:
        if expr.is_Add and len(parts) - parts.count(_SEEN) > 1:
            raise _Hides
        if expr.is_Mul:
            return _SEEN if _SEEN in parts else _HIDDEN
        alone = isinstance(expr, (absolute, sp.sin, sp.sinh)) or (expr.is_Pow and expr.exp.is_Number)
        return _SEEN if parts[0] == _SEEN and (alone or (expr.is_Add and set(parts) == {_SEEN})) else _HIDDEN

    try:
        for expr in expressions:
            kind(expr)
    except _Hides:
        return True
    return False


class _Hides(Exception):
    """A sum has two terms whose last digits are not seen."""


class Terms:
    """The terms of expressions: ``bounds`` has a bound for each, ``statements`` are the names in them, in order.

    ``sizes`` are those of the symbols that have one; of another it is its value.
    """

    def __init__(self, expressions: Sequence[sp.Expr], sizes: Mapping[sp.Symbol, sp.Expr]) -> None:
        common, small = shared(expressions, "e_")
        self._cut, self._sizes = Cut("e"), ChainMap[sp.Symbol, sp.Expr]({}, sizes)
        self._known: dict[sp.Basic, sp.Expr] = {}
        for name, expr in common:
            self._cut.define(name, expr)
        small = [self._cut.down(expr) for expr in small]
        for name, expr in tuple(self._cut.statements):
            self._sizes[name] = self._bound(expr)
        self.bounds = tuple(map(self._bound, small))
        self.statements: Sequence[Statement] = self._cut.statements

    def _bound(self, expr: sp.Expr) -> sp.Expr:
        if expr not in self._known:
            self._known[expr] = self._cut.name(self._of(expr))
        return self._known[expr]

    def _of(self, expr: sp.Expr) -> sp.Expr:
        if expr.is_Symbol or not expr.args:
            return self._sizes.get(expr, absolute(expr))
        if isinstance(expr, (sign, floor)):
            return absolute(expr)
        if isinstance(expr, below):
            return below(*expr.args[:2], *map(self._bound, expr.args[2:]))
        parts = list(map(self._bound, expr.args))
        if isinstance(expr, (minimum, maximum)):
            return maximum(*parts)
        if expr.is_Add or isinstance(expr, absolute):
            return sp.Add(*parts)
        return sp.Add(absolute(expr), *(absolute(s) * part for s, part in zip(self._slopes(expr), parts, strict=True)))

    def _slopes(self, expr: sp.Expr) -> list[sp.Expr]:
        """The derivatives of an operation by its operands."""
        if expr.is_Mul:
            return [sp.Mul(*expr.args[:i], *expr.args[i + 1 :]) for i in range(len(expr.args))]
        operands = [sp.Dummy(real=True) for _ in expr.args]
        known = dict(zip(operands, expr.args, strict=True))
        if expr.is_Pow and expr.exp.is_Number:
            return [expr.exp * rebuilt(expr, (expr.base, expr.exp - 1)), sp.S.Zero]
        whole = rebuilt(expr, operands)
        return [whole.diff(operand).xreplace(known) for operand in operands]


Node = tuple[str, Any]  # a mode, and the symbol of one of its states
Found = dict[sp.Basic, frozenset[Any]]


def idle_states(system: HybridSystem) -> list[tuple[int, ...]]:
    """The numbers of the states of each mode that decide nothing, as counters do and what is only shown."""
    uses: dict[Node, set[Node]] = defaultdict(set)
    modes, found = {mode.name: mode for mode in system.modes}, Found()
    roots: list[Node] = []
    for mode in system.modes:
        conditions = [edge.condition for edge in mode.edges if edge.condition is not None]
        sides = [side for surface in mode.surfaces for side in (surface.residual, surface.left, surface.right)]
        roots += _nodes(mode, [*conditions, *sides], found)
        for state, flow in zip(mode.states, mode.flow, strict=True):
            uses[mode.name, symbol(state)] |= _nodes(mode, [flow], found)
        for edge in mode.edges:
            for i in changed_by(edge, mode) if modes[edge.target].states else ():
                uses[edge.target, symbol(edge.target_states[i])] |= _nodes(mode, [edge.reset[i]], found)
    needed = closure(roots, lambda node: uses.get(node, ()))
    return [
        tuple(i for i, state in enumerate(mode.states) if (mode.name, symbol(state)) not in needed)
        for mode in system.modes
    ]


def _nodes(mode: Mode, expressions: Iterable[Any], found: Found) -> set[Node]:
    return {(mode.name, name) for e in expressions for name in _symbols(sp.sympify(e), found)}


def _symbols(expression: sp.Basic, found: Found) -> frozenset[Any]:
    """The symbols of an expression whose parts may be the same many times over."""
    if expression not in found:
        own = [expression] if expression.is_Symbol else []
        found[expression] = frozenset(own).union(*(_symbols(part, found) for part in expression.args))
    return found[expression]
