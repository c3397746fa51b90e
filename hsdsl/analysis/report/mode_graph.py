"""The mode graph of a program as SVG, with the transitions that a run made, and a table of them as HTML.

Places of boxes and lines are by the method of Sugiyama, Tagawa and Toda (1981, doi:10.1109/TSMC.1981.4308636): ranks by
the distance from the first box, waypoints where a line passes a column, and orders within columns by the mean place of
neighbours.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from html import escape
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

from hsdsl.analysis.report.words import html_row, html_table
from hsdsl.base.names import shown, without_memory
from hsdsl.base.parts import event_text, inner_modes, written_edges
from hsdsl.engine.execution import Execution
from hsdsl.mathematics.program import EdgeProgram, ModeProgram, Program

SIZE, PITCH, LETTER, INSIDE = 13, 18.0, 7.85, 12.0  # of the font, between lines, of a letter, from text to border
LONGEST, MOST_LINES, MOST_MODES = 34, 7, 6  # of a line; of a flow's lines; of modes whose flow is in their box
MOST_DRAWN = 60  # modes of which there is a picture
BADGE = 9.0
CSS = Path(__file__).with_name("mode_graph.css").read_text(encoding="utf-8")


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
        kind = "box" if mode.name in visited else "box unused"
        borders = [_border(box, kind, inset) for inset in ((0, 3) if mode.final else (0,))]
        top = box.y + (box.height - len(lines) * PITCH) / 2 + SIZE
        x, kinds = f"{box.x + INSIDE:.1f}", ["name", *(["line"] * (len(lines) - 1))]
        rows = [
            f'<text class="{kind}" x="{x}" y="{top + i * PITCH:.1f}">{escape(line)}</text>'
            for i, (kind, line) in enumerate(zip(kinds, lines, strict=True))
        ]
        parts.append("".join([*borders, *rows]))
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
    return f'<path class="{kind}" marker-end="url(#{marker})" d="{"".join(path)}"/>{badge}{text}'


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
        rows.append(html_row(cells))
    names = ["#", "transition", "from -> to", "when", "reset", *([] if made is None else ["made"])]
    return html_table(names, rows)


GAP, PASSAGE, PORT = 26.0, 18.0, 22.0  # between boxes above each other; height of a passing line; between line ends
CHANNEL, STUB = 90.0, 40.0  # between columns, at least, and how far an arc goes beyond its side
SWEEPS = 12


class Box(NamedTuple):
    """Where a box is: its left upper corner, and its size."""

    x: float
    y: float
    width: float
    height: float


class Line(NamedTuple):
    """A line from box to box: its points from left or right sides, and whether it arcs back to the side it left."""

    points: tuple[tuple[float, float], ...]
    arc: bool


class Layout(NamedTuple):
    """Boxes and lines in the order given, and the size of the picture."""

    boxes: tuple[Box, ...]
    lines: tuple[Line, ...]
    width: float
    height: float


def laid_out(sizes: Sequence[tuple[float, float]], edges: Sequence[tuple[int, int]], first: int) -> Layout:
    """Place boxes of given (width, height), and a line for each (from, to); ``first`` is in the first column."""
    ranks = _ranks(len(sizes), edges, first)
    paths, columns = _with_waypoints(ranks, edges)
    _order(columns, paths)
    ends: dict[tuple[int, int], int] = {}
    for a, b in edges:
        for v, side in zip((a, b), _sides(ranks, a, b), strict=True):
            ends[v, side] = ends.get((v, side), 0) + 1
    heights = {v: max(h, PORT * (max(ends.get((v, -1), 0), ends.get((v, 1), 0)) + 1)) for v, (_, h) in enumerate(sizes)}
    tallest = max(sum(heights.get(v, PASSAGE) + GAP for v in column) for column in columns)
    middle: dict[int, float] = {}
    left: dict[int, float] = {}
    x = STUB
    for rank, column in enumerate(columns):
        width = max((sizes[v][0] for v in column if v < len(sizes)), default=0.0)
        y = (tallest - sum(heights.get(v, PASSAGE) + GAP for v in column) + GAP) / 2
        for v in column:
            height = heights.get(v, PASSAGE)
            middle[v], left[v] = y + height / 2, x + (width - sizes[v][0] if v < len(sizes) else width) / 2
            y += height + GAP
        x += width + CHANNEL + 8.0 * sum(min(ranks[a], ranks[b]) == rank for a, b in edges)
    boxes = [Box(left[v], middle[v] - heights[v] / 2, w, heights[v]) for v, (w, _) in enumerate(sizes)]
    # The points of each line: its ends are spread over the sides of boxes, in the order of where they lead
    at_side: dict[tuple[int, int], list[tuple[float, int, int]]] = {}
    for k, (a, b) in enumerate(edges):
        sides = _sides(ranks, a, b)
        for end, (v, side) in enumerate(zip((a, b), sides, strict=True)):
            leads_to = paths[k][1 if end == 0 else -2]
            at_side.setdefault((v, side), []).append((middle[leads_to], k, end))
    port: dict[tuple[int, int], tuple[float, float]] = {}
    for (v, side), found in at_side.items():
        box = boxes[v]
        for i, (_, k, end) in enumerate(sorted(found)):
            y = box.y + box.height * (i + 1) / (len(found) + 1)
            port[k, end] = (box.x + (box.width if side > 0 else 0.0), y)
    lines: list[Line] = []
    for k, (a, b) in enumerate(edges):
        passed = [(left[v], middle[v]) for v in paths[k][1:-1]]
        lines.append(Line((port[k, 0], *passed, port[k, 1]), ranks[a] == ranks[b]))
    return Layout(tuple(boxes), tuple(lines), max(b.x + b.width for b in boxes) + CHANNEL, tallest + GAP)


def _ranks(count: int, edges: Sequence[tuple[int, int]], first: int) -> list[int]:
    """The distance of each box from the first; those that cannot be reached are beyond the last."""
    rank = {first: 0}
    waiting = [first]
    while len(rank) < count:
        while waiting:
            v = waiting.pop(0)
            for a, b in edges:
                if a == v and b not in rank:
                    rank[b] = rank[v] + 1
                    waiting.append(b)
        lost = next((v for v in range(count) if v not in rank), None)
        if lost is not None:
            rank[lost] = max(rank.values()) + 1
            waiting.append(lost)
    return [rank[v] for v in range(count)]


def _with_waypoints(ranks: list[int], edges: Sequence[tuple[int, int]]) -> tuple[list[list[int]], list[list[int]]]:
    """The path of each edge with a waypoint in each column that it passes, and all columns."""
    columns: list[list[int]] = [[] for _ in range(max(ranks) + 1)]
    for v, rank in enumerate(ranks):
        columns[rank].append(v)
    number, paths = len(ranks), list[list[int]]()
    for a, b in edges:
        step = 1 if ranks[b] > ranks[a] else -1
        between = range(ranks[a] + step, ranks[b], step) if ranks[a] != ranks[b] else range(0)
        path = [a]
        for rank in between:
            columns[rank].append(number)
            path.append(number)
            number += 1
        paths.append([*path, b])
    return paths, columns


def _order(columns: list[list[int]], paths: list[list[int]]) -> None:
    """Order each column by the mean place of the neighbours in the column before, and then in the one after it."""
    neighbours: dict[int, set[int]] = {}
    for path in paths:
        for a, b in pairwise(path):
            neighbours.setdefault(a, set()).add(b)
            neighbours.setdefault(b, set()).add(a)
    for sweep in range(SWEEPS):
        order = range(1, len(columns)) if sweep % 2 == 0 else range(len(columns) - 2, -1, -1)
        for rank in order:
            beside = columns[rank - 1 if sweep % 2 == 0 else rank + 1]
            place = {v: (i + 0.5) / len(beside) for i, v in enumerate(beside)}
            own = {v: (i + 0.5) / len(columns[rank]) for i, v in enumerate(columns[rank])}

            def mean(v: int, place: dict[int, float] = place, own: dict[int, float] = own) -> float:
                near = [place[u] for u in neighbours.get(v, ()) if u in place]
                return sum(near) / len(near) if near else own[v]

            columns[rank].sort(key=mean)


def _sides(ranks: list[int], a: int, b: int) -> tuple[int, int]:
    if ranks[a] == ranks[b]:
        return 1, 1
    return (1, -1) if ranks[a] < ranks[b] else (-1, 1)


def visited_part(program: Program, run: Execution | None) -> Program:
    """The product modes that a run was in, with the edges that it took; none without a run."""
    if not program.parts:
        return program
    if run is None:
        return replace(program, modes=())
    names = list(dict.fromkeys([*(arc.mode for arc in run.arcs), *(made.target for made in run.transitions)]))
    states = {arc.mode: arc.states for arc in run.arcs}
    taken = dict.fromkeys((made.source, made.edge, made.target) for made in run.transitions)
    texts = {edge.name: edge for edge in program.modes[0].edges}
    whole = program.modes[0]

    def edge(name: str, source: str, target: str) -> EdgeProgram:
        of, own = texts[name], frozenset(states.get(target, whole.states))
        pairs = [(s, text) for s, text in zip(of.target_states, of.reset_texts, strict=True) if s in own]
        changed = [k for k, (s, text) in enumerate(pairs) if s != text]
        return replace(
            of,
            source=names.index(source),
            target=names.index(target),
            target_states=tuple(s for s, _ in pairs),
            changes=tuple(changed),
            change_texts=tuple(pairs[k][1] for k in changed),
        )

    def edges(mode: str) -> tuple[EdgeProgram, ...]:
        return tuple(edge(name, source, target) for source, name, target in taken if source == mode)

    flows = dict(zip(whole.states, whole.flow_texts, strict=True))
    modes: list[ModeProgram] = []
    for mode in names:
        own = states.get(mode, ())
        modes.append(
            replace(whole, name=mode, states=own, flow_texts=tuple(flows[s] for s in own), edges=edges(mode), walls=())
        )
    return replace(program, modes=tuple(modes), contacts=(), initial_mode=0)


def as_written(program: Program, run: Execution | None) -> Program:
    """A program with one edge for each event, without modes that only end runs, unless this run ended in one."""
    inner = inner_modes(program.modes)
    last = run.arcs[-1].mode if run is not None and run.arcs else None
    shown = [k for k, mode in enumerate(program.modes) if k not in inner or mode.name == last]
    number = {k: i for i, k in enumerate(shown)}
    modes = tuple(
        replace(mode, edges=tuple(_moved(e, number) for e in written_edges(mode.edges, inner & number.keys())))
        for mode in (program.modes[k] for k in shown)
    )
    return replace(program, modes=modes, initial_mode=number.get(program.initial_mode, 0))


def _moved(edge: EdgeProgram, number: dict[int, int]) -> EdgeProgram:
    return replace(edge, source=number[edge.source], target=number[edge.target])
