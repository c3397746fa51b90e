"""Models as LaTeX: what is written stays mathematics, no text is a command, and the document compiles."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from shipped import assert_golden

import hsdsl
from hsdsl.export import files_of, source_of
from hsdsl.export.latex.mathematics import Mathematics, escaped

MODELS = sorted((Path(__file__).parents[2] / "models").glob("*.yaml"))
HOSTILE = """
hsdsl: 1
title: '\\input{/etc/passwd} %s & # $x^2$ ~ _ { } \\end{document} "x" <é ü ñ ß θ 中 · ²>'
source: '% \\write18{ls}'
parameters:
  θ_max: {value: 0.25, unit: 'm/s^2 & $', about: 'how \\much%'}
  x_1: 3
modes:
  'a&\\b_%#$': {flow: {x1: abs(x1) + θ_max,
      é: 'min(x1, floor(x1/2))**2/3 + 1e-9*sign(x1) - select(x1, sqrt(x1), 2)'}, domain: [x1 <= 100],
    transitions: [{name: '}\\%', when: x1 >= x_1, if: é > 0 and not x1 < 1, to: 'a&\\b_%#$', reset: {x1: -1e9}}]}
initial: {mode: 'a&\\b_%#$', x1: 1, é: 0}
experiment: {until: 1}
"""


def latex(text: str) -> str:
    return next(iter(files_of(source_of(hsdsl.loads(text), {}), "latex").values())).decode()


def check(document: str) -> None:
    """Braces and environments are closed, nothing but known commands and ASCII is there."""
    body = "\n".join(line for line in document.splitlines() if not line.startswith("%"))
    assert body.isascii()
    plain = re.sub(r"\\[\\{}%&#$_^~]", "", body)
    depth = 0
    for sign in plain:
        depth += (sign == "{") - (sign == "}")
        assert depth >= 0
    assert depth == 0 and "%" not in plain and "#" not in plain and "$" not in plain
    opened: list[str] = []
    for what, name in re.findall(r"\\(begin|end)\{([a-z*]+)\}", plain):
        opened.append(name) if what == "begin" else None
        assert what == "begin" or opened.pop() == name
    assert not opened
    assert not {"input", "write", "much", "include", "def", "catcode"} & set(re.findall(r"\\([A-Za-z]+)", plain))


@pytest.mark.parametrize("path", MODELS, ids=lambda path: path.stem)
def test_models_are_documents(path: Path) -> None:
    (document,) = files_of(source_of(hsdsl.load(path), {}), "latex").values()
    check(document.decode())
    model = hsdsl.load(path)
    assert document.count(rb"\subsection*{Mode ") == len(model.system.modes)
    assert document.count(b"\\item ") == sum(len(mode.edges) for mode in model.system.modes)


@pytest.mark.parametrize("target", ["latex", "mermaid"])
def test_text_of_the_document_stays(target: str) -> None:
    (content,) = files_of(source_of(hsdsl.load(MODELS[-1]), {}), target).values()
    lines = content.decode().splitlines(keepends=True)
    found = "".join(line for line in lines if not re.match(r"%+ (Generated|model)", line))
    assert_golden(found, Path(__file__).parent / "golden" / f"thermostat.{target}.txt")


def test_labels_of_a_mode_graph_are_no_markdown() -> None:
    text = """
