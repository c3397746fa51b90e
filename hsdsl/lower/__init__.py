# pyright: basic, reportArgumentType=false, reportAttributeAccessIssue=false, reportOperatorIssue=false, reportAssignmentType=false, reportIncompatibleMethodOverride=false, reportCallIssue=false
"""HybridSystem -> Program: every expression becomes a straight-line routine over numbered states, parameters and time.

The pipeline is in :func:`lower`. `hsdsl.program.ModeProgram` lists the routines.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any, Protocol, TypeVar

import sympy as sp

from hsdsl import limits
from hsdsl import program as lowered
from hsdsl.completion import Overlay, overlay
from hsdsl.errors import TOO_LONG, Diagnostic, ModelError
from hsdsl.expression.scope import symbol
from hsdsl.expression.stack import deep_stack
from hsdsl.expression.timebox import OutOfTime, timebox
from hsdsl.functions import absolute, below, maximum, rebuilt
from hsdsl.lower.ordering import ordering
from hsdsl.lower.routines import Definition, print_routines
from hsdsl.lower.straight import Gradient, replaced
from hsdsl.lower.switches import switch_programs, switch_routines, with_switches
from hsdsl.lower.tape import make_tape
from hsdsl.lower.terms import Terms
from hsdsl.parts import numbered
from hsdsl.system import TIME, Edge, HybridSystem, Mode, SampledInput

_NAN = symbol("nan")
First = TypeVar("First")
Second = TypeVar("Second")


class Both(Protocol):
    """What does two things and answers with both results."""

    def __call__(self, first: Callable[[], First], second: Callable[[], Second], /) -> tuple[First, Second]: ...


@dataclass(frozen=True)
class Names:
    """The numbered symbols for the file's names in generated code.

    ``data`` has the arguments of `bind`; ``shared`` maps parameters, sampled inputs and switches;
    ``inputs`` has the value of each sampled input at the start of its segment, whose slope by the input is 1.
    """

    parameters: tuple[sp.Symbol, ...]
    data: tuple[sp.Symbol, ...]
    shared: dict[sp.Symbol, sp.Expr]
    inputs: tuple[sp.Symbol, ...] = ()


def in_turn(first: Callable[[], First], second: Callable[[], Second]) -> tuple[First, Second]:
    """Do one thing, then the other."""
    return first(), second()


def lower(system: HybridSystem, both: Both = in_turn) -> lowered.Program:
    """Lower a system; the result needs no SymPy to run. Both halves of the work are done by ``both``.

    Raises ModelError: the symbolic work takes longer than the limits allow.
    """
    try:
        with deep_stack(), timebox(limits.current().seconds):
            return _lower(system, both)
    except OutOfTime:
        message = "deriving and writing out the expressions of this model takes too long"
        hint = "make parts of its expressions states, or allow more time with --limit seconds=600"
        raise ModelError([Diagnostic(TOO_LONG, message, None, hint)]) from None


def _lower(system: HybridSystem, both: Both) -> lowered.Program:
    system, switches = with_switches(system)
    names = number(system, switches.symbols)
    experiment = system.experiment
    indices = {mode.name: i for i, mode in enumerate(system.modes)}
    modes, contacts = _modes(system, names, indices, both)
    return lowered.Program(
        path=system.path,
        digest=system.digest,
        title=system.title,
        parameters=tuple(p.name for p in system.parameters),
        inputs=tuple(_sampled(i) for i in system.inputs),
        modes=modes,
        contacts=contacts,
        parts=system.parts,
        outputs=system.outputs,
        units=system.units,
        initial_mode=indices[system.initial.mode],
        initial_states=tuple(name for name, _ in system.initial.values),
        scheme=experiment.scheme,
        method=experiment.method,
        completion=experiment.completion,
        constants=print_routines(_constants(system, names), ()),
        switches=switch_programs(switches),
        switching=print_routines(switch_routines(switches, names.shared), names.data),
        scaled_states=tuple(name for name, _ in experiment.scale),
        initial_order=_initial_order(system),
        initial_values=print_routines(_initial_values(system, names), ()),
    )


def _modes(system: HybridSystem, names: Names, indices: dict[str, int], both: Both):
    """The modes, and those with motion along their guards."""
    modes = [LoweredMode(mode, names) for mode in system.modes]
    found = [overlay(mode, numbered(system.parts)) for mode in system.modes]
    held = [lowered_overlay(each, names) for each in found if each]
    every = (*modes, *held)
    routines, others = both(lambda: [each.routines() for each in every], lambda: [each.others() for each in every])
    programs = iter([each.program(indices, *pair) for each, *pair in zip(every, routines, others, strict=True)])
    whole = [next(programs) for _ in modes]
    contacts: list[lowered.ModeProgram] = []
    for i, motion in enumerate(found):
        if motion:
            edges = _with_contacts(whole[i].edges, motion)
            whole[i] = replace(whole[i], held=len(modes) + len(contacts), edges=edges)
            along = next(programs)
            pairs = zip(along.edges, motion.releases, strict=True)
            contacts.append(replace(along, edges=tuple(replace(edge, releases=number) for edge, number in pairs)))
    return tuple(whole), tuple(contacts)


def _with_contacts(edges: tuple[lowered.EdgeProgram, ...], found: Overlay) -> tuple[lowered.EdgeProgram, ...]:
    """A mode's edges with what a run knows of motion along their guards."""
    whole = list(edges)
    for i, motion in enumerate(found.contacts):
        whole[motion.edge] = replace(
            edges[motion.edge], contact=i, push_order=motion.order, counts=motion.counts,
            branched=motion.near.impact is not None,
        )  # fmt: skip
    return tuple(whole)


