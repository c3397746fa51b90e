# pyright: basic, reportArgumentType=false, reportAttributeAccessIssue=false, reportOperatorIssue=false, reportAssignmentType=false, reportIncompatibleMethodOverride=false, reportCallIssue=false
"""Numbered symbols for the names of a model, and the routines of parameters alone: settings, initial values."""

from __future__ import annotations

from typing import NamedTuple

import sympy as sp

from hsdsl.base.functions import replaced
from hsdsl.language.expression.scope import slope_symbol, symbol
from hsdsl.language.expression.timebox import deep_stack
from hsdsl.language.system import TIME, HybridSystem
from hsdsl.mathematics import program as lowered
from hsdsl.mathematics.lower.straight import Definition, print_routines


class Names(NamedTuple):
    """The numbered symbols for the file's names in generated code.

    ``data`` has the arguments of `bind`; ``shared`` maps parameters, sampled inputs, their slopes and switches;
    ``inputs`` has the value of each sampled input at the start of its segment, whose slope by the input is 1.
    """

    parameters: tuple[sp.Symbol, ...]
    data: tuple[sp.Symbol, ...]
    shared: dict[sp.Symbol, sp.Expr]
    inputs: tuple[sp.Symbol, ...] = ()


def number(system: HybridSystem, switches: tuple[sp.Symbol, ...] = ()) -> Names:
    parameters = tuple(symbol(f"p{i}") for i in range(len(system.parameters)))
    shared: dict[sp.Symbol, sp.Expr] = dict(zip(system.parameter_symbols, parameters, strict=True))
    data, starts = list(parameters), list[sp.Symbol]()
    for i, sampled in enumerate(system.inputs):
        start, slope, since = (symbol(f"{letter}{i}") for letter in "abc")
        shared[symbol(sampled.name)] = start + slope * (TIME - since) if sampled.hold == "linear" else start
        shared[slope_symbol(sampled.name)] = slope
        data += [start, slope, since]
        starts.append(start)
    numbers = tuple(symbol(f"k{i}") for i in range(len(switches)))
    shared.update(zip(switches, numbers, strict=True))
    data += numbers
    return Names(parameters, tuple(data), shared, tuple(starts))


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
        return print_routines(constants(system, number(system)), ())


def initial_order(system: HybridSystem) -> tuple[int, ...]:
    """The initial values as they are written in the file, by their numbers."""
    places = {name: i for i, (name, _) in enumerate(system.initial.values)}
    return tuple(places[name] for name, _ in system.initial.written)


def initial_values(system: HybridSystem, names: Names):
    """Each initial value over parameters and others, where they use each other."""
    states = {symbol(name): symbol(f"x{i}") for i, (name, _) in enumerate(system.initial.values)}
    known = names.shared | states
    arguments = (*names.parameters, *states.values())
    places = {argument: i for i, argument in enumerate(arguments)}
    for i, (_, value) in zip(initial_order(system), system.initial.written, strict=True):
        yield Definition(f"initial_{i}", arguments, (replaced(value, known, {}),), places=places)


def ranges_of(system: HybridSystem):
    """The ranges of initial values, of the states that are there."""
    known = dict(system.initial.values)
    return [side for side in system.ranges if side[0] in known]


def constants(system: HybridSystem, names: Names):
    """Values and bounds of parameters, initial values, samples of inputs, settings."""
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
    if ranges := ranges_of(system):
        yield define("least", *(low for _, low, _ in ranges))
        yield define("most", *(high for _, _, high in ranges))
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
    if experiment.every is not None:
        yield define("every", experiment.every)
