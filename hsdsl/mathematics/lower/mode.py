# pyright: basic, reportArgumentType=false, reportAttributeAccessIssue=false, reportOperatorIssue=false, reportAssignmentType=false, reportIncompatibleMethodOverride=false, reportCallIssue=false
"""The routines of one mode over numbered states, parameters and time."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import sympy as sp

from hsdsl.base.functions import absolute, below, maximum, rebuilt, replaced
from hsdsl.language.expression.scope import symbol
from hsdsl.language.system import TIME, Edge, Mode
from hsdsl.mathematics import program as lowered
from hsdsl.mathematics.completion import Overlay
from hsdsl.mathematics.lower.names import Names
from hsdsl.mathematics.lower.ordering import ordering
from hsdsl.mathematics.lower.routines import Definition, print_routines
from hsdsl.mathematics.lower.straight import Gradient
from hsdsl.mathematics.lower.tape import make_tape
from hsdsl.mathematics.lower.terms import Terms, may_hide

_NAN = symbol("nan")


def lowered_overlay(found: Overlay, names: Names) -> LoweredMode:
    """A mode with motion along its guards over numbered symbols."""
    flags = tuple(symbol(f"d{i}") for i in range(len(found.flags)))
    shared = names.shared | dict(zip(found.flags, flags, strict=True))
    return LoweredMode(found.mode, replace(names, data=(*names.data, *flags), shared=shared))


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
        self._slopes = [Gradient((residual,), self.arguments) for residual in self.residuals]

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
            "affine": all(map(self._is_affine, self.residuals, self._slopes)),
            "jacobian": self._jacobian(),
            "tape": make_tape(self.flow, self.residuals, self.states, data),
            "expressions": tuple(texts),
            "diagnosis": print_routines(self._diagnosis(expressions), data),
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
            slopes=tuple(tuple(self._places[a] for a in slopes.sparse[0]) for slopes in self._slopes),
            slides=mode.slides or (),
            measured=mode.measured,
            derived=mode.derived,
            queues=tuple(
                lowered.Queue(q.waiting, number[q.waiting], tuple(map(number.__getitem__, q.values)), q.most)
                for q in mode.queues
            ),
            **others,
        )
        bounded = program.jumps or may_hide(self.flow, self.arguments)
        return replace(program, terms=self._terms()) if bounded else program

    def _is_affine(self, residual: sp.Basic, slopes: Gradient) -> bool:
        """Whether a surface is affine in time and the states, also where the modes of parts choose what it is."""
        if residual.has(below):
            residual = _every_choice(residual)
            slopes = Gradient((residual,), self.arguments)
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

    def _terms(self) -> lowered.Routines:
        """Bounds on the terms that the flow is computed from."""
        terms = Terms(self.flow, dict(zip(self.states, self._sizes, strict=True)))
        definition = Definition("terms", (), terms.bounds, terms.statements, self._given)
        return print_routines((definition,), self.names.data)

    def _diagnosis(self, expressions):
        for k, result in enumerate(self.place(expressions)):
            yield Definition(f"expression_{k}", self.arguments, (result,), places=self._places)

    def _routines(self):
        mode, arguments = self.mode, self.arguments
        outputs = self.place(_NAN if output is None else output for output in mode.outputs)
        yield Definition("flow", arguments, self.flow)
        yield Definition("surfaces", arguments, self.residuals)
        sides = self.place(absolute(s.left) + absolute(s.right) for s in mode.surfaces)
        yield Definition("magnitudes", arguments, sides)
        yield Definition("outputs", arguments, outputs)
        along = dict(zip(arguments, (sp.S.One, *self.flow), strict=True))
        for k, slopes in enumerate(self._slopes):
            row = slopes.sparse[0]
            rate = sp.Add(*(slope * along[argument] for argument, slope in row.items()))
            yield self._few(f"gradient_{k}", row.values(), slopes.statements)
            yield self._few(f"rate_{k}", (rate,), slopes.statements)
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
    pairs = zip(map(symbol, mode.states), edge.reset, strict=True)
    return tuple(i for i, (x, r) in enumerate(pairs) if r is not x and r != x)


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