def lowered_overlay(found: Overlay, names: Names) -> LoweredMode:
    """A mode with motion along its guards over numbered symbols."""
    flags = tuple(symbol(f"d{i}") for i in range(len(found.flags)))
    shared = names.shared | dict(zip(found.flags, flags, strict=True))
    return LoweredMode(found.mode, replace(names, data=(*names.data, *flags), shared=shared))


def lower_expressions(system: HybridSystem, expressions: dict[str, sp.Expr]) -> lowered.Routines:
    """Lower expressions of parameters (what overrides are made of): each a routine of all parameters."""
    names = number(system)
    with deep_stack():
        return print_routines(
            [Definition(k, names.parameters, (e.xreplace(names.shared),)) for k, e in expressions.items()], ()
        )


def lower_constants(system: HybridSystem) -> lowered.Routines:
    """Lower the constants of a system: values of parameters and settings, and the initial values."""
    with deep_stack():
        return print_routines(_constants(system, number(system)), ())


def number(system: HybridSystem, switches: tuple[sp.Symbol, ...] = ()) -> Names:
    """The numbered symbols for the names of a system."""
    parameters = tuple(symbol(f"p{i}") for i in range(len(system.parameters)))
    shared: dict[sp.Symbol, sp.Expr] = dict(zip(system.parameter_symbols, parameters, strict=True))
    data, starts = list(parameters), list[sp.Symbol]()
    for i, sampled in enumerate(system.inputs):
        start, slope, since = (symbol(f"{letter}{i}") for letter in "abc")
        shared[symbol(sampled.name)] = start + slope * (TIME - since) if sampled.hold == "linear" else start
        data += [start, slope, since]
        starts.append(start)
    numbers = tuple(symbol(f"k{i}") for i in range(len(switches)))
    shared.update(zip(switches, numbers, strict=True))
    data += numbers
    return Names(parameters, tuple(data), shared, tuple(starts))


def _sampled(given: SampledInput) -> lowered.SampledInput:
    exact = not any(isinstance(v, sp.Basic) for v in given.times + given.values)
    return lowered.SampledInput(given.name, given.hold, given.times if exact else None, given.values if exact else None)


def _initial_order(system: HybridSystem) -> tuple[int, ...]:
    places = {name: i for i, (name, _) in enumerate(system.initial.values)}
    return tuple(places[name] for name, _ in system.initial.written)


def _initial_values(system: HybridSystem, names: Names):
    """Each initial value over parameters and others, where they use each other."""
    states = {symbol(name): symbol(f"x{i}") for i, (name, _) in enumerate(system.initial.values)}
    arguments = (*names.parameters, *states.values())
    places = {argument: i for i, argument in enumerate(arguments)}
    for i, (_, value) in zip(_initial_order(system), system.initial.written, strict=True):
        yield Definition(f"initial_{i}", arguments, (replaced(value, names.shared | states, {}),), places=places)


def _constants(system: HybridSystem, names: Names):
    places = {parameter: i for i, parameter in enumerate(names.parameters)}
    done: dict[sp.Basic, sp.Basic] = {}

    def define(name, *expressions):
        results = tuple(replaced(sp.sympify(e), names.shared, done) for e in expressions)
        return Definition(name, names.parameters, results, places=places)

    for i, parameter in enumerate(system.parameters):
        yield define(f"parameter_{i}", parameter.value)
        if parameter.minimum is not None:
            yield define(f"minimum_{i}", parameter.minimum)
        if parameter.maximum is not None:
            yield define(f"maximum_{i}", parameter.maximum)
    yield define("initial", *(value for _, value in system.initial.values))
    for i, given in enumerate(system.inputs):
        if any(isinstance(v, sp.Basic) for v in given.times + given.values):
            yield define(f"input_{i}", *given.times, *given.values)
    experiment = system.experiment
    for key in ("until", "step", "tolerance", "relaxation", "max_transitions"):
        if getattr(experiment, key) is not None:
            yield define(key, getattr(experiment, key))
    if experiment.scale:
        yield define("scale", *(size for _, size in experiment.scale))
    if isinstance(experiment.samples, tuple):
        yield define("sample_times", *experiment.samples)
    elif experiment.samples is not None:
        yield define("sample_count", experiment.samples)


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
            **others,
        )
        return replace(program, terms=self._terms()) if program.jumps else program

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
        scales = dict(zip(self.states, self._sizes, strict=True))
        for k, edge in enumerate(mode.edges):
            changed = changed_by(edge, mode)
            own = [i for i in changed if i < len(edge.reset) - edge.derived]
            reset = self.place(edge.reset[i] for i in changed)
            yield self._few(f"reset_{k}", reset)
            changes = Gradient(reset[: len(own)], self.states)
            spreads = tuple(_spread(r, row, scales) for r, row in zip(reset, changes.sparse, strict=False))
            spreads += tuple(map(absolute, reset[len(own) :]))
            yield Definition(f"spread_{k}", (), spreads, changes.statements, self._given)

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


def _spread(value: sp.Expr, slopes, scales):
    parts = sp.Add(*(absolute(slope) * scales[state] for state, slope in slopes.items()))
    return parts if value in scales else maximum(absolute(value), parts)
