# pyright: basic
"""Documents to mathematics: names resolved, everything substituted, every error found."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NoReturn

from hsdsl import limits
from hsdsl.elaborate.definitions import define_lets, define_parameters
from hsdsl.elaborate.experiment import elaborate_experiment, elaborate_initial
from hsdsl.elaborate.inputs import define_inputs
from hsdsl.elaborate.modes import elaborate_modes
from hsdsl.elaborate.outputs import elaborate_outputs
from hsdsl.elaborate.reference import elaborate_reference
from hsdsl.elaborate.resolver import ExpressionResolver, resolved_expression
from hsdsl.elaborate.symbols import SymbolTable
from hsdsl.elaborate.units import elaborate_units
from hsdsl.errors import TOO_LONG, Diagnostic, Findings, ModelError, UsageError
from hsdsl.expression.scope import Refusal, Scope, Value, symbol
from hsdsl.expression.stack import deep_stack
from hsdsl.expression.syntax import ExpressionError
from hsdsl.expression.timebox import PARTS, OutOfTime, timebox
from hsdsl.files import digest_of, read_bytes
from hsdsl.schema import ModelDocument, read
from hsdsl.source import Node, Text, compose, decode
from hsdsl.system import HybridSystem

__all__ = ["Reading", "elaborate", "elaborate_with_places", "parameter_expression"]


@dataclass(frozen=True)
class Reading:
    """A hybrid system beside what it was made from, where every part of it has its place.

    The parts correspond by their order: ``system.modes[i].edges[k]`` is the k-th of the transitions of the i-th of
    ``document.modes``, and likewise for walls, flows and outputs.

    Attributes
    ----------
    system : HybridSystem
        The mathematics.
    document : ModelDocument
        Keys and scalars as they stand in the file, each with its place.
    root : Node
        The nodes of the file, whose mappings and lists have places too.
    text : Text
        The file.
    scopes : dict of str to Scope
        What names mean in the expressions of each mode.
    top : Scope
        What names mean outside the modes.
    """

    system: HybridSystem
    document: ModelDocument
    root: Node
    text: Text
    scopes: dict[str, Scope]
    top: Scope


def elaborate(
    path: str | os.PathLike[str], *, text: bytes | None = None, files: Mapping[str, bytes] | None = None
) -> HybridSystem:
    """The hybrid system that a model file describes.

    Parameters
    ----------
    path : path
        The model file.
    text : bytes, optional
        Its content, where it is not to be read from ``path``.
    files : mapping, optional
        The content of its data files by name, where they are not to be read.

    Returns
    -------
    HybridSystem
        (J, Gamma, D, U, F, G, R) of Burden et al. 2013, Definition 7, as SymPy expressions.

    Raises
    ------
    ModelError
        The model has errors; all that were found are carried, in source order.
    UsageError
        The file cannot be read.
    """
    return elaborate_with_places(path, text=text, files=files).system


def elaborate_with_places(
    path: str | os.PathLike[str], *, text: bytes | None = None, files: Mapping[str, bytes] | None = None
) -> Reading:
    """The hybrid system that a model file describes, beside the places its parts have there.

    Parameters and errors are those of :func:`elaborate`.
    """
    shown_path = os.fspath(path)
    data = read_bytes(path) if text is None else text
    findings = Findings(shown_path)
    source = decode(shown_path, data)
    root = compose(source, findings)
    document = read(root, findings)
    resolver = ExpressionResolver(findings)
    symbols = SymbolTable.of(document, resolver, shown_path, files)
    try:
        with deep_stack(), timebox(limits.current().seconds, PARTS) as resolver.box:
            parts = _parts(symbols)
    except OutOfTime:
        _say_too_long(resolver)
    findings.raise_if_any()
    digest = digest_of(data, symbols.files.values())
    title, about = symbols.text(document.title), symbols.text(document.source)
    try:
        system = HybridSystem(path=shown_path, digest=digest, title=title, source=about, files=symbols.files, **parts)
    except ValueError as error:  # a check at birth that no diagnostic foresaw
        raise ModelError([source.diagnostic("HS204", str(error), source.span(1, 1))]) from error
    top = symbols.scope(("time", "parameters", "inputs", "states", "let"), "")
    return Reading(system, document, root, source, symbols.scopes, top)


def _say_too_long(resolver: ExpressionResolver) -> NoReturn:
    message = "working this expression out takes too long"
    hint = "make parts of it states, or allow more time with --limit seconds=600"
    if resolver.at is not None:
        resolver.add(resolver.at.place, TOO_LONG, message, hint)
    resolver.findings.raise_if_any()
    raise ModelError([Diagnostic(TOO_LONG, message, None, hint)])


def _parts(symbols: SymbolTable) -> dict[str, Any]:
    """Everything of a system, in the order in which its parts build upon each other."""
    parameters = define_parameters(symbols)
    inputs = define_inputs(symbols)
    define_lets(symbols)
    outputs = elaborate_outputs(symbols)
    modes = elaborate_modes(symbols, outputs)
    initial = elaborate_initial(symbols)
    experiment = elaborate_experiment(symbols)
    units = elaborate_units(symbols)
    reference = elaborate_reference(symbols, modes)
    return dict(
        parameters=parameters,
        inputs=inputs,
        modes=modes,
        outputs=symbols.all_outputs,
        units=units,
        initial=initial,
        experiment=experiment,
        reference=reference,
    )


def parameter_expression(system: HybridSystem, text: str, where: str, allowed: Sequence[str] | None = None) -> Any:
    """An expression of a model's parameters that is not in its file: the VALUE of ``--set NAME=VALUE``.

    Parameters
    ----------
    system : HybridSystem
        The model.
    text : str
        The expression; a plain number is one.
    where : str
        What it is for, which begins the sentence of an error: ``"--set c"``.
    allowed : sequence of str, optional
        The parameters it may use; all of them unless given.

    Returns
    -------
    sympy.Expr

    Raises
    ------
    UsageError
        It is not an expression, or uses something else.
    """
    usable = {p.name for p in system.parameters} if allowed is None else set(allowed)
    scope = Scope(_override_values(system, usable), place=where)
    try:
        with deep_stack(), timebox(limits.current().seconds / PARTS):
            return resolved_expression(text, scope).expr
    except ExpressionError as error:
        raise UsageError(f"{where}: {error.message}", error.hint) from None
    except OutOfTime:
        raise UsageError(f"{where}: working this expression out takes too long") from None


def _override_values(system: HybridSystem, usable: set[str]) -> dict[str, Value | Refusal | None]:
    states = [name for mode in system.modes for name in mode.states]
    others = {"t": "the time", **dict.fromkeys(states, "a state")}
    others.update(dict.fromkeys((i.name for i in system.inputs), "an input"))
    values: dict[str, Value | Refusal | None] = {
        name: Refusal("HS117", f"'{name}' is {kind}; only parameters can be used here") for name, kind in others.items()
    }
    for parameter in system.parameters:
        name = parameter.name
        late = Refusal("HS302", f"'{name}' cannot be used here: only earlier parameters can")
        values[name] = Value(symbol(name)) if name in usable else late
    return values
