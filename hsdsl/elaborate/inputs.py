# pyright: basic
"""Inputs: expressions of time, which are substituted, and samples, which stay symbols."""

from __future__ import annotations

from fractions import Fraction
from itertools import pairwise
from typing import Any

from hsdsl.elaborate.samples import read_samples
from hsdsl.elaborate.symbols import Meanings, SymbolTable
from hsdsl.expression.scope import Refusal, Scope, Value, symbol
from hsdsl.schema import InputFile, InputSamples
from hsdsl.source import Key, Scalar
from hsdsl.system import SampledInput


def define_inputs(symbols: SymbolTable) -> tuple[SampledInput, ...]:
    """The sampled inputs; what the name of every input means goes to ``symbols.values``."""
    feedback = "write expressions of states under `let`, or in `flow` itself"
    names, hint = symbols.document.inputs, "combine them under `let`"
    refusals: Meanings = {
        str(name): Refusal("HS117", f"'{name}' is an input; an input cannot use another input", hint) for name in names
    }
    sentence = "an input is an expression of t and parameters"
    timed = symbols.scope(("time", "parameters"), sentence, refusals, hint=feedback)
    constant = symbols.scope(("parameters",), "samples are numbers or expressions of parameters")
    inputs: list[SampledInput] = []
    for name, entry in symbols.document.inputs.items():
        if isinstance(entry, Scalar):
            symbols.values[name] = symbols.number(entry, timed)
            continue
        symbols.values[name] = Value(symbol(name))
        in_file = isinstance(entry, InputFile)
        samples = read_samples(symbols, name, entry.file) if in_file else _inline(symbols, name, entry, constant)
        if samples is not None:
            unit = symbols.text(symbols.document.units.get(name))
            inputs.append(SampledInput(str(name), entry.hold, samples[0], samples[1], unit))
    return tuple(inputs)


def _inline(symbols: SymbolTable, name: Key, entry: InputSamples, scope: Scope) -> Any:
    times = symbols.numbers(entry.times, scope, finite_now=True)
    values = symbols.numbers(entry.values, scope, finite_now=True)
    if len(entry.times) != len(entry.values):
        message = f"the input '{name}' has {len(entry.times)} times and {len(entry.values)} values"
        symbols.report(name.place, "HS310", message, "give one value for each time")
        return None
    if not entry.times:
        symbols.report(name.place, "HS310", f"the input '{name}' has no samples", "give at least one")
        return None
    if times is None or values is None:
        return None
    for (before, after), scalar in zip(pairwise(times), entry.times[1:], strict=True):
        if before.constant and after.constant and not before.number < after.number:
            message = f"the times of the input '{name}' do not increase here"
            symbols.report(scalar.place, "HS310", message, "give each time once, the earliest first")
    return tuple(map(_exact, times)), tuple(map(_exact, values))


def _exact(value: Value) -> Any:
    """An exact number where there is one."""
    return Fraction(int(value.expr.p), int(value.expr.q)) if value.expr.is_Rational else value.expr
