"""Pictures of runs: what is drawn, where it is broken, and the files it ends in."""

from __future__ import annotations

import subprocess
import sys
import warnings
from dataclasses import replace
from xml.etree import ElementTree

import hand_made
import numpy as np
import pytest
from matplotlib.colors import to_rgb

import hsdsl
from hsdsl.analysis.plot import GuardLine, View, plot
from hsdsl.analysis.plot.curves import CELLS, SEVERAL, curves, limits, limits_of, line
from hsdsl.analysis.plot.figure import picture
from hsdsl.analysis.plot.style import RUNS as RUN_COLOURS
from hsdsl.analysis.plot.style import colours
from hsdsl.base.errors import UsageError
from hsdsl.base.numbers import decimals
from hsdsl.engine.execution import Stop

FIFTY = decimals.context_of(50)
FLOOR = GuardLine("fly", "h", 0.0, "h <= 0")


def _figure(*runs, **options):
    return picture(runs, View(**options))


def _curve(axis):
    """Take the panel's main line: the longest of those without markers."""
    plain = [drawn for drawn in axis.get_lines() if drawn.get_marker() == "None"]
    return max(plain, key=lambda drawn: len(drawn.get_xdata()))


def test_a_big_step_is_drawn_as_the_curve_it_is():
    run = hand_made.bouncing_ball(bounces=0, pieces=1)  # one step for the whole flight
    x, y = _curve(_figure(run).axes[0]).get_data()
    middles = (x[1:] + x[:-1]) / 2
    assert np.max(np.abs((y[1:] + y[:-1]) / 2 - (2 - middles**2 / 2))) < 2e-4


def test_jumps_are_not_joined():
    run = hand_made.bouncing_ball(bounces=2, wait=0.125)
    figure = _figure(run)
    h, v, energy = (_curve(axis).get_ydata() for axis in figure.axes[:3])
    assert [np.isnan(values).sum() for values in (h, v, energy)] == [0, 2, 2]  # the height does not jump
    before, after = v[np.flatnonzero(np.isnan(v)) - 1], v[np.flatnonzero(np.isnan(v)) + 1]
    assert (before.tolist(), after.tolist()) == ([-2.0, -1.0], [1.0, 0.5])


def test_a_state_is_drawn_only_where_the_mode_has_it():
    draft = hand_made.Draft()
    draft.arc("a", ("x",), 0, [(0.0, [0.0], [], 0.0, []), (1.0, [1.0], [], 0.0, [])])
    draft.arc("b", ("y",), 1, [(1.0, [5.0], [], 0.0, []), (2.0, [6.0], [], 0.0, [])])
    draft.arc("a", ("x",), 2, [(2.0, [1.0], [], 0.0, []), (3.0, [0.0], [], 0.0, [])])
    x, y = _curve(_figure(draft.make()).axes[0]).get_data()
    drawn = x[~np.isnan(y)]
    assert drawn.tolist() == [0.0, 1.0, 2.0, 3.0]
    assert np.isnan(y[np.flatnonzero(x == 1.0)[0] + 1])  # nothing between 1 and 2


def test_an_input_s_jump_breaks_the_output_but_not_the_state():
    figure = _figure(hand_made.jumping_input())
    assert [np.isnan(_curve(axis).get_ydata()).sum() for axis in figure.axes] == [0, 1]


def test_two_states_have_a_phase_plot_and_three_have_not():
    assert len(_figure(hand_made.bouncing_ball()).axes) == 2 + 1 + 1
    assert len(_figure(hand_made.modes_of_different_size()).axes) == 4 + 1


@pytest.mark.parametrize("switches", [2, 3000])
def test_a_phase_plot_shows_all_of_the_run(switches):
    run = hand_made.thermostat(switches)
    arcs = tuple(replace(arc, states=("T", "twice")) for arc in run.arcs)
    values = run.values * [1.0, 2.0]
    axis = _figure(replace(run, values=values, arcs=arcs, coefficients=np.zeros((len(values), 0, 2)))).axes[-1]
    drawn = np.concatenate([line.get_xydata() for line in axis.get_lines() if line.get_marker() == "None"])
    assert np.nanmin(drawn, axis=0).tolist() == [0.0, 0.0]
    assert np.nanmax(drawn, axis=0).tolist() == [1.0, 2.0]


