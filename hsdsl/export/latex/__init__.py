"""A model as mathematics: one LaTeX document with its modes, flows, domains and transitions."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from hsdsl.base.errors import UsageError
from hsdsl.base.graphs import closure
from hsdsl.base.names import without_memory
from hsdsl.export.automata import Automaton, Pairs, automata_of, document_of, pairs, texts
from hsdsl.export.latex.mathematics import Mathematics, equations, escaped, stacked
from hsdsl.export.source import Source
from hsdsl.language.elaborate.definitions import named_functions
from hsdsl.language.expression.plain import names_in
from hsdsl.language.expression.scope import state
from hsdsl.language.schema.documents import ModeDocument, ModelDocument, TransitionDocument
from hsdsl.language.system import Edge, HybridSystem, Mode

_HEAD = r"""\documentclass[11pt,a4paper]{article}
\usepackage[margin=25mm]{geometry}
\usepackage{amsmath}
\usepackage{amssymb}
\setlength{\parindent}{0pt}
\setlength{\parskip}{4pt}
\allowdisplaybreaks
\renewcommand{\labelitemi}{\(\bullet\)}
\begin{document}
"""


def files(source: Source) -> dict[str, bytes]:
    """One document that needs no other file."""
    return {f"{source.name}.tex": document(source).encode()}


def document(source: Source) -> str:
    """The text of the document."""
    system = source.system
    if system.unknowns:
        raise UsageError("a model with `solve` cannot be written as LaTeX", "write its solutions under `let`")
    parameters = {parameter.name: state(parameter.name) for parameter in system.parameters}
    math = Mathematics(system.names, named_functions(system.functions, parameters))
    lines = [*(f"% {line}" for line in source.heading), _HEAD, rf"\section*{{{escaped(system.title or source.name)}}}"]
    lines += [escaped(system.source), ""] if system.source else []
    lines += _parameters(source, math)
    lines += _inputs(system, math)
    if system.parts:
        return "\n".join([*lines, *_of_parts(source, math), *_settings(source), r"\end{document}", ""])
    written = document_of(source)
    assert isinstance(written, ModelDocument)
    modes = {str(name): mode for name, mode in written.modes.items()}
    own = [(mode, modes[mode.name]) for mode in system.modes if mode.name in modes]  # others are those of events
    used = [text for mode, as_written in own for text in _texts(mode, as_written)]
    shared = _where(system, None, [*used, *texts(written.outputs)], math)
    lines += [r"\subsection*{Definitions}", *shared] if shared else []
    for mode, as_written in own:
        lines += _mode(system, mode, as_written, math)
    lines += _outputs(pairs(written.outputs), system, math)
    lines += _run(source, math)
    return "\n".join([*lines, r"\end{document}", ""])


def _parameters(source: Source, math: Mathematics) -> list[str]:
    own = [p for p in source.system.parameters if "." not in p.name]  # others are those of parts
    if not own:
        return []
    given = source.problem.settings.overrides
    values = [(p, math.expression(str(given.get(p.name, p.text)))) for p in own]
    columns = [("symbol", [rf"\({math.name(p.name)}\)" for p, _ in values])]
    columns += [("value", [rf"\({value}\)" for _, value in values])]
    columns += [("unit", [escaped(p.unit or "") for p, _ in values])]
    columns += [("meaning", [escaped(p.about or "") for p, _ in values])]
    columns = [(title, cells) for title, cells in columns if any(cells)]
    head = " & ".join(title for title, _ in columns)
    rows = [" & ".join(row) for row in zip(*(cells for _, cells in columns), strict=True)]
    table = [rf"\begin{{tabular}}{{@{{}}{'l' * len(columns)}@{{}}}}", rf"{head} \\ \hline", " \\\\\n".join(rows)]
    return [r"\subsection*{Parameters}", *table, r"\end{tabular}", ""]


def _inputs(system: HybridSystem, math: Mathematics) -> list[str]:
    lines: list[str] = []
    for given in system.inputs:
        held = "straight lines between" if given.hold == "linear" else "steps at"
        count = len(given.times)
        lines.append(rf"\({math.name(given.name)}(t)\): {held} {count} samples{_unit(given.unit)}.")
        lines.append("")
    return [r"\subsection*{Inputs}", *lines] if lines else []


def _unit(unit: str | None) -> str:
    return f" in {escaped(unit)}" if unit else ""


def _outputs(given: Pairs, system: HybridSystem, math: Mathematics) -> list[str]:
    names = (f"{math.name(name)}{_unit_after(system, name)}" for name, _ in given)
    lines = equations([(name, math.expression(text)) for name, (_, text) in zip(names, given, strict=True)])
    return [r"\subsection*{Outputs}", *lines] if given else []


def _unit_after(system: HybridSystem, name: str) -> str:
    unit = system.units.get(name)
    return rf"\ \text{{({escaped(unit)})}}" if unit else ""


def _mode(system: HybridSystem, mode: Mode, written: ModeDocument, math: Mathematics) -> list[str]:
    end = ", final" if mode.final else ""
    lines = [rf"\subsection*{{Mode {escaped(mode.name)}{end}}}"]
    states = without_memory(mode.states)
    if states:
        lines.append("States " + ", ".join(_state(system, math, name) for name in states) + ".")
    flow = [(s, text) for s, text in zip(mode.states, mode.flow_texts, strict=True) if s in states]
    lines += equations([(rf"\dot{{{math.name(s)}}}", math.expression(text)) for s, text in flow])
    own = _where(system, mode.name, [*_texts(mode, written), *texts(written.outputs)], math)
    lines += ["with", *own] if own else []
    given = [(math.name(name), math.expression(text)) for name, text in pairs(written.outputs)]
    lines += ["and the outputs", *equations(given)] if given else []
    if mode.walls:
        lines += ["The flow is meant where", *stacked([math.inequality(wall.text) for wall in mode.walls])]
    edges = [edge for edge in mode.edges if not edge.of_event]
    events = [made for made in written.transitions if made.event is not None]
    if edges or events:
        lines.append(r"\begin{itemize}")
        for edge in edges:
            when = rf"when \({math.inequality(edge.surface.text)}\) is reached"
            condition = rf" while \({math.condition(edge.condition_text)}\)" if edge.condition_text else ""
            changed = [(rf"{math.name(name)}^{{+}}", math.expression(text)) for name, text in _changes(edge)]
            priority = f", with priority {edge.priority}" if edge.priority else ""
            line = rf"\item \textbf{{{escaped(edge.name)}}} to {escaped(edge.target)}, {when}{condition}{priority}"
            lines += [line + (":" if changed else "."), *equations(changed)]
        for made in events:
            lines += _event(mode.name, made, math)
        lines.append(r"\end{itemize}")
    return [*lines, ""]


def _state(system: HybridSystem, math: Mathematics, name: str) -> str:
    unit = system.units.get(name)
    return rf"\({math.name(name)}\)" + (f" ({escaped(unit)})" if unit else "")


def _texts(mode: Mode, written: ModeDocument) -> list[str]:
    found = [*mode.flow_texts, *(wall.text for wall in mode.walls)]
    for edge in mode.edges:
        if not edge.of_event:
            found += [edge.surface.text, edge.condition_text or "0", *(text for _, text in _changes(edge))]
    for made in written.transitions:
        given = (made.event, made.delay) if made.event is not None else ()
        found += [scalar.value for scalar in given if scalar is not None]
        found += texts(made.reset) if given else []
    return found


def _where(system: HybridSystem, mode: str | None, texts: Iterable[str], math: Mathematics) -> list[str]:
    """The definitions that texts use and that are a mode's own, or the whole model's, in the file's order."""
    known = {d.name: d for d in system.definitions if d.mode is None}
    known |= {d.name: d for d in system.definitions if mode is not None and d.mode == mode}
    named = (name for text in texts for name in names_in(text))
    needed = closure(named, lambda name: names_in(known[name].text) if name in known else ())
    used = [definition for definition in known.values() if definition.name in needed and definition.mode == mode]
    return equations([(math.name(d.name), math.expression(d.text)) for d in used])


