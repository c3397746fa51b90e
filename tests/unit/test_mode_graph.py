"""The mode graph of a page: boxes that do not overlap, lines that end at their boxes, text that is no markup."""

from __future__ import annotations

import re
from itertools import combinations
from pathlib import Path
from xml.etree import ElementTree

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import hsdsl
from hsdsl.analysis.report.mode_graph import PORT, Box, laid_out, mode_graph

MODELS = sorted((Path(__file__).parents[2] / "models").glob("*.yaml"))


def apart(a: Box, b: Box) -> bool:
    beside = a.x + a.width <= b.x or b.x + b.width <= a.x
    return beside or a.y + a.height <= b.y or b.y + b.height <= a.y


@st.composite
def graphs(draw: st.DrawFn) -> tuple[list[tuple[float, float]], list[tuple[int, int]]]:
    count = draw(st.integers(1, 10))
    sizes = draw(st.lists(st.tuples(st.floats(20, 250), st.floats(20, 150)), min_size=count, max_size=count))
    ends = st.integers(0, count - 1)
    return sizes, draw(st.lists(st.tuples(ends, ends), max_size=25))


@settings(max_examples=200)
@given(graphs())
def test_boxes_and_lines_keep_apart(graph: tuple[list[tuple[float, float]], list[tuple[int, int]]]) -> None:
    sizes, edges = graph
    layout = laid_out(sizes, edges, 0)
    assert all(apart(a, b) for a, b in combinations(layout.boxes, 2))
    starts = set()
    for (a, b), line in zip(edges, layout.lines, strict=True):
        for (x, y), box in zip((line.points[0], line.points[-1]), (layout.boxes[a], layout.boxes[b]), strict=True):
            assert x == pytest.approx(box.x) or x == pytest.approx(box.x + box.width)
            assert box.y < y < box.y + box.height
            starts.add((round(x, 6), round(y, 6)))
        for x, y in line.points[1:-1]:
            assert not any(box.x < x < box.x + box.width and box.y < y < box.y + box.height for box in layout.boxes)
    assert len(starts) == 2 * len(edges)  # no two lines end at one point
    for (x, y), (x1, y1) in combinations(starts, 2):
        assert x != x1 or abs(y - y1) >= PORT * 0.99
    assert all(box.x + box.width <= layout.width and box.y + box.height <= layout.height for box in layout.boxes)


@pytest.mark.parametrize("path", MODELS, ids=lambda path: path.stem)
def test_page_has_all_modes_and_transitions(path: Path, tmp_path: Path) -> None:
    model = hsdsl.load(path)
    run = model.simulate(max_transitions=3)
    page = tmp_path / "run.html"
    model.plot(run, page)
    text = page.read_text()
    svg = re.search(r'<svg class="modes".*?</svg>', text, re.DOTALL)
    assert svg is not None and "http" not in svg.group()
    root = ElementTree.fromstring(svg.group())
    names = [node.text for node in root.iter("text") if node.get("class") == "name"]
    assert names == [mode.name for mode in model.program.modes]
    edges = [edge for mode in model.program.modes for edge in mode.edges]
    assert [node.text for node in root.iter("text") if node.get("class") == "number"] == [
        str(k + 1) for k in range(len(edges))
    ]
    made = re.findall(r"<td>(\d+)</td></tr>", mode_graph(model.program, run))
    assert sum(map(int, made)) == len(run.transitions)


def test_text_of_a_model_is_no_markup() -> None:
    model = hsdsl.loads("""
hsdsl: 1
modes:
  "</text><script>": {flow: {x: 1}, transitions: [{name: "<b>&", when: x >= 1, if: x > 0, to: "</text><script>"}]}
initial: {mode: "</text><script>", x: 0}
experiment: {until: 2}
""")
    text = mode_graph(model.program, model.simulate())
    assert "<script" not in text and "<b>" not in text and "x &gt;= 1 if x &gt; 0" in text