def test_bands_are_the_modes_over_time():
    assert curves(hand_made.thermostat(2)).bands == [("on", 0.0, 1.0), ("off", 1.0, 2.0), ("on", 2.0, 3.0)]
    assert curves(hand_made.modes_of_different_size()).bands == [("a", 0.0, 3.0)]


def test_bands_too_narrow_to_see_are_of_several_modes():
    data = curves(hand_made.thermostat(10_000))
    assert data.bands == [(SEVERAL, 0.0, 10_001.0)]
    slow_then_fast = hand_made.thermostat(1000)
    stretched = replace(slow_then_fast, times=np.where(slow_then_fast.times >= 1, slow_then_fast.times + 2000, 0))
    bands = curves(stretched).bands
    assert bands[0][0] == "on"
    assert bands[0][2] == pytest.approx(2001, abs=3)


def test_of_many_switches_the_shares_are_drawn():
    """On for 1 and off for 1: one half each; then the first stay is as long as a quarter of all others."""
    assert curves(hand_made.thermostat(300)).shares is None
    run = hand_made.thermostat(1199)
    edges, of = curves(run).shares
    assert (edges[0], edges[-1], len(edges)) == (0, 1200, 101) and list(of) == ["on", "off"]
    assert np.allclose(of["on"], 0.5) and np.allclose(of["on"] + of["off"], 1)
    late = curves(replace(run, times=np.where(run.times >= 1, run.times + 300, 0))).shares
    assert np.allclose(late.of["on"][:20], 1) and np.allclose(late.of["on"][21:], 0.5, atol=0.05)
    figure = _figure(run)
    assert [text.get_text() for text in figure.legends[0].get_texts()] == [f"{m}, share of the time" for m in of]
    strip, panel = figure.axes[1], figure.axes[0]
    assert len(strip.collections) == 2 and not panel.collections  # no band behind the curve


def test_a_mode_occupied_too_shortly_to_see_has_no_band():
    run = hand_made.thermostat(4)
    times = np.where(run.times >= 2, run.times - 1 + 1e-7, run.times)  # the second arc takes 1e-7
    assert curves(replace(run, times=times)).bands == [
        ("on", 0.0, 2 + 1e-7),
        ("off", 2 + 1e-7, 3 + 1e-7),
        ("on", 3 + 1e-7, 4 + 1e-7),
    ]


def test_labels_of_one_level_become_one_beside_the_panel():
    guards = [GuardLine("on", "T", 1.0, "a"), GuardLine("off", "T", 1.0, "b"), GuardLine("off", "T", 0.0, "c")]
    figure = _figure(hand_made.thermostat(30), guards=guards)
    figure.draw_without_rendering()
    axis = figure.axes[0]
    assert sorted(text.get_text().splitlines() for text in axis.texts) == [["b", "a"], ["c"]]
    first, second = (text.get_window_extent() for text in axis.texts)
    assert min(first.x0, second.x0) >= axis.get_window_extent().x1 and not first.overlaps(second)


def test_every_mode_has_a_colour_of_its_own():
    modes = [f"mode{i}" for i in range(14)]
    assert len(set(colours(modes).values())) == 14


def test_names_of_modes_stand_above_their_bands_or_in_a_legend():
    few = _figure(hand_made.thermostat(2))
    assert {"on", "off"} <= {text.get_text() for text in few.axes[0].texts}
    assert [text.get_text() for text in few.legends[0].get_texts()] == ["transition"]
    many = _figure(hand_made.thermostat(50))
    assert [text.get_text() for text in many.legends[0].get_texts()] == ["on", "off", "transition"]


