"""The automata and the instances of a model as LaTeX; their product is not written."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from hsdsl.export.automata import Automaton, Pairs, automata_of, pairs
from hsdsl.export.latex.mathematics import Mathematics, equations, escaped, stacked
from hsdsl.export.source import Source


def of_parts(source: Source, math: Mathematics) -> Iterator[str]:
    """The sections of a system of parts: definitions of the file, its automata, and their instances."""
    found = automata_of(source)
    lets = pairs(found.document.let)
    yield from [r"\subsection*{Definitions}", *_defined(lets, math)] if lets else []
    for automaton in found.automata:
        yield from _automaton(automaton, math)
    yield from [r"\subsection*{Instances}", r"\begin{itemize}"]
    for group in found.groups:
        initial = group.given.initial
        mode = f", starting in mode {escaped(initial.mode.value)}" if initial and initial.mode else ""
        extra = pairs(initial.__pydantic_extra__ or {}) if initial else []
        rows = [(math.symbol(name), math.expression(text)) for name, text in pairs(group.given.inputs)]
        rows += [(math.symbol(name), math.expression(text)) for name, text in pairs(group.given.parameters)]
        rows += [(rf"{math.symbol(name)}(0)", math.expression(text)) for name, text in extra]
        colon = ":" if rows else "."
        kind = escaped(group.given.automaton.value)
        yield rf"\item \textbf{{{escaped(group.label)}}}, of the automaton {kind}{mode}{colon}"
        yield from equations(rows)
        if group.ends:
            yield from ["Beyond its ends", *_defined(group.ends, math)]
    yield r"\end{itemize}"
    outputs = pairs(found.document.outputs)
    yield from [r"\subsection*{Outputs}", *_defined(outputs, math)] if outputs else []


def _defined(given: Pairs, math: Mathematics) -> list[str]:
    return equations([(math.symbol(name), math.expression(text)) for name, text in given])


def _automaton(automaton: Automaton, math: Mathematics) -> Iterator[str]:
    yield rf"\subsection*{{Automaton {escaped(automaton.name)}}}"
    if automaton.parameters:
        yield from ["Parameters", *_defined(automaton.parameters, math)]
    if automaton.document.inputs:
        listed = ", ".join(rf"\({math.symbol(str(name))}\)" for name in automaton.document.inputs)
        yield from [rf"Inputs {listed}.", ""]
    shared = pairs(automaton.document.let)
    if shared:
        yield from ["Definitions", *_defined(shared, math)]
    outputs = pairs(automaton.document.outputs)
    if outputs:
        yield from ["Outputs", *_defined(outputs, math)]
    for name, mode in automaton.modes:
        yield from _mode(name, mode, math)


def _mode(name: str, mode: Any, math: Mathematics) -> Iterator[str]:
    end = ", final" if mode.final else ""
    yield rf"\subsubsection*{{Mode {escaped(name)}{end}}}"
    flow = pairs(mode.flow or {})
    yield from equations([(rf"\dot{{{math.symbol(state)}}}", math.expression(text)) for state, text in flow])
    own = pairs(mode.let)
    yield from ["with", *_defined(own, math)] if own else []
    if mode.domain:
        yield from ["The flow is meant where", *stacked([math.inequality(scalar.value) for scalar in mode.domain])]
    if mode.transitions:
        yield r"\begin{itemize}"
        for made in mode.transitions:
            label = rf"\textbf{{{escaped(made.name.value)}}} " if made.name else ""
            fires = rf"when \({math.inequality(made.when.value)}\) is reached" if made.when else ""
            fires = fires or rf"together with \texttt{{{escaped(made.on.value)}}}"
            condition = rf" while \({math.condition(made.condition.value)}\)" if made.condition else ""
            changed = [(rf"{math.symbol(state)}^{{+}}", math.expression(text)) for state, text in pairs(made.reset)]
            target = made.target or name
            priority = f", with priority {made.priority}" if made.priority else ""
            yield rf"\item {label}to {escaped(target)}, {fires}{condition}{priority}" + (":" if changed else ".")
            yield from equations(changed)
        yield r"\end{itemize}"
    yield ""
