"""What notebooks display: models, runs, ensembles, tables of ensembles, and progress."""

from __future__ import annotations

import sys
import time
from html.parser import HTMLParser
from types import SimpleNamespace
from xml.etree import ElementTree

import numpy as np
import pytest

import hsdsl
from hsdsl.analysis.report.model import Mathematics
from hsdsl.base.errors import UsageError
from hsdsl.base.progress import FIRST_SIGN, INTERVAL, counted, in_notebook, ticking
from hsdsl.engine.execution import Execution
from hsdsl.language.expression import plain

BALL = """
hsdsl: 1
title: "A ball & <a floor>"
parameters: {g: 9.81, e: {value: 1/2, unit: "1", about: "how much <b>stays</b>"}, h_top: 1}
modes:
  fly:
    let: {drag: v*abs(v)/1000}
    flow: {h: v, v: -g - drag}
    transitions: [{name: bounce, when: h <= 0, if: v < 0, to: fly, reset: {v: -e*v}}]
units: {h: m, t: s}
outputs: {energy: v**2/2 + g*h}
initial: {mode: fly, h: h_top, v: 0}
experiment: {until: 1}
"""
VOID = {"img", "br"}


class Tree(HTMLParser):
    """Elements that close each other in turn, with what they hold."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.seen: list[str] = []
        self.text = ""
        self.feed(text)
        assert self.open == []

    def handle_starttag(self, tag: str, attrs: object) -> None:
        self.seen.append(tag)
        self.open += [] if tag in VOID else [tag]

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.text += data


def fetched(text: str) -> bool:
    return any(sign in text for sign in ("http:", "https:", "<script", "<link", "@import", "url(h"))


def formula(text: str) -> str:
    """The signs of a formula, without its elements."""
    return "".join(ElementTree.fromstring(text.replace("&ExponentialE;", "e")).itertext())


@pytest.fixture(scope="module")
def ball():
    return hsdsl.loads(BALL)


def test_a_model_shows_modes_equations_and_graph(ball):
    text = ball._repr_html_()
    tree = Tree(text)
    assert not fetched(text.replace("http://www.w3.org/1998/Math/MathML", ""))
    assert {"svg", "math", "details", "table"} <= set(tree.seen) and "b" not in tree.seen
    for part in ("A ball & <a floor>", "1 mode", "mode fly", "bounce", "how much <b>stays</b>"):
        assert part in tree.text
    found = [formula(part + "</math>").replace(" ", "") for part in _formulas(text)]
    assert {"h˙=v", "h≤0", "v<0", "v+=−ev"} <= set(found)
    assert any(one.startswith("v˙=") for one in found) and any(one.startswith("drag=") for one in found)


def _formulas(text):
    return ["<math" + part.partition("</math>")[0] for part in text.split("<math")[1:]]


@pytest.mark.parametrize(
    ("text", "signs"),
    [
        ("-9.81", "−9.81"),
        ("1/3*x", "x3"),
        ("1e-7*x", "x10000000"),
        ("1e-7", "1·10−7"),
        ("abs(x_1)", "|x1|"),
        ("floor(t)", "⌊t⌋"),
        ("min(a, max(b, 2))", "min(a,max(b,2))"),
        ("alpha*sin(omega*t)", "αsin(ωt)"),
        ("sqrt(x)", "x"),
        ("x + select(x - 1, a, 2)", "x+(awhere\u00a0x−1>02elsewhere)"),
    ],
)
def test_formulas_have_the_signs_of_people(text, signs):
    math = Mathematics(["x", "x_1"])
    assert formula(f"<m>{math.printer.doprint(plain.value(text))}</m>") == signs


def test_names_that_would_look_alike_are_as_they_are_written():
    alike, other = Mathematics(["x_1", "x1"]), Mathematics(["x_1"])
    assert formula(alike.name("x_1")) == "x_1" and formula(alike.name("x1")) == "x1"
    assert formula(other.name("x_1")) == "x1" and "msub" in other.name("x_1")


def test_a_model_of_many_modes_is_folded_and_cut():
    modes = "\n".join(
        f"  m{k}: {{flow: {{x: 1}}, transitions: [{{when: x >= {k + 1}, to: m{k + 1}}}]}}" for k in range(50)
    )
    text = hsdsl.loads(
        f"hsdsl: 1\nmodes:\n{modes}\n  m50: {{flow: {{x: 0}}}}\ninitial: {{mode: m0, x: 0}}\nexperiment: {{until: 9}}\n"
    )._repr_html_()
    assert "11 more modes" in text and "<details open" not in text
    Tree(text)


def test_a_run_shows_its_summary_and_a_picture(ball):
    run = ball.simulate(engine="python")
    text = run._repr_html_()
    tree = Tree(text)
    assert "img" in tree.seen and "data:image/png;base64," in text and not fetched(text)
    assert "until: reached t = 1" in tree.text and "verdict" in tree.text


def test_a_run_plots_itself_with_the_units_and_levels_of_its_model(ball):
    import matplotlib

    matplotlib.use("agg")
    from matplotlib import pyplot

    axes = ball.simulate(engine="python").plot(columns=["h"], phases=[("h", "v")])
    assert [axis.get_ylabel() for axis in axes] == ["h [m]", "v"] and axes[0].get_xlabel() == "time t [s]"
    assert "bounce" in {text.get_text() for text in axes[0].texts}
    assert axes[0].figure.number in pyplot.get_fignums()
    pyplot.close("all")


def test_a_run_plots_into_a_given_figure(ball, tmp_path):
    from matplotlib.figure import Figure

    ball.simulate(engine="python").save(tmp_path / "run.npz")
    from hsdsl.analysis.store import load

    left, _ = Figure(figsize=(9, 4)).subfigures(1, 2)
    axes = load(tmp_path / "run.npz").plot(left)
    assert [axis.get_ylabel() for axis in axes] == ["h", "v", "energy", "v"]


@pytest.fixture(scope="module")
def ensemble(ball):
    values = np.linspace(0.3, 0.9, 4)[:, None]
    return ball.ensemble(
        parameters={"e": values}, initial={"h": [1.0, 2.0]}, samples=3, transition_times=2, every_transition=True,
        engine="python", tolerance=1e-9,
    )  # fmt: skip


def test_an_ensemble_shows_what_varied_and_how_it_ended(ensemble, ball):
    text = ensemble._repr_html_()
    tree = Tree(text)
    assert "img" in tree.seen and not fetched(text)
    for part in ("8, shape (4, 2)", "varied e0.3 to 0.9", "varied initial.h1 to 2", "8 until"):
        assert part in tree.text
    one = ball.ensemble(parameters={"e": [0.5, 0.6]}, engine="python")._repr_html_()
    assert "img" in Tree(one).seen


def test_runs_of_an_ensemble_are_a_table(ensemble):
    frame = ensemble.to_pandas()
    assert frame.index.names == ["instance_0", "instance_1"] and len(frame) == 8
    names = ["e", "initial.h", "stop", "time", "mode", "transitions", "warnings", "transition_0", "transition_1"]
    assert list(frame.columns) == [*names, "h", "v", "energy"]
    row = frame.loc[(2, 1)]
    run: Execution = ensemble.run(2, 1)
    assert row["e"] == pytest.approx(0.7) and row["initial.h"] == 2 and row["stop"] == run.stop.reason
    assert (row["h"], row["transitions"]) == (run.final.state["h"], len(run.transitions))


def test_samples_and_transitions_of_an_ensemble_are_tables(ensemble):
    samples, made = ensemble.to_pandas("samples"), ensemble.to_pandas("transitions")
    run = ensemble.run(3, 0)
    mine = samples.loc[(3, 0)]
    assert mine["time"].tolist() == [0.0, 0.5, 1.0]
    assert mine["h"].tolist() == run.sample([0.0, 0.5, 1.0])["h"].tolist()
    times = made.loc[[(3, 0)], "time"].tolist()
    assert times == [each.time for each in run.transitions] and len(made) == int(ensemble.transitions.sum())
    assert made.loc[[(3, 0)], "after.v"].tolist() == [each.after["v"] for each in run.transitions]


def test_tables_that_are_not_there_are_refused(ball, monkeypatch):
    plain = ball.ensemble(parameters={"e": [0.5, 0.6]}, engine="python")
    assert plain.to_pandas().index.names == ["instance"]
    for what, hint in (("samples", "samples="), ("transitions", "every_transition=True")):
        with pytest.raises(UsageError) as refusal:
            plain.to_pandas(what)
        assert hint in (refusal.value.hint or "")
    with pytest.raises(UsageError, match="expected runs, samples, transitions, got 'rows'"):
        plain.to_pandas("rows")
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(UsageError, match="needs pandas"):
        plain.to_pandas()


def test_progress_is_drawn_from_half_a_second_on_and_removed():
    drawn = []
    with ticking(drawn.append) as show:
        show(lambda: "short")
    assert drawn == []
    with ticking(drawn.append) as show:
        show(lambda: "long")
        time.sleep(FIRST_SIGN + 3 * INTERVAL)
    assert set(drawn[:-1]) == {"long"} and drawn[-1] is None
    time.sleep(2 * INTERVAL)
    assert drawn[-1] is None


def test_progress_is_shown_in_notebooks_alone(monkeypatch):
    shown = []
    handle = SimpleNamespace(update=lambda content, raw: shown.append(content["text/plain"]))

    def display(content, raw, display_id):
        shown.append(content["text/plain"])
        return handle

    shell = SimpleNamespace(kernel=object())
    ipython = SimpleNamespace(get_ipython=lambda: shell, display=SimpleNamespace(display=display))
    with in_notebook() as show:
        assert show is None and counted(show, "runs") is None
    monkeypatch.setitem(sys.modules, "IPython", ipython)
    with in_notebook() as show:
        tell = counted(show, "runs")
        tell(1, 4)
        time.sleep(FIRST_SIGN + 2 * INTERVAL)
    assert shown[0] == "[========                      ]  25%, 1 of 4 runs" and shown[-1] == ""
    shell.kernel = None
    with in_notebook() as show:
        assert show is None


ROOMS = """
hsdsl: 1
automata:
  room:
    parameters: {power: 30}
    modes:
      on: {flow: {T: power - T}, transitions: [{name: warm, when: T >= 21, to: off}]}
      off: {flow: {T: -T}, transitions: [{name: cold, when: T <= 19, to: on}]}
system:
  a: {automaton: room, initial: {mode: on, T: 20}}
  b: {automaton: room, initial: {mode: off, T: 20}}
experiment: {until: 1}
"""


def test_a_model_of_parts_shows_its_parts():
    model = hsdsl.loads(ROOMS)
    tree = Tree(model._repr_html_())
    assert "2 parts" in tree.text and "aon, offon" in tree.text and "a.warm" in tree.text and "svg" not in tree.seen
    run = model.simulate(engine="python")
    assert "b: on -> off" in Tree(run._repr_html_()).text
    assert [axis.get_ylabel() for axis in run.plot(_figure())][:2] == ["a.T", "b.T"]


def _figure():
    from matplotlib.figure import Figure

    return Figure(figsize=(9, 5), layout="constrained")


def test_functions_of_a_file_are_written_out():
    text = """
hsdsl: 1
parameters: {k: 2}
functions: {spring: {of: [s], is: -k*s}}
modes: {on: {flow: {x: v, v: spring(x)}}}
initial: {mode: on, x: 1, v: 0}
experiment: {until: 1}
"""
    found = [formula(part + "</math>") for part in _formulas(hsdsl.loads(text)._repr_html_())]
    assert "v˙=−kx" in found
