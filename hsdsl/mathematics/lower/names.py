# pyright: basic, reportArgumentType=false, reportAttributeAccessIssue=false, reportOperatorIssue=false, reportAssignmentType=false, reportIncompatibleMethodOverride=false, reportCallIssue=false
"""Numbered symbols for the names of a model."""

from __future__ import annotations

from dataclasses import dataclass

import sympy as sp

from hsdsl.language.expression.scope import slope_symbol, symbol
from hsdsl.language.system import TIME, HybridSystem


@dataclass(frozen=True)
class Names:
    """The numbered symbols for the file's names in generated code.

    ``data`` has the arguments of `bind`; ``shared`` maps parameters, sampled inputs, their slopes and switches;
    ``inputs`` has the value of each sampled input at the start of its segment, whose slope by the input is 1.
    """

    parameters: tuple[sp.Symbol, ...]
    data: tuple[sp.Symbol, ...]
    shared: dict[sp.Symbol, sp.Expr]
    inputs: tuple[sp.Symbol, ...] = ()


def number(system: HybridSystem, switches: tuple[sp.Symbol, ...] = ()) -> Names:
    """The numbered symbols for the names of a system."""
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
