"""The mode graph of a model as a Mermaid state diagram: modes with their flow, transitions with guard and reset."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

from hsdsl.base.names import visible, without_memory
from hsdsl.base.parts import event_text, written_edges, written_modes
from hsdsl.export.automata import Automata, automata_of, pairs
from hsdsl.export.source import Source
from hsdsl.language.system import Edge

_ALIKE = str.maketrans({"*": "\u2217", "`": "\u02cb", "~": "\u223c"})
_OUTER = re.compile(r"(?<![^\W_])_|_(?![^\W_])")  # underscores that are not inside a word


def files(source: Source) -> dict[str, bytes]:
    return {f"{source.name}.mmd": diagram(source).encode()}


def diagram(source: Source) -> str:
    """The text of the diagram.

    Modes are ``m0, m1, ...``, since a name of the model may be a word of the diagram's language.
    """
    numbers = {mode.name: f"m{k}" for k, mode in enumerate(source.system.modes)}
    comments = (line.replace("{", "(").replace("}", ")") for line in source.heading)  # braces would open a directive
    lines = [*(f"%% {line}" for line in comments), "stateDiagram-v2"]
    if source.system.parts:
        return "\n".join([*lines, *_automata(automata_of(source))]) + "\n"
    modes = written_modes(source.system.modes)
    for mode in modes:
        flows = dict(zip(mode.states, mode.flow_texts, strict=True))
        flow = [f"d{name}/dt = {flows[name]}" for name in without_memory(mode.states)]
        text = _label([mode.name, *flow, *(f"domain {wall.text}" for wall in mode.walls)])
        lines.append(f"    {numbers[mode.name]} : {text}")
    lines.append(f"    [*] --> {numbers[source.system.modes[source.problem.mode].name]}")
    for mode in modes:
        edges = written_edges(mode.edges)
        lines += [f"    {numbers[mode.name]} --> {numbers[e.target]} : {_label(_edge_lines(e))}" for e in edges]
        lines += [f"    {numbers[mode.name]} --> [*]"] if mode.final else []
    return "\n".join(lines) + "\n"


def _automata(found: Automata) -> Iterator[str]:
    """Each automaton with its modes in it, then the instances with an arrow from each that others depend on."""
    for a, automaton in enumerate(found.automata):
        shared = [f"{name} = {text}" for name, text in (*automaton.parameters, *pairs(automaton.document.let))]
        yield f"    a{a} : {_label([automaton.name, *shared])}"
        yield f"    state a{a} {{"
        names = {name: f"a{a}m{k}" for k, (name, _) in enumerate(automaton.modes)}
        for name, mode in automaton.modes:
            flow = [f"d{state}/dt = {text}" for state, text in pairs(mode.flow or {})]
            own = [f"{key} = {text}" for key, text in pairs(mode.let)]
            own += [f"solve {scalar.value}" for scalar in (mode.solve.equations if mode.solve else ())]
            walls = [f"domain {scalar.value}" for scalar in mode.domain]
            yield f"        {names[name]} : {_label([name, *flow, *own, *walls])}"
        for name, mode in automaton.modes:
            for made in mode.transitions:
                target = made.target or name
                yield f"        {names[name]} --> {names[target]} : {_label(_transition_lines(made))}"
            if mode.final:
                yield f"        {names[name]} --> [*]"
        yield "    }"
    for k, group in enumerate(found.groups):
        settings = [f"{name} = {text}" for name, text in group.settings]
        ends = [f"at the ends {name} = {text}" for name, text in group.ends]
        yield f"    i{k} : {_label([f'{group.label}, {group.given.automaton.value}', *settings, *ends])}"
    for one, other, label in found.links():
        yield f"    i{one} --> i{other} : {_label([label])}"


def _transition_lines(made: Any) -> list[str]:
    name = [made.name.value] if made.name else []
    given = {"event": made.event, "with": made.on, "when": made.when}
    fires = [f"{word} {scalar.value}" for word, scalar in given.items() if scalar is not None][:1]
    condition = [f"if {made.condition.value}"] if made.condition else []
    return [*name, *fires, *condition, *made.options, *(f"{state} := {text}" for state, text in pairs(made.reset))]


def _edge_lines(edge: Edge) -> list[str]:
    resets = zip(edge.target_states, edge.reset_texts, strict=True)
    condition = [] if edge.condition is None else [f"if {edge.condition_text}"]
    priority = [f"priority {edge.priority}"] if edge.priority else []
    when = event_text(edge.of_event) or [f"when {edge.surface.text}", *condition, *priority]
    return [edge.name, *when, *(f"{name} := {text}" for name, text in resets if text != name)]


def _label(lines: list[str]) -> str:
    """Lines of a label: every sign but letters, digits and a few others is an entity, so that no text is syntax.

    Labels are Markdown besides, also where a sign is an entity: a sign of emphasis gives way to one that looks like it.
    """
    texts = (_OUTER.sub("\u02cd", visible(line)).translate(_ALIKE) for line in lines)
    return "<br/>".join("".join(map(_entity, text)) for text in texts)


def _entity(sign: str) -> str:
    return sign if sign.isascii() and (sign.isalnum() or sign in " _.,+-/()") else f"#{ord(sign)};"
