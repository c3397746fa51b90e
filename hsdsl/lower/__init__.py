# SymPy's types are wider than what it takes and returns.
# pyright: basic, reportArgumentType=false, reportAttributeAccessIssue=false, reportOperatorIssue=false, reportAssignmentType=false, reportIncompatibleMethodOverride=false, reportCallIssue=false
"""HybridSystem -> Program: every expression becomes a straight-line routine over numbered states, parameters and time.

The pipeline is in :func:`lower`. What each routine returns stands in `hsdsl.program.ModeProgram`.
"""

from __future__ import annotations

from dataclasses import dataclass

import sympy as sp

from hsdsl import limits
from hsdsl import program as lowered
from hsdsl.errors import TOO_LONG, Diagnostic, ModelError
from hsdsl.expression.stack import deep_stack
from hsdsl.expression.timebox import OutOfTime, timebox
from hsdsl.functions import absolute, maximum
from hsdsl.lower.routines import Definition, print_routines
from hsdsl.lower.straight import Gradient, replaced
from hsdsl.lower.switches import switch_programs, switch_routines, with_switches
from hsdsl.lower.tape import make_tape
from hsdsl.system import TIME, HybridSystem, Mode, SampledInput

_NAN = sp.Symbol("nan", real=True)


@dataclass(frozen=True)
class Names:
    """The numbered symbols that stand for the file's names in generated code."""

    parameters: tuple[sp.Symbol, ...]
    data: tuple[sp.Symbol, ...]
    shared: dict[sp.Symbol, sp.Expr]  # parameters, sampled inputs and switches

    def of_states(self, states: tuple[str, ...], letter: str = "x") -> tuple[sp.Symbol, ...]:
        """Number a mode's states."""
        return tuple(_symbol(f"{letter}{i}") for i in range(len(states)))

    def mapping(self, states: tuple[str, ...]) -> dict[sp.Symbol, sp.Expr]:
        """Everything an expression of a mode with these states may name."""
        return self.shared | dict(zip(map(_symbol, states), self.of_states(states), strict=True))


def lower(system: HybridSystem) -> lowered.Program:
    """Lower a system; the result needs no SymPy to run.

    Raises
    ------
    ModelError
        The symbolic work takes longer than the limits allow.
    """
    try:
        with deep_stack(), timebox(limits.current().seconds):
            return _lower(system)
    except OutOfTime:
        message = "deriving and writing out the expressions of this model takes too long"
        hint = "make parts of its expressions states, or allow more time with --limit seconds=600"
        raise ModelError([Diagnostic(TOO_LONG, message, None, hint)]) from None


def _lower(system: HybridSystem) -> lowered.Program:
    system, switches = with_switches(system)
    names = _number(system, switches.symbols)
    experiment = system.experiment
    return lowered.Program(
        path=system.path,
        digest=system.digest,
        title=system.title,
        parameters=tuple(p.name for p in system.parameters),
        inputs=tuple(_sampled(i) for i in system.inputs),
        modes=tuple(_mode(system, mode, names) for mode in system.modes),
        outputs=system.outputs,
        units=system.units,
        initial_mode=[m.name for m in system.modes].index(system.initial.mode),
        initial_states=tuple(name for name, _ in system.initial.values),
        scheme=experiment.scheme,
        method=experiment.method,
        constants=print_routines(_constants(system, names), ()),
        switches=switch_programs(switches),
        switching=print_routines(switch_routines(switches, names.shared), names.data),
        scaled_states=tuple(name for name, _ in experiment.scale),
    )


def lower_expressions(system: HybridSystem, expressions: dict[str, sp.Expr]) -> lowered.Routines:
    """Lower expressions of parameters (what overrides are made of): each a routine of all parameters."""
    names = _number(system)
    with deep_stack():
        return print_routines(
            [Definition(k, names.parameters, (e.xreplace(names.shared),)) for k, e in expressions.items()], ()
        )


def _symbol(name: str) -> sp.Symbol:
    return sp.Symbol(name, real=True)


def _number(system: HybridSystem, switches: tuple[sp.Symbol, ...] = ()) -> Names:
    parameters = tuple(_symbol(f"p{i}") for i in range(len(system.parameters)))
    shared: dict[sp.Symbol, sp.Expr] = dict(zip(system.parameter_symbols, parameters, strict=True))
    data = list(parameters)
    for i, sampled in enumerate(system.inputs):
        start, slope, since = (_symbol(f"{letter}{i}") for letter in "abc")
        shared[_symbol(sampled.name)] = start + slope * (TIME - since) if sampled.hold == "linear" else start
        data += [start, slope, since]
    numbers = tuple(_symbol(f"k{i}") for i in range(len(switches)))
    shared.update(zip(switches, numbers, strict=True))
    data += numbers
    return Names(parameters, tuple(data), shared)


def _sampled(given: SampledInput) -> lowered.SampledInput:
    exact = not any(isinstance(v, sp.Basic) for v in given.times + given.values)
    return lowered.SampledInput(given.name, given.hold, given.times if exact else None, given.values if exact else None)


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


def _mode(system: HybridSystem, mode: Mode, names: Names) -> lowered.ModeProgram:
    indices = {m.name: i for i, m in enumerate(system.modes)}
    edges = tuple(
        lowered.EdgeProgram(
            name=edge.name,
            source=indices[edge.source],
            target=indices[edge.target],
            target_states=edge.target_states,
            conditional=edge.condition is not None,
            priority=edge.priority,
            text=edge.surface.text,
            reset_texts=edge.reset_texts,
        )
        for edge in mode.edges
    )
    return lowered.ModeProgram(
        name=mode.name,
        states=mode.states,
        final=mode.final,
        edges=edges,
        walls=tuple(wall.text for wall in mode.walls),
        flow_texts=mode.flow_texts,
        routines=print_routines(_mode_routines(mode, names), names.data),
        affine=_affine(mode, names),
        jacobian=_jacobian(mode, names),
        tape=_tape(mode, names),
        expressions=tuple(text for text, _ in _expressions(mode)),
        diagnosis=print_routines(_diagnosis(mode, names), names.data),
    )