def test_stop_levels_are_dotted_lines_where_their_mode_is():
    guards = [
        GuardLine("on", "T", 1.0, "T >= 1"),
        GuardLine("never", "T", 0.5, "no"),
        GuardLine("on", "T", 99.0, "far"),
    ]
    axis = _figure(hand_made.thermostat(2), guards=guards).axes[0]
    dotted = [drawn for drawn in axis.collections if hasattr(drawn, "get_segments")]
    segments = [segment.tolist() for drawn in dotted for segment in drawn.get_segments()]
    assert segments == [[[0.0, 1.0], [1.0, 1.0]], [[2.0, 1.0], [3.0, 1.0]]]
    assert "T >= 1" in {text.get_text() for text in axis.texts}
    assert axis.get_ylim()[1] < 2  # a level far away does not squash the curve


def test_a_level_of_several_modes_has_one_label():
    guards = [GuardLine("on", "T", 0.9, "T >= level"), GuardLine("off", "T", 0.9, "T >= level")]
    axis = _figure(hand_made.thermostat(2), guards=guards).axes[0]
    assert [text.get_text() for text in axis.texts].count("T >= level") == 1


def _sawtooth(teeth):
    """X rises from 0 to 1 and falls back at once; y is 1 throughout."""
    draft = hand_made.Draft()
    for k in range(teeth + 1):
        draft.arc("m", ("x", "y"), k, [(float(k + s), [float(s), 1.0], [], 0.0, []) for s in (0, 1)])
    return draft.make()


@pytest.mark.parametrize(("transitions", "markers"), [(4, 2), (60, 2), (61, 1), (400, 1), (401, 0)])
def test_markers_are_thinned_out(transitions, markers):
    """Of many transitions only those are marked where the column jumps."""
    for axis, kept in zip(_figure(_sawtooth(transitions)).axes[:2], (True, transitions <= 60), strict=True):
        marked = [drawn for drawn in axis.get_lines() if drawn.get_marker() == "o"]
        assert [len(drawn.get_xdata()) for drawn in marked] == [transitions if kept else 0] * markers


@pytest.mark.parametrize("states", [1, 2, 7, 17])
def test_the_figure_grows_with_its_panels(states):
    draft = hand_made.Draft()
    names = tuple(f"x{i}" for i in range(states))
    draft.arc("m", names, 0, [(0.0, [0.0] * states, [], 0.0, []), (1.0, [1.0] * states, [], 0.0, [])])
    figure = _figure(draft.make())
    assert len(figure.axes) == states + (states == 2)
    figure.draw_without_rendering()
    inches = [axis.get_position().height * figure.get_figheight() for axis in figure.axes]
    assert min(inches) > 0.9


def test_units_and_title_stand_where_they_are_looked_for():
    figure = _figure(hand_made.bouncing_ball(), units={"h": "m", "t": "s"}, title="a $b$ title")
    assert figure.axes[0].get_ylabel() == "h [m]"
    assert figure.axes[1].get_ylabel() == "v"
    assert figure.axes[2].get_xlabel() == "time t [s]"
    assert figure.get_suptitle() == "a $b$ title"


def test_a_bad_end_is_said_and_does_not_squash_what_came_before():
    figure = _figure(hand_made.blow_up())
    assert figure.axes[0].get_ylim()[1] < 100
    assert "stopped: not_finite at t = 1: x**2" in figure.axes[0].get_title(loc="left")


@pytest.mark.parametrize(
    ("values", "low", "high"),
    [
        ([3.0, 3.0], 2.7, 3.3),
        ([0.0, 0.0], -1.0, 1.0),
        ([-1.6e-19, 1.6e-19], -1.8e-19, 1.8e-19),  # a charge in coulombs
        ([1e18, 1e18 + 1e5], 0.9e18, 1.1e18),
        ([0.0, 16.0], -1.0, 17.0),
        ([np.nan, np.inf], -1.0, 1.0),
        ([1e-15, 1.0, np.nan, -np.inf], 1e-15 - 1 / 16, 1 + 1 / 16),
        ([-1.7e308, 1.7e308], -1.7e308 * 1.125, 1.7e308 * 1.125),
    ],
)
def test_limits(values, low, high):
    values = np.array(values)
    assert limits(values, np.linspace(0, 1, len(values)), False) == pytest.approx((low, high))