hsdsl: 1
parameters: {_a_: 1, x_max: 2}
modes: {"`m`~~": {flow: {x: 2*_a_*x**2}, transitions: [{name: "**b**", when: x >= x_max, to: "`m`~~"}]}}
initial: {mode: "`m`~~", x: 0}
experiment: {until: 1}
"""
    (content,) = files_of(source_of(hsdsl.loads(text), {}), "mermaid").values()
    graph = content.decode().partition("stateDiagram-v2")[2].replace("[*]", "")
    assert not set("*`~") & set(graph) and "x_max" in graph and "_a" not in graph
    assert not {"#42;", "#96;", "#126;", "#95;"} & set(re.findall(r"#\d+;", graph))


def test_text_of_a_model_is_no_command() -> None:
    check(latex(HOSTILE))


@settings(max_examples=100)
@given(st.text(max_size=40))
def test_any_text_is_escaped(text: str) -> None:
    found = escaped(text)
    assert found.isascii() and "\n" not in found
    check(found)


def test_names_and_numbers_are_written_as_people_do() -> None:
    math = Mathematics(["x_max", "omega", "x1", "x_1", "vx", "θ", "k__"])
    forms = {name: math.name(name) for name in math.names}
    assert forms == {
        "t": "t", "x_max": r"x_{\mathrm{max}}", "omega": r"\omega", "x1": "x_{1}", "x_1": r"\text{\texttt{x\_1}}",
        "vx": r"\mathrm{vx}", "θ": r"\theta", "k__": "k''",
    }  # fmt: skip
    texts = ["9.81", "1/2", "2.5", "1e-9", "2.7e6", "-1/3", "22/7", "abs(x1)", "min(x1, 2)", "-2*omega*vx", "x1**2/3"]
    assert [math.expression(text) for text in texts] == [
        "9.81", r"\frac{1}{2}", "2.5", r"1 \cdot 10^{-9}", "2700000", r"- \frac{1}{3}", r"\frac{22}{7}",
        r"\left|{x_{1}}\right|", r"\min\left(x_{1}, 2\right)", r"- 2\,\omega\,\mathrm{vx}", r"\frac{x_{1}^{2}}{3}",
    ]  # fmt: skip


def test_choices_are_cases() -> None:
    math = Mathematics(["x", "v"])
    root = r"\begin{cases} \sqrt{x - 1} & \text{for}\: x - 1 > 0 \\v & \text{otherwise} \end{cases}"
    assert math.expression("select(x - 1, sqrt(x - 1), v)") == root
    one = r"\begin{cases} 1 & \text{for}\: v > 0 \\2\,x & \text{otherwise} \end{cases}"
    assert math.expression("3*select(v, 1, 2*x)") == rf"3\,\left({one}\right)"
    assert math.expression("select(v, 1, 2*x)**3") == rf"\left({one}\right)^{{3}}"
    assert math.inequality("select(v, 1, 2*x) >= x") == rf"{one} \geq x"
    inner = r"\begin{cases} v & \text{for}\: x > 0 \\1 & \text{otherwise} \end{cases}"
    assert inner in math.expression("select(v, select(x, v, 1), x)")


@pytest.mark.tools
@pytest.mark.parametrize("path", [*MODELS, None], ids=lambda path: path.stem if path else "hostile")
def test_documents_compile(path: Path | None, tmp_path: Path) -> None:
    compiler = shutil.which("pdflatex") or shutil.which("tectonic")
    if compiler is None:
        pytest.skip("neither pdflatex nor tectonic is installed: tests/export/install-tools.sh")
    text = HOSTILE if path is None else None
    source = source_of(hsdsl.load(path) if path else hsdsl.loads(str(text)), {})
    (tmp_path / "model.tex").write_bytes(next(iter(files_of(source, "latex").values())))
    safe = ["-interaction=nonstopmode", "-halt-on-error", "-no-shell-escape"] if "pdflatex" in compiler else []
    done = subprocess.run([compiler, *safe, "model.tex"], cwd=tmp_path, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stdout[-2000:]
    assert "Overfull" not in done.stdout


EVENTS = """
hsdsl: 1
parameters: {wait: 2}
let: {twice: 2*x, half: x/2}
outputs: {y: twice + 1}
units: {y: m}
modes:
  m:
    flow: {x: 1, n: 0}
    outputs: {z: half}
    transitions:
      - {name: count, event: x >= 1 and n < 3, delay: wait, persistent: false, reset: {n: n + 1}}
      - {name: leave, when: x >= 4, to: e}
  e: {final: true}
initial: {mode: m, x: 0, n: 0}
experiment: {until: 5}
"""


def test_events_and_outputs_are_in_the_document() -> None:
    document = latex(EVENTS)
    check(document)
    assert r"\item \textbf{count}, to m where \(x \geq 1 \wedge n < 3\) turns true, after" in document
    assert r"after \(\mathrm{wait}\), persistent false:" in document
    assert r"y\ \text{(m)} &= \mathrm{twice} + 1" in document and r"\mathrm{twice} &= 2\,x" in document
    assert r"z &= \mathrm{half}" in document and "count@" not in document
    assert document.count(r"\subsection*{Mode ") == document.count(r"\item ") == 2


def test_outputs_of_parts_are_in_the_document() -> None:
    folder = MODELS[0].parent / "parts"
    document = latex((folder / "balls.yaml").read_text("utf-8"))
    check(document)
    model = hsdsl.load(folder / "balls.yaml")
    assert model.program.outputs and r"\subsection*{Outputs}" in document
