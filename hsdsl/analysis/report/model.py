"""A model as notebooks display it: parameters, the graph of its modes, and their equations as MathML."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

from hsdsl.analysis.report import mode_graph
from hsdsl.analysis.report.mathml import Mathematics
from hsdsl.analysis.report.visited import visited_part
from hsdsl.base.names import called, counted, shown, visible_lines, without_memory
from hsdsl.base.parts import written_edges, written_modes
from hsdsl.language.elaborate.functions import named_functions
from hsdsl.language.expression.scope import state
from hsdsl.language.system import Edge, HybridSystem, Mode
from hsdsl.mathematics.program import Program

MOST_MODES, MOST_OPEN = 40, 4  # modes that are shown; that are unfolded
MOST_ROWS, MOST_EQUATIONS = 30, 60  # of a table; of a mode
CSS = ".hsdsl summary { cursor: pointer } .hsdsl ul { margin: .2rem 0 } .hsdsl .modes { max-width: 60rem }"


def model_html(system: HybridSystem, program: Program) -> str:
    """Return the model in a ``div``; every text of the model is escaped, and nothing is fetched."""
    parameters = {parameter.name: state(parameter.name) for parameter in system.parameters}
    math = Mathematics(system.names, named_functions(system.functions, parameters))
    written = written_modes(system.modes)
    kind, number = ("part", len(system.parts)) if system.parts else ("mode", len(written))
    count = f"{number} {kind}{'s' * (number != 1)}"
    heading = f"<p><strong>{_said(called(system.title, system.path))}</strong><br>{count}, {_start(system, math)}</p>"
    modes = [_mode(system, mode, math, len(written) <= MOST_OPEN) for mode in written[:MOST_MODES]]
    left = len(written) - MOST_MODES
    more = [f"<p>{left} more modes</p>"] if left > 0 else []
    parts = [
        heading,
        _parameters(system),
        _parts(system),
        _shared(system, math),
        mode_graph.graph_of(visited_part(program, None)),
        *modes,
        *more,
    ]
    return f'<div class="hsdsl"><style>{mode_graph.CSS}{CSS}</style>{"".join(parts)}</div>'


def _said(text: str) -> str:
    return escape(visible_lines(text))


def _start(system: HybridSystem, math: Mathematics) -> str:
    initial, until = system.initial, math.value(system.experiment.until)
    numbers = {part.name for part in system.parts if part.is_numbered}
    seen = {*without_memory(dict(initial.values))} - numbers
    start = [(name, value) for name, value in initial.values if name in seen]
    values = ", ".join(f"{_said(name)} = {math.value(value)}" for name, value in start[:MOST_ROWS])
    values += ", ..." if len(start) > MOST_ROWS else ""
    where = "" if system.parts else f" in {_said(initial.mode)}"
    return f"starts{where}{' at ' if values else ''}{values}, until {until}"


def _parameters(system: HybridSystem) -> str:
    rows = [(p.name, p.text, p.unit or "", p.about or "") for p in system.parameters[:MOST_ROWS]]
    left = len(system.parameters) - MOST_ROWS
    rows += [(f"{left} more", "", "", "")] if left > 0 else []
    return _table(("parameter", "value", "unit", "meaning"), rows)


def _parts(system: HybridSystem) -> str:
    """The parts of a composed model, with their modes: its product modes are as many as their product."""
    rows = [(part.name, ", ".join(part.modes), part.modes[part.start]) for part in system.parts[:MOST_ROWS]]
    left = len(system.parts) - MOST_ROWS
    return _table(("part", "modes", "starts in"), [*rows, *([(f"{left} more", "", "")] if left > 0 else [])])


def _table(names: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    used = [k for k in range(len(names)) if any(row[k] for row in rows)]
    if not rows:
        return ""
    head = "".join(f"<th>{names[k]}</th>" for k in used)
    body = "".join("<tr>" + "".join(f"<td>{_said(row[k])}</td>" for k in used) + "</tr>" for row in rows)
    return f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"


def _shared(system: HybridSystem, math: Mathematics) -> str:
    """Inputs, and definitions of the whole model."""
    inputs = [f"{_said(given.name)} is an input of {counted(len(given.times), 'sample')}" for given in system.inputs]
    return _list([*inputs, *_definitions(system, None, math)])


def _definitions(system: HybridSystem, mode: str | None, math: Mathematics) -> list[str]:
    return [math.equation(math.name(d.name), d.text) for d in system.definitions if d.mode == mode][:MOST_ROWS]


def _list(items: Sequence[str]) -> str:
    return "<ul>" + "".join(f"<li>{item}</li>" for item in items) + "</ul>" if items else ""


def _mode(system: HybridSystem, mode: Mode, math: Mathematics, unfolded: bool) -> str:
    seen = {*without_memory(mode.states)} - {part.name for part in system.parts if part.is_numbered}
    flows = zip(mode.states, mode.flow_texts, strict=True)
    flow = [math.derivative(name, text) for name, text in flows if name in seen]
    walls = [f"domain: {math.inequality(wall.text)}" for wall in mode.walls]
    written = written_edges(mode.edges)
    edges = [_edge(edge, math, not system.parts) for edge in written[:MOST_EQUATIONS]]
    edges += [f"{len(written) - MOST_EQUATIONS} more transitions"] * (len(written) > MOST_EQUATIONS)
    items = [*flow[:MOST_EQUATIONS], *([f"{len(flow) - MOST_EQUATIONS} more"] * (len(flow) > MOST_EQUATIONS))]
    items += [*_definitions(system, mode.name, math), *walls, *edges]
    name = f"{_said(shown(mode.name))}{' (final)' if mode.final else ''}"
    opened = " open" if unfolded else ""
    summary = "equations of all parts" if system.parts else f"mode <strong>{name}</strong>"
    return f"<details{opened}><summary>{summary}</summary>{_list(items)}</details>"


def _edge(edge: Edge, math: Mathematics, named: bool) -> str:
    """A transition; ``named`` says that its target has a name that people gave."""
    condition = f" if {math.condition(edge.condition_text)}" if edge.condition_text else ""
    when = f"when {math.inequality(edge.surface.text)}{condition}"
    if edge.of_event:
        _, event, *options = edge.of_event
        when = ", ".join([f"event {math.condition(event)}", *map(_said, options)])
    resets = zip(edge.target_states, edge.reset_texts, strict=True)
    seen = without_memory(edge.target_states)
    changed = ", ".join(math.reset(name, text) for name, text in resets if text != name and name in seen)
    ends = f"<strong>{_said(edge.name)}</strong>{f' to {_said(edge.target)}' if named else ''}"
    return f"{ends} {when}{': ' if changed else ''}{changed}"