def test_a_thinned_line_is_the_line_to_within_a_cell():
    rng = np.random.default_rng(1)
    x = np.sort(rng.random(50_000))
    y = np.sin(9 * x)
    begins = np.zeros(len(x), dtype=bool)
    begins[::1000] = True
    thin_x, thin_y = line(x, y, begins, (0.0, 1.0, -1.0, 1.0))
    drawn = ~np.isnan(thin_x)
    assert drawn.sum() < len(x) / 2
    assert np.max(np.abs(np.interp(x, thin_x[drawn], thin_y[drawn]) - y)) < 2 * 2 / CELLS
    assert thin_x[0] == x[0]
    assert thin_x[-1] == x[-1]


RUNS = {
    "strips": lambda: hand_made.bouncing_ball(wait=0.1),
    "modes": hand_made.modes_of_different_size,
    "input": hand_made.jumping_input,
    "bad end": hand_made.blow_up,
    "fifty digits": lambda: hand_made.bouncing_ball(convert=FIFTY.mpf, digits=50),
    "many": lambda: hand_made.thermostat(3000),
    "hostile names": lambda: hand_made.thermostat(3, heats="<script>$\\frac{", cools="名前 & $x"),
}


@pytest.mark.parametrize("run", RUNS)
@pytest.mark.parametrize("suffix", [".png", ".svg"])
def test_every_run_can_be_drawn(run, suffix, tmp_path):
    path = tmp_path / f"run{suffix}"
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        plot(RUNS[run](), path, guards=[FLOOR])
    assert path.read_bytes().startswith({".png": b"\x89PNG", ".svg": b"<?xml"}[suffix])
    assert path.stat().st_size < 1_000_000
    if suffix == ".svg":
        ElementTree.parse(path)


@pytest.mark.parametrize("suffix", [".png", ".svg", ".html"])
def test_the_same_run_gives_the_same_file(suffix, tmp_path):
    paths = [tmp_path / f"{name}{suffix}" for name in ("one", "two")]
    for path in paths:
        plot(hand_made.bouncing_ball(wait=0.1), path, guards=[FLOOR])
    assert paths[0].read_bytes() == paths[1].read_bytes()


def test_a_page_stands_alone(tmp_path):
    run = replace(hand_made.bouncing_ball(), title="Ball & <floor>")
    plot(run, tmp_path / "run.html")
    page = (tmp_path / "run.html").read_text(encoding="utf-8")
    names_of_xml = page.replace("http://www.w3.org/2000/svg", "").replace("http-equiv", "")
    assert "http" not in names_of_xml
    assert "<title>Ball &amp; &lt;floor&gt;</title>" in page
    assert "v: -2 -&gt; 1" in page


def test_an_unknown_suffix_is_refused(tmp_path):
    with pytest.raises(UsageError, match=r"should end in .png, .svg or .html"):
        plot(hand_made.jumping_input(), tmp_path / "run.pdf")
    assert list(tmp_path.iterdir()) == []


def test_a_picture_that_cannot_be_written_is_refused(tmp_path):
    with pytest.raises(UsageError, match="there is no folder"):
        plot(hand_made.jumping_input(), tmp_path / "no" / "run.png")


def test_a_run_of_one_instant_can_be_drawn(tmp_path):
    draft = hand_made.Draft()
    draft.arc("only", ("x",), 0, [(0.0, [3.0], [], 0.0, [])])
    run = replace(draft.make("final"), stop=Stop("left_domain", 0.0, "It started outside."))
    plot(run, tmp_path / "run.svg")