def _changes(edge: Edge) -> Pairs:
    """What a reset changes, but for what events remember."""
    known = without_memory(edge.target_states)
    resets = zip(edge.target_states, edge.reset_texts, strict=True)
    return [(name, text) for name, text in resets if name in known and text != name]


def _event(mode: str, made: TransitionDocument, math: Mathematics) -> list[str]:
    """A transition where a condition turns true, with its options as they are written."""
    assert made.event is not None
    label = rf"\textbf{{{escaped(made.name.value)}}}, " if made.name else ""
    target = made.target or mode
    when = rf"where \({math.condition(made.event.value)}\) turns true"
    delay = rf", after \({math.expression(made.delay.value)}\)" if made.delay else ""
    options = "".join(f", {escaped(option)}" for option in made.options if not option.startswith("delay "))
    changed = [(rf"{math.name(name)}^{{+}}", math.expression(text)) for name, text in pairs(made.reset)]
    line = rf"\item {label}to {escaped(target)} {when}{delay}{options}"
    return [line + (":" if changed else "."), *equations(changed)]


def _run(source: Source, math: Mathematics) -> list[str]:
    """Where a run starts, and its settings."""
    problem, settings = source.problem, source.problem.settings
    given = settings.overrides
    initial = dict(source.system.initial.values)
    values: list[tuple[str, str]] = []
    known = without_memory(problem.states)
    for name, number in zip(problem.states, problem.x, strict=True):
        if name not in known:
            continue
        text = given.get(f"initial.{name}")
        value = initial.get(name, number) if text is None else None
        values.append((rf"{math.name(name)}(0)", math.expression(str(text)) if value is None else math.number(value)))
    start = escaped(problem.program.modes[problem.mode].name)
    lines = [r"\subsection*{Run}", rf"It starts in mode {start}" + (" at" if values else "."), *equations(values)]
    return [*lines, *_settings(source)]


def _settings(source: Source) -> list[str]:
    return [rf"{escaped(line)}. \par" for line in source.heading[-3:] if line.startswith(("scheme", "with"))]


def _of_parts(source: Source, math: Mathematics) -> Iterator[str]:
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
