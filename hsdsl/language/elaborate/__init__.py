# pyright: basic
"""Text to mathematics: names resolved, everything substituted, every error reported.

`elaborate_files` is the way of a right model: compose, read, elaborate. A document goes through these, in this
order; `symbols` has what its names mean, and reads its expressions.

================= ===========================================================================
``definitions``   parameters, functions, `let`, `solve` and units; ``inputs``
``modes``         flow, walls, outputs and scene of modes, and their transitions
``parts``         in the place of these: a system of parts as one mode
``experiment``    start, settings, and what is known of runs
``events``        transitions with a memory
``derived``       the time in a mode; smaller systems, and flat ones of parts
================= ===========================================================================
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

from hsdsl.base import limits
from hsdsl.base.errors import TOO_LONG, Diagnostic, Findings, ModelError, UsageError
from hsdsl.base.names import SINCE, shown
from hsdsl.base.parts import Part
from hsdsl.language.elaborate.definitions import (
    define_functions,
    define_lets,
    define_parameters,
    elaborate_units,
    named_functions,
    substituted_definitions,
)
from hsdsl.language.elaborate.derived import with_timers
from hsdsl.language.elaborate.events import with_events
from hsdsl.language.elaborate.experiment import elaborate_experiment, elaborate_initial, elaborate_reference
from hsdsl.language.elaborate.inputs import define_inputs, switch_name
from hsdsl.language.elaborate.modes import elaborate_modes, elaborate_outputs, elaborate_scene, scene_of
from hsdsl.language.elaborate.parts import Parts
from hsdsl.language.elaborate.symbols import SymbolTable, resolved_expression
from hsdsl.language.expression.parse import ExpressionError
from hsdsl.language.expression.scope import Meaning, Refusal, Scope, Value, symbol
from hsdsl.language.expression.timebox import PARTS, OutOfTime, deep_stack, timebox
from hsdsl.language.files import ModelFiles
from hsdsl.language.schema import read
from hsdsl.language.schema.documents import AutomatonDocument, ModelDocument, SystemDocument
from hsdsl.language.source import Node, Text, Unread, compose
from hsdsl.language.system import HybridSystem, switch_parameter

__all__ = ["Elaboration", "drivable", "elaborate", "elaborate_files", "parameter_expression"]


class Elaboration(NamedTuple):
    """A hybrid system and the document it was made from, where every part of it has its place.

    The parts correspond by their order: ``system.modes[i].edges[k]`` is the k-th of the transitions of the i-th of
    ``document.modes``, and likewise for walls, flows and outputs. ``root`` has the nodes of the file ``text``. A scope
    has the meaning of names: ``scopes`` that of each mode, ``top`` that outside the modes. ``before_events`` is the
    system whose events are conditions still, not edges with a memory.
    """

    system: HybridSystem
    document: ModelDocument
    root: Node
    text: Text
    scopes: dict[str, Scope]
    top: Scope
    before_events: HybridSystem


def elaborate(path: str | os.PathLike[str], *, text: bytes | None = None) -> HybridSystem:
    """The hybrid system of a model file; ``text`` is its content, where it is not to be read.

    Raises ModelError: the model has errors; all of them are carried, in source order.
    Raises UsageError: the file cannot be read.
    """
    return elaborate_files(ModelFiles.read(path, text=text)).system


def drivable(files: ModelFiles) -> HybridSystem:
    """The system with each input u that is an expression of time as u_given * expression + u.

    Where the parameter ``u given`` is 1 and the sampled input u is 0, which are their values, it is the same system;
    where the parameter is 0, u can be driven from outside.

    Raises ModelError: the model has errors; all of them are carried, in source order.
    """
    system = elaborate_files(files, drivable=True).system
    switches = (switch_parameter(switch_name(i.name)) for i in system.inputs if i.given is not None)
    return replace(system, parameters=(*system.parameters, *switches))


def elaborate_files(files: ModelFiles, *, drivable: bool = False) -> Elaboration:
    """The hybrid system of a model's bytes: (J, Gamma, D, U, F, G, R) of Burden et al. 2013, Definition 7.

    Raises ModelError: the model has errors; all of them are carried, in source order.
    """
    findings = Findings(files.path)
    with limits.applied(files.limits):
        try:
            text, root, data = compose(files)
            return _elaborated(SymbolTable(read(root), findings, files, data=data, drivable=drivable), root, text)
        except (Unread, ModelError) as error:
            failure = error
        from hsdsl.language.diagnosis.documents import reread  # what was meant, where a stage has failed

        findings = Findings(files.path)
        text, root, data, document = reread(files, findings, failure)
        return _elaborated(SymbolTable(document, findings, files, data=data, drivable=drivable), root, text)


def _elaborated(symbols: SymbolTable, root: Node, text: Text) -> Elaboration:
    try:
        with deep_stack(), timebox(limits.current().seconds, PARTS) as symbols.box:
            conditions = _system(symbols)
            system = with_events(conditions)
            system = with_timers(system) if symbols.timed and not system.parts else system
    except OutOfTime:
        message = "working this expression out takes too long"
        hint = "make parts of it states, or allow more time with --limit seconds=600"
        if symbols.at is not None:
            symbols.report(symbols.at.place, TOO_LONG, message, hint)
        symbols.findings.raise_if_any()
        raise ModelError([Diagnostic(TOO_LONG, message, None, hint)]) from None
    except ValueError as error:  # a check at birth that no diagnostic foresaw
        raise ModelError([text.diagnostic("HS204", str(error), text.span(1, 1))]) from error
    top = symbols.scope(("time", "parameters", "inputs", "states", "let", "unknowns"), "")
    return Elaboration(system, symbols.document, root, text, symbols.scopes, top, conditions)


def _system(symbols: SymbolTable) -> HybridSystem:
    """The system, its parts in the order in which they build upon each other."""
    document = symbols.document
    functions = define_functions(symbols)
    parameters = define_parameters(symbols)
    inputs = define_inputs(symbols)
    parts: tuple[Part, ...] = ()
    of_parts: dict[str, str] = {}
    ranges: tuple[tuple[str, Any, Any], ...] = ()
    if not (isinstance(document, SystemDocument) and (document.system or document.automata)):
        define_lets(symbols)
        modes = elaborate_modes(symbols, elaborate_outputs(symbols))
        scene, numbers = elaborate_scene(symbols)
        modes = tuple(replace(mode, scene=scene_of(symbols, numbers, symbols.scopes[mode.name])) for mode in modes)
        initial, ranges = elaborate_initial(symbols)
    else:
        whole = Parts(symbols, document)
        parameters, parts = parameters + whole.parameters, whole.parts
        modes, scene, initial, of_parts = whole.modes, whole.scene, whole.initial, whole.units
    experiment = elaborate_experiment(symbols)
    units = of_parts | elaborate_units(symbols)
    reference = elaborate_reference(symbols, modes)
    symbols.findings.raise_if_any()
    kinds = document.automata.values() if isinstance(document, SystemDocument) else ()
    tables = (document.modes, *(kind.modes for kind in kinds if isinstance(kind, AutomatonDocument)))
    solves = [document.solve, *(mode.solve for table in tables for mode in table.values())]
    return HybridSystem(
        path=symbols.files.path,
        digest=symbols.files.with_data(symbols.data).digest,
        title=symbols.text(document.title),
        source=symbols.text(document.source),
        parameters=tuple(replace(parameter, unit=units.get(parameter.name)) for parameter in parameters),
        inputs=inputs,
        modes=modes,
        outputs=symbols.all_outputs,
        units=units,
        initial=initial,
        experiment=experiment,
        reference=reference,
        files=symbols.data,
        scene=scene,
        parts=parts,
        definitions=tuple(substituted_definitions(document)),
        functions=functions,
        unknowns=tuple(str(name) for solve in solves if solve is not None for name in solve.unknowns),
        assumptions=(*filter(None, map(symbols.text, document.assumptions)), *_of_ranges(document, ranges)),
        ranges=ranges,
    )


def _of_ranges(document: ModelDocument, ranges: tuple[tuple[str, Any, Any], ...]) -> Iterator[str]:
    """The sentence that a run starts at the centre of an initial box."""
    if ranges:
        given = document.initial.ranges.items()
        sides = ", ".join(f"{name} from {side.min.value} to {side.max.value}" for name, side in given)
        yield f"`initial` has ranges ({shown(sides)}): a run takes the centre of each that it is given no value for"


def parameter_expression(system: HybridSystem, text: str, where: str, allowed: Sequence[str] | None = None) -> Any:
    """An expression of a model's parameters that is not in its file: the VALUE of ``--set NAME=VALUE``.

    ``where`` begins the sentence of an error, as ``"--set c"``; with ``allowed`` only those parameters can be used.

    Raises UsageError: it is not an expression, or uses something else.
    """
    usable = {p.name for p in system.parameters} if allowed is None else set(allowed)
    others = {"t": "the time", SINCE: "the time since the mode was entered", **dict.fromkeys(system.states, "a state")}
    others |= dict.fromkeys((i.name for i in system.inputs), "an input")
    values: dict[str, Meaning] = {
        name: Refusal("HS117", f"'{name}' is {kind}; only parameters can be used here") for name, kind in others.items()
    }
    for name in (parameter.name for parameter in system.parameters):
        late = Refusal("HS302", f"'{name}' cannot be used here: only earlier parameters can")
        values[name] = Value(symbol(name)) if name in usable else late
    scope = Scope(values | named_functions(system.functions, values), place=where)
    try:
        with deep_stack(), timebox(limits.current().seconds / PARTS):
            return resolved_expression(text, scope).expr
    except ExpressionError as error:
        raise UsageError(f"{where}: {error.message}", error.hint) from None
    except OutOfTime:
        raise UsageError(f"{where}: working this expression out takes too long") from None