def test_nobody_s_matplotlib_is_disturbed(tmp_path):
    code = (
        "import sys, matplotlib, hand_made\n"
        "before = matplotlib.rcParams.copy()\n"
        "from hsdsl.analysis.plot import plot\n"
        f"plot(hand_made.jumping_input(), {str(tmp_path / 'run.png')!r})\n"
        "assert matplotlib.rcParams.copy() == before\n"
        "assert 'matplotlib.pyplot' not in sys.modules\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True, env={"PYTHONPATH": ":".join(sys.path)})


def test_importing_the_plot_costs_no_matplotlib():
    code = "import sys\nfrom hsdsl.analysis import plot, report, store\nassert 'matplotlib' not in sys.modules\n"
    subprocess.run([sys.executable, "-c", code], check=True, env={"PYTHONPATH": ":".join(sys.path)})


CLOCKED = """hsdsl: 1
modes:
  wait:
    flow: {x: v, clock: 1, v: -x, way: 1}
    transitions:
      - {name: tick, when: clock >= 0.4, to: hold, reset: {clock: 0}}
  hold:
    flow: {x: v, clock: 1, v: 1, way: 1}
    transitions: [{name: late, when: since >= 0.7, to: wait, reset: {way: way/2}}]
initial: {mode: wait, x: 1, v: 0, clock: 0, way: 0}
experiment: {until: 2}
"""


def test_what_tells_the_time_is_shown_only_by_name():
    """`way` has the flow 1, too, but no transition sets it to a number."""
    run = hsdsl.loads(CLOCKED).simulate(engine="python")
    view = View(**run.view())
    assert view.names([run]) == ["x", "v", "way"] and view.pairs([run]) == []
    assert View(columns=("clock", "since"), program=view.program).names([run]) == ["clock", "since"]
    flat = hsdsl.loads(CLOCKED.replace(", way: 1", "").replace(", way: 0", "").replace("way: way/2", "x: 1"))
    run = flat.simulate(engine="python")
    assert View(**run.view()).pairs([run]) == [("x", "v")]
    counted = CLOCKED.replace("way: 1", "way: 0").replace("way/2", "way + 1")
    run = hsdsl.loads(counted).simulate(engine="python")
    assert View(**run.view()).pairs([run]) == [("x", "v")] and "way" in View(**run.view()).names([run])
    for rate, shown in {"2": False, "1/T": False, "-sqrt(4*pi)": False, "1 + t": True, "v": True}.items():
        text = "parameters: {T: 2}\nmodes:" + CLOCKED.split("modes:")[1].replace("clock: 1", f"clock: {rate}")
        run = hsdsl.loads("hsdsl: 1\n" + text).simulate(engine="python")
        assert ("clock" in View(**run.view()).names([run])) is shown, rate
    run = flat.simulate(engine="python")
    assert View().names([run]) == ["x", "clock", "v"]  # of a saved run nothing else is known
    timer = hsdsl.loads(
        "hsdsl: 1\nmodes: {m: {flow: {c: 1}, transitions: [{when: c >= 1, to: m, reset: {c: 0}}]}}\n"
        "initial: {mode: m, c: 0}\nexperiment: {until: 2.5}\n"
    ).simulate(engine="python")
    assert View(**timer.view()).names([timer]) == ["c"]


@pytest.mark.parametrize("label", ["up", "from the first gear to the second, and on", "a" * 200])
def test_labels_of_guards_begin_inside_their_axis(label):
    run = hand_made.bouncing_ball(bounces=3)
    figure = _figure(run, guards=[GuardLine("fly", "h", 1.9, label), GuardLine("fly", "v", -1.9, label)])
    axis = figure.axes[0]
    figure.canvas.draw()
    for text in axis.texts:
        if text.get_text().startswith(label[:2]):
            assert text.get_window_extent().x0 >= axis.get_window_extent().x0


def test_ends_of_several_runs_have_their_colours():
    runs = [replace(hand_made.bouncing_ball(bounces=n), stop=Stop("zeno", 1.0, "why")) for n in (1, 2, 3)]
    axis = _figure(*runs).axes[1]
    ends = [drawn for drawn in axis.get_lines() if list(drawn.get_ydata()) == [0, 1] and len(drawn.get_xdata()) == 2]
    assert [drawn.get_color() for drawn in ends] == list(RUN_COLOURS[:3])


SHAKEN = """hsdsl: 1
parameters: {minimum: 0.3, w: 4}
modes:
  fly:
    flow: {h: v, v: -1}
    transitions:
      - {name: low, when: "h <= max(minimum*sin(w*t), -0.1)", to: fly, reset: {v: 2 - v/2}}
      - {name: gate, when: "h >= select(t - 1, 9, 4) + floor(t)", to: fly, reset: {v: -1}}
initial: {mode: fly, h: 1, v: 0}
experiment: {until: 3}
"""


def test_guards_that_move_are_drawn_where_they_are():
    """A parameter may have the name of a function that formulas are printed with."""
    run = hsdsl.loads(SHAKEN).simulate(parameters={"w": 5})
    dotted = [one for one in _figure(run, **run.view()).axes[0].get_lines() if one.get_linestyle() == ":"]
    low, gate = (np.array(one.get_data()) for one in dotted)
    assert low[1] == pytest.approx(np.maximum(0.3 * np.sin(5 * low[0]), -0.1), abs=1e-12)
    assert gate[1] == pytest.approx(np.where(gate[0] > 1, 9, 4) + np.floor(gate[0]))
    assert (low[0, 0], low[0, -1]) == (0, 3)


def test_a_state_that_changes_within_its_error_is_a_constant():
    text = "hsdsl: 1\nmodes: {m: {flow: {x: 4e-8*cos(20*t)}}}\ninitial: {mode: m, x: 5}\nexperiment: {until: 3}\n"
    model = hsdsl.loads(text)
    wide, close = (_figure(model.simulate(tolerance=tolerance)).axes[0].get_ylim() for tolerance in (1e-9, 1e-13))
    assert wide == pytest.approx((4.5, 5.5)) and close == pytest.approx((5, 5), abs=1e-7)


def test_many_modes_are_rows_of_bars():
    steps = "".join(
        f"  m{k}: {{flow: {{x: 1}}, transitions: [{{when: x >= {k}/5, to: m{k % 11 + 1}}}]}}\n" for k in range(1, 12)
    )
    run = hsdsl.loads(f"hsdsl: 1\nmodes:\n{steps}initial: {{mode: m1, x: 0}}\nexperiment: {{until: 2}}\n").simulate()
    figure = _figure(run)
    rows = [text.get_text() for text in figure.axes[-1].get_yticklabels()]
    assert rows == [f"m{k}" for k in range(1, 11)]
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["transition"]


def test_parts_with_many_modes_together_have_a_row_each():
    text = """hsdsl: 1
automata:
  lamp:
    parameters: {rate: 1}
    modes:
      off: {flow: {x: rate}, transitions: [{name: on, when: x >= 1, to: lit}]}
      lit: {flow: {x: -rate}, transitions: [{name: out, when: x <= 0, to: off}]}
system: {lamp: {automaton: lamp, count: 4, initial: {mode: off, x: 0}, parameters: {rate: index + 0.3}}}
experiment: {until: 4}
"""
    figure = _figure(hsdsl.loads(text).simulate())
    names = [[text.get_text() for text in axis.get_yticklabels()] for axis in figure.axes]
    (rows,) = [row for row in names if row[0] == "lamp[1]"]
    assert rows == ["lamp[1]", "lamp[2]", "lamp[3]", "lamp[4]"]
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["off", "lit", "transition"]


def test_colours_of_many_modes_differ_and_are_no_black():
    chosen = [np.array(to_rgb(colour)) for colour in colours([f"m{k}" for k in range(60)]).values()]
    assert len({tuple(colour) for colour in chosen}) == 60
    assert min(colour.max() for colour in chosen) > 0.25


ROUNDED = """hsdsl: 1
parameters: {a: 0.1, b: 0.2, c: 0.3, e: 1.6e-19}
modes:
  air:
    flow: {h: v, v: -9.81, p: (a + b - c)*v, q: e*h}
    transitions: [{when: h <= 0, to: air, reset: {v: -0.8*v}}]
initial: {mode: air, h: 1, v: 0, p: 0, q: 0}
experiment: {until: 2}
"""


def test_a_state_of_round_off_is_drawn_as_zero_and_a_small_one_is_not():
    """0.1 + 0.2 - 0.3 is zero, and p with it; q is a charge."""
    run = hsdsl.loads(ROUNDED).simulate()
    assert 0 < run.sizes()["p"] < 1e-15 and 0 < run.sizes()["q"] < 1e-18
    drawn = curves(run)
    assert not drawn.column("p").any() and drawn.column("q")[-1] == run.final.state["q"]
    assert limits_of([drawn], "p") == (-1, 1)