def _affine(mode: Mode, names: Names) -> bool:
    """Whether all surfaces of a mode are affine functions of time and the states, as far as can be told at sight."""
    arguments, mapping, done = (TIME, *names.of_states(mode.states)), names.mapping(mode.states), {}
    residuals = [replaced(sp.sympify(r), mapping, done) for r in _residuals(mode)]
    return all(r.is_polynomial(*arguments) and _constant_slopes(r, arguments) for r in residuals)


def _constant_slopes(expression: sp.Expr, arguments: tuple[sp.Symbol, ...]) -> bool:
    slopes = Gradient((expression,), arguments)
    own = set(arguments)
    return not slopes.statements and not any(slope.free_symbols & own for slope in slopes.sparse[0].values())


def _residuals(mode: Mode) -> list[sp.Expr]:
    return [edge.surface.residual for edge in mode.edges] + [wall.residual for wall in mode.walls]


def _jacobian(mode: Mode, names: Names) -> lowered.Jacobian:
    states, mapping, done = names.of_states(mode.states), names.mapping(mode.states), {}
    slopes = Gradient([replaced(sp.sympify(e), mapping, done) for e in mode.flow], states)
    column = {state: i for i, state in enumerate(states)}
    places = [k * len(states) + column[state] for k, row in enumerate(slopes.sparse) for state in row]
    values = tuple(slope for row in slopes.sparse for slope in row.values())
    definition = Definition("jacobian", (TIME, *states), values, slopes.statements)
    return lowered.Jacobian(print_routines((definition,), names.data), tuple(places))


def _tape(mode: Mode, names: Names) -> lowered.Tape | None:
    mapping, done = names.mapping(mode.states), {}
    parts = mode.flow, _residuals(mode)
    flow, surfaces = ([replaced(sp.sympify(e), mapping, done) for e in part] for part in parts)
    return make_tape(flow, surfaces, names.of_states(mode.states), names.data)


def _expressions(mode: Mode):
    for state, text, expression in zip(mode.states, mode.flow_texts, mode.flow, strict=True):
        yield f"the flow of {state}, {text}", expression
    for edge in mode.edges:
        yield f"the guard of {edge.name}, {edge.surface.text}", edge.surface.residual
        if edge.condition is not None:
            yield f"the condition of {edge.name}", edge.condition
    for wall in mode.walls:
        yield f"the domain's {wall.text}", wall.residual


def _diagnosis(mode: Mode, names: Names):
    mapping, arguments = names.mapping(mode.states), (TIME, *names.of_states(mode.states))
    done: dict[sp.Basic, sp.Basic] = {}
    places = {argument: i for i, argument in enumerate(arguments)}
    for k, (_, expression) in enumerate(_expressions(mode)):
        result = replaced(sp.sympify(expression), mapping, done)
        yield Definition(f"expression_{k}", arguments, (result,), places=places)


def _mode_routines(mode: Mode, names: Names):
    states = names.of_states(mode.states)
    mapping = names.mapping(mode.states)
    arguments = (TIME, *states)
    done: dict[sp.Basic, sp.Basic] = {}

    def place(expressions):
        return tuple(replaced(sp.sympify(e), mapping, done) for e in expressions)

    surfaces = [edge.surface for edge in mode.edges] + list(mode.walls)
    flow = place(mode.flow)
    residuals = place(s.residual for s in surfaces)
    sides = place(absolute(s.left) + absolute(s.right) for s in surfaces)
    outputs = place(_NAN if output is None else output for output in mode.outputs)

    yield Definition("flow", arguments, flow)
    yield Definition("surfaces", arguments, residuals)
    yield Definition("magnitudes", arguments, sides)
    yield Definition("outputs", arguments, outputs)
    for k, residual in enumerate(residuals):
        slope = Gradient((residual,), arguments)
        row, along = slope.sparse[0], dict(zip(arguments, (sp.S.One, *flow), strict=True))
        rate = sp.Add(*(d * along[argument] for argument, d in row.items()))
        yield Definition(f"gradient_{k}", arguments, slope.rows[0], slope.statements)
        yield Definition(f"rate_{k}", arguments, (rate,), slope.statements)
    for k, edge in enumerate(mode.edges):
        condition = sp.true if edge.condition is None else edge.condition
        for i, part in enumerate(condition.args if isinstance(condition, sp.And) else (condition,)):
            yield Definition(f"condition_{k}_{i}", arguments, place([part]))
    scales = names.of_states(mode.states, "s")
    for k, edge in enumerate(mode.edges):
        reset = place(edge.reset)
        yield Definition(f"reset_{k}", arguments, reset)
        changes = Gradient(reset, states)
        sizes, own = dict(zip(states, scales, strict=True)), set(states)
        spreads = tuple(_spread(r, row, own, sizes) for r, row in zip(reset, changes.sparse, strict=True))
        yield Definition(f"spread_{k}", (*arguments, *scales), spreads, changes.statements)


def _spread(value: sp.Expr, slopes, states, scales):
    parts = sp.Add(*(absolute(slope) * scales[state] for state, slope in slopes.items()))
    return parts if value in states else maximum(absolute(value), parts)
