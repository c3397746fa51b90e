"""The mode graph of a program as SVG, with the transitions that a run made, and a table of them as HTML."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from html import escape

from hsdsl.analysis.report.graph_layout import STUB, Box, Layout, Line, laid_out
from hsdsl.analysis.report.visited import as_written, visited_part
from hsdsl.base.names import shown, visible, without_memory
from hsdsl.base.parts import event_text
from hsdsl.engine.execution import Execution
from hsdsl.mathematics.program import EdgeProgram, ModeProgram, Program

SIZE, PITCH, LETTER, INSIDE = 13, 18.0, 7.85, 12.0  # of the font, between lines, of a letter, from text to border
LONGEST, MOST_LINES, MOST_MODES = 34, 7, 6  # of a line; of a flow's lines; of modes whose flow is in their box
MOST_DRAWN = 60  # modes of which there is a picture
BADGE = 9.0
CSS = """
.modes text { font: 13px ui-monospace, SFMono-Regular, Menlo, Consolas, "DejaVu Sans Mono", monospace;
  fill: var(--text, currentColor) }
.modes .name { font-weight: 700 }
.modes .box { fill: var(--panel, transparent); stroke: var(--ink, currentColor); stroke-width: 1.2 }
.modes .unused { fill: var(--ground, transparent); stroke: #8b97a3; stroke-dasharray: 4 3 }
.modes .edge { fill: none; stroke: var(--ink, currentColor); stroke-width: 1.4 }
.modes .never { stroke: #8b97a3; stroke-dasharray: 4 3 }
.modes .made { fill: var(--ink, currentColor) }
.modes .badge { fill: #2f5f8f }
.modes .badge.never { fill: #6b7783; stroke: none }
.modes .number { font-size: 10px; fill: #fff; text-anchor: middle }
"""


def mode_graph(program: Program, execution: Execution | None = None) -> str:
    """The graph and its table, as HTML; every text of the model is escaped. Without a run nothing is counted."""
    program = as_written(visited_part(program, execution), execution)
    picture, counts = graph_of(program, execution), _counts(program.edges, program, execution)
    return f"<h2>Modes</h2>\n{picture}\n{_table(program, program.edges, counts)}" if picture else ""


def graph_of(program: Program, execution: Execution | None = None) -> str:
    """The graph alone; empty for a model without transitions, or one with too many modes for a picture."""
    program = as_written(program, execution)
    edges = program.edges
    if not edges or len(program.modes) > MOST_DRAWN:
        return ""
    names = program.mode_names
    counts = _counts(edges, program, execution)
    if execution is None or counts is None:
        return _picture(program, edges, [1] * len(edges), set(names), program.initial_mode)
    first = names.index(execution.arcs[0].mode) if execution.arcs else program.initial_mode
    return _picture(program, edges, counts, {arc.mode for arc in execution.arcs}, first)


def _counts(edges: Sequence[EdgeProgram], program: Program, execution: Execution | None) -> list[int] | None:
    """How often each transition was made; None without a run."""
    if execution is None:
        return None
    made = Counter((t.source, t.edge) for t in execution.transitions)
    return [made[program.modes[edge.source].name, edge.name] for edge in edges]


def _picture(program: Program, edges: Sequence[EdgeProgram], made: Sequence[int], visited: set[str], first: int) -> str:
    texts = [_lines(mode, len(program.modes) <= MOST_MODES) for mode in program.modes]
    sizes = [(max(map(len, lines)) * LETTER + 2 * INSIDE, len(lines) * PITCH + INSIDE) for lines in texts]
    layout = laid_out(sizes, [(edge.source, edge.target) for edge in edges], first)
    parts = [_begin(layout.boxes[first])]
    parts += [_edge(k, line, count) for k, (line, count) in enumerate(zip(layout.lines, made, strict=True), start=1)]
    for mode, lines, box in zip(program.modes, texts, layout.boxes, strict=True):
        parts.append(_box(lines, box, mode.name in visited, mode.final))
    return _svg(layout, parts)


def _svg(layout: Layout, parts: Sequence[str]) -> str:
    arrow = '<path d="M0 0L9 4L0 8z" {}/></marker>'
    markers = "".join(
        f'<marker id="{name}" viewBox="0 0 9 8" refX="9" refY="4" markerWidth="9" markerHeight="8" orient="auto" '
        f'markerUnits="userSpaceOnUse">{arrow.format(colour)}'
        for name, colour in (("made", 'class="made"'), ("never", 'fill="#8b97a3"'))
    )
    size = f'viewBox="0 0 {layout.width:.1f} {layout.height:.1f}" style="max-width: {layout.width:.0f}px"'
    inner = "\n".join(parts)
    return f'<svg class="modes" role="img" aria-label="mode graph" {size}>\n<defs>{markers}</defs>\n{inner}\n</svg>'


def _seen(states: Sequence[str], texts: Sequence[str]) -> list[tuple[str, str]]:
    """The states that a reader sees, and what is written of each."""
    text = dict(zip(states, texts, strict=True))
    return [(name, text[name]) for name in without_memory(states)]


def _lines(mode: ModeProgram, with_flow: bool) -> list[str]:
    """What a box says: the mode's name, and its flow."""
    flow = [f"{name}' = {text}" for name, text in _seen(mode.states, mode.flow_texts)] if with_flow else []
    if len(flow) > MOST_LINES:
        flow = [*flow[: MOST_LINES - 1], f"and {len(flow) - MOST_LINES + 1} more"]
    return [shown(mode.name, LONGEST), *(shown(line, LONGEST) for line in flow)]


def _box(lines: Sequence[str], box: Box, visited: bool, final: bool) -> str:
    """A box with its lines; a final mode has two borders, one that the run did not visit is dashed."""
    kind = "box" if visited else "box unused"
    borders = [_border(box, kind, inset) for inset in ((0, 3) if final else (0,))]
    top = box.y + (box.height - len(lines) * PITCH) / 2 + SIZE
    x, kinds = f"{box.x + INSIDE:.1f}", ["name", *(["line"] * (len(lines) - 1))]
    rows = [
        f'<text class="{kind}" x="{x}" y="{top + i * PITCH:.1f}">{escape(line)}</text>'
        for i, (kind, line) in enumerate(zip(kinds, lines, strict=True))
    ]
    return "".join([*borders, *rows])


def _border(box: Box, kind: str, inset: int) -> str:
    place = f'x="{box.x + inset:.1f}" y="{box.y + inset:.1f}"'
    size = f'width="{box.width - 2 * inset:.1f}" height="{box.height - 2 * inset:.1f}"'
    return f'<rect class="{kind}" {place} {size} rx="{6 - inset}"/>'


def _begin(box: Box) -> str:
    y = box.y + PITCH / 2
    return f'<path class="edge" marker-end="url(#made)" d="M{box.x - STUB + 8:.1f} {y:.1f}H{box.x - 1:.1f}"/>'


def _edge(number: int, line: Line, made: int) -> str:
    """A line with its number near its beginning; dashed where the run never took it."""
    kind, marker = ("edge", "made") if made else ("edge never", "never")
    (x, y), (x1, _) = line.points[0], line.points[1]
    side = 1 if line.arc or x1 > x else -1
    badge = f'<circle class="badge{"" if made else " never"}" cx="{x + side * 20:.1f}" cy="{y:.1f}" r="{BADGE}"/>'
    text = f'<text class="number" x="{x + side * 20:.1f}" y="{y + 3.5:.1f}">{number}</text>'
    return f'<path class="{kind}" marker-end="url(#{marker})" d="{_path(line, side)}"/>{badge}{text}'


def _path(line: Line, side: int) -> str:
    """Cubic pieces that are level at all points; the first begins with a level stretch that the number is on."""
    x, y = line.points[0]
    start = x + side * 32
    path = [f"M{x:.1f} {y:.1f}H{start:.1f}"]
    x = start
    for x1, y1 in line.points[1:]:
        if line.arc:
            reach = max(x, x1) + STUB
            path.append(f"C{reach:.1f} {y:.1f} {reach:.1f} {y1:.1f} {x1 + 1:.1f} {y1:.1f}")
        else:
            middle = (x + x1) / 2
            path.append(f"C{middle:.1f} {y:.1f} {middle:.1f} {y1:.1f} {x1:.1f} {y1:.1f}")
        x, y = x1, y1
    return "".join(path)


def _table(program: Program, edges: Sequence[EdgeProgram], made: Sequence[int] | None) -> str:
    rows: list[str] = []
    for number, edge in enumerate(edges, start=1):
        when = f"{edge.text} if {edge.condition_text}" if edge.condition_text else edge.text
        when = ", ".join(event_text(edge.of_event)) or when
        resets = _seen(edge.target_states, edge.reset_texts)
        changed = ", ".join(f"{name} := {text}" for name, text in resets if name != text)
        ends = f"{program.modes[edge.source].name} -> {program.modes[edge.target].name}"
        cells = [str(number), edge.name, ends, when, changed]
        cells += [] if made is None else [str(made[number - 1])]
        rows.append("<tr>" + "".join(f"<td>{escape(visible(cell))}</td>" for cell in cells) + "</tr>")
    names = ["#", "transition", "from -> to", "when", "reset", *([] if made is None else ["made"])]
    header = "".join(f"<th>{name}</th>" for name in names)
    return f"<table><thead><tr>{header}</tr></thead><tbody>{''.join(rows)}</tbody></table>"
