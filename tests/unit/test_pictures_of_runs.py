"""What pictures of columns, pairs and several runs are made of: data of artists, text of pages, frames of films."""

from __future__ import annotations

import base64
import json
import re
import time
from dataclasses import replace
from pathlib import Path

import hand_made
import numpy as np
import pytest
from matplotlib import colors

import hsdsl
from hsdsl.analysis.plot import View, analyses, plot
from hsdsl.analysis.plot.animation import FPS, MOST, Drawn, Stage, frame_times, shapes_at
from hsdsl.analysis.plot.curves import curves, lap
from hsdsl.analysis.plot.figure import picture
from hsdsl.analysis.plot.page import page, thinned
from hsdsl.analysis.plot.style import fills, looks, styled
from hsdsl.base.errors import UsageError
from hsdsl.engine.execution import Stop
from hsdsl.language.system import Shape

BALL = hand_made.bouncing_ball()
LONG = "a_mode_with_a_very_long_name_"
SCENE = """
hsdsl: 1
modes:
  up: {flow: {x: 1, a: 2}, transitions: [{when: x >= 2, to: down}]}
  down: {flow: {x: -1, a: 0}}
scene:
  - point: [x, 0]
  - line: [[0, 0], [x, 1]]
  - {circle: [x, 1], radius: 1/2}
  - spring: [[0, 2], [x, 2]]
  - {box: [x, 3], width: 2, height: 1, angle: a}
initial: {mode: up, x: 0, a: 0}
experiment: {until: 5}
"""


def modes(count: int, name: str = "mode"):
    """A run through so many modes, each for one unit of time."""
    draft = hand_made.Draft()
    for k in range(count):
        rows = [(float(k + s), [float(k + s), float(-k - s)], [], 0.0, []) for s in (0, 1)]
        draft.arc(f"{name}{k}", ("x", "y"), k, rows)
    return draft.make()


def lines(axis):
    """The curves of an axis, without markers and straight levels."""
    return [drawn for drawn in axis.get_lines() if drawn.get_marker() == "None" and len(drawn.get_xdata()) > 2]


def test_only_chosen_columns_have_panels_and_pairs_have_phase_plots():
    figure = picture([BALL], View(columns=["v"], phases=[("v", "energy"), ("h", "v")]))
    assert [axis.get_ylabel() for axis in figure.axes] == ["v", "energy", "v"]
    assert [axis.get_xlabel() for axis in figure.axes] == ["time t", "v", "h"]
    phase = figure.axes[2]
    x, y = lines(phase)[0].get_data()
    real = np.isfinite(x)
    assert np.allclose(x[real], 2 - (y[real] ** 2) / 2, atol=1e-9) or np.nanmax(x) == 2  # the first flight is one curve
    assert np.allclose((x + y**2 / 2)[: np.flatnonzero(~real)[0]], 2, atol=1e-12)  # with its energy


@pytest.mark.parametrize("view", [{"columns": ["vv"]}, {"phases": [("h", "w")]}])
def test_unknown_names_are_refused_before_a_file_is_there(view, tmp_path):
    with pytest.raises(UsageError, match="no state or output is called"):
        plot(BALL, tmp_path / "run.png", **view)
    assert list(tmp_path.iterdir()) == []


def test_labels_must_be_one_for_each_run():
    with pytest.raises(UsageError, match="expected 2 labels, one for each run, got 1"):
        picture([BALL, BALL], View(labels=["one"]))


def test_several_runs_share_panels_and_each_has_a_ribbon():
    other = hand_made.bouncing_ball(restitution="0.25")
    figure = picture([BALL, other], View(columns=["h", "v"], labels=["half", "quarter"]))
    h, v, phase = figure.axes  # both are in one mode, which needs no ribbon
    for axis, name in ((h, "h"), (v, "v")):
        for run, drawn in zip((BALL, other), lines(axis), strict=True):
            x, y = drawn.get_data()
            at = np.isfinite(y)
            expected = np.concatenate([run.sample(x[at][:1])[name], run.sample(x[at][1:], "left")[name]])
            jumps = np.isin(x[at], [made.time for made in run.transitions])
            assert np.allclose(y[at][~jumps], expected[~jumps], atol=1e-9)
    assert len(lines(phase)) == 2
    texts = [text.get_text() for text in figure.legends[0].get_texts()]
    assert texts == ["half", "quarter", "start", "before a jump", "after"]
    figure = picture([hand_made.thermostat(3)] * 2, View(columns=["T"], labels=["one", "other"]))
    ribbon = figure.axes[1]
    assert [text.get_text() for text in ribbon.get_yticklabels()] == ["one", "other"] and len(ribbon.collections) == 4
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["one", "other", "on", "off", "transition"]


def test_very_many_runs_are_pale_lines_from_dark_to_light():
    figure = picture([BALL] * 30, View(columns=["h"], phases=[]))
    drawn = lines(figure.axes[0])
    assert len(drawn) == 30 and len({each.get_color() for each in drawn}) == 30
    assert all(each.get_alpha() < 1 for each in drawn) and len(figure.legends[0].get_texts()) == 5
    figure.draw_without_rendering()
    assert figure.axes[0].get_window_extent().height > figure.bbox.height / 2


def test_equal_columns_of_very_many_parts_share_a_panel():
    """Each mass is marked at its own impacts only, where it has a panel."""
    model = hsdsl.load(Path(__file__).parents[2] / "models" / "parts" / "chain.yaml")
    run = model.simulate()
    view = View(**run.view())
    assert {name: len(each) for name, each in view.panels([run]).items()} == {
        "energy": 1,
        "mass[*].x": 20,
        "mass[*].v": 20,
    }
    hits = sum(each.edge == "mass[8].hit" for each in run.transitions)
    axis = picture([run], View(columns=["mass[8].v"])).axes[0]
    assert [len(each.get_xdata()) for each in axis.get_lines() if each.get_marker() == "o"] == [hits, hits]


def test_a_run_without_a_column_leaves_the_other_s():
    figure = picture([BALL, hand_made.thermostat(3)], View(columns=["T", "h"]))
    for axis in figure.axes[:2]:
        assert sum(np.isfinite(drawn.get_ydata()).any() for drawn in lines(axis)) == 1


@pytest.mark.parametrize("count", [1, 2, 4, 8, 12])
def test_lines_of_runs_differ_without_colours_too(count):
    found = [(look["color"], str(look["linestyle"])) for look in looks(count)]
    assert len(set(found)) == count and len({dashes for _, dashes in found}) == min(count, 4)


def test_bands_of_eight_modes_differ_in_colour_or_hatch():
    light = [(fill["facecolor"], fill.get("hatch")) for fill in fills([f"m{k}" for k in range(8)]).values()]
    assert len({hatch for _, hatch in light[5:]}) == 3
    pairs = [(a, b) for k, a in enumerate(light) for b in light[:k] if a[1] == b[1]]
    assert min(np.abs(np.subtract(colors.to_rgb(a[0]), colors.to_rgb(b[0]))).max() for a, b in pairs) > 0.05


@pytest.mark.parametrize(
    ("count", "name", "runs"), [(1, "m", 1), (8, LONG, 1), (8, LONG, 3), (20, "m", 1), (2, LONG, 3), (8, LONG * 3, 1)]
)
def test_legends_titles_and_panels_keep_off_each_other(count, name, runs):
    title = "A title that goes on and on, beyond what one line of the whole picture has room for, " * 2
    figure = picture([modes(count, name)] * runs, View(title=title))
    figure.draw_without_rendering()
    boxes = [legend.get_window_extent() for legend in figure.legends]
    boxes += [figure._suptitle.get_window_extent()]
    boxes += [axis.get_window_extent() for axis in figure.axes]
    boxes += [axis.title.get_window_extent() for axis in figure.axes if axis.title.get_text()]
    boxes += [axis._left_title.get_window_extent() for axis in figure.axes if axis._left_title.get_text()]
    for k, box in enumerate(boxes):
        assert not any(box.shrunk(0.999, 0.999).overlaps(other) for other in boxes[:k])
        assert box.x0 >= 0 and box.x1 <= figure.bbox.width and box.y0 >= 0 and box.y1 <= figure.bbox.height


def test_names_of_modes_keep_off_the_power_of_ten_of_an_axis():
    run = modes(2)
    tiny = replace(run, values=run.values * 1e-9)
    figure = picture([tiny], View())
    figure.draw_without_rendering()
    axis = figure.axes[0]
    power = axis.yaxis.get_offset_text()
    assert power.get_text() and not any(power.get_window_extent().overlaps(t.get_window_extent()) for t in axis.texts)


def test_long_labels_of_guards_leave_the_panel_its_width():
    from hsdsl.analysis.plot import GuardLine

    guards = [GuardLine(f"mode{k}", "x", 4.0, "a transition with a long name " * 3 + str(k)) for k in range(8)]
    figure = picture([modes(8)], View(guards=guards))
    figure.draw_without_rendering()
    assert figure.axes[0].get_window_extent().width > figure.bbox.width / 3
    assert any(text.get_text().endswith("more") for text in figure.axes[0].texts)


def numbers(text, kind):
    return np.frombuffer(base64.b64decode(text), dtype=kind)


def data_of(text):
    found = dict(re.findall(r'<script type="application/json" id="(\w+)">(.*?)</script>', text))
    return json.loads(found["model"]), json.loads(found["runs"])


def test_a_page_has_the_numbers_of_its_runs():
    other = hand_made.bouncing_ball(restitution="0.25")
    model, runs = data_of(page([BALL, other], View(labels=["a", "b"], units={"h": "m"})))
    assert (model["columns"], model["units"], model["phases"]) == (["h", "v", "energy"], {"h": "m"}, [["h", "v"]])
    for run, drawn in zip((BALL, other), runs, strict=True):
        times, h = numbers(drawn["times"], "<f8"), numbers(drawn["columns"][0], "<f8")
        assert np.allclose(h, run.sample(times)["h"], atol=1e-9)
        arc = numbers(drawn["arcOf"], "<i4")
        start, end = (numbers(drawn["arcs"][key], "<f8")[arc] for key in ("start", "end"))
        assert (times >= start).all() and (times <= end).all() and (np.diff(arc) >= 0).all()
        assert [drawn["label"], drawn["failed"]] == [["a", "b"][run is other], False]


def test_a_page_of_chosen_columns_has_no_others():
    model, runs = data_of(page([BALL], View(columns=["v"], phases=[("v", "energy")])))
    assert (model["columns"], model["shown"]) == (["v", "energy"], ["v"]) and len(runs[0]["columns"]) == 2


def test_a_page_of_very_many_points_keeps_their_extremes():
    run = hand_made.thermostat(30_000)
    drawn = curves(run)
    kept = thinned(drawn, ["T"], 20_000)
    assert 2 * len(kept) <= 20_000 and kept[0] == 0 and kept[-1] == len(drawn.samples) - 1
    time, values = drawn.samples.time, drawn.column("T")
    for cut in np.array_split(np.arange(len(time)), 100):
        inside = kept[(time[kept] >= time[cut[0]]) & (time[kept] <= time[cut[-1]])]
        assert (values[inside].min(), values[inside].max()) == (values[cut].min(), values[cut].max())
    assert (thinned(drawn, ["T"], 10**9) == np.arange(len(time))).all()


@pytest.fixture(scope="module")
def staged():
    model = hsdsl.loads(SCENE)
    return model, model._staged.simulate(engine="python")


def test_shapes_have_the_numbers_of_the_run(staged):
    model, run = staged
    times = np.linspace(0, 5, 11)
    samples = run.sample(times)
    for row, t in enumerate(times):
        x = t if t <= 2 else 4 - t
        a = 2 * min(t, 2)
        point, line, circle, spring, box = dict(shapes_at(samples, model.system.scene, row)).values()
        assert np.allclose(point.points, [[x, 0]]) and np.allclose(line.points, [[0, 0], [x, 1]])
        assert np.allclose(circle.points, [[x, 1]]) and circle.sizes == (0.5,)
        assert np.allclose(spring.outline[[0, -1]], [[0, 2], [x, 2]])
        corner = box.outline[2] - [x, 3]
        assert np.allclose(corner, [np.cos(a) - np.sin(a) / 2, np.sin(a) + np.cos(a) / 2])


def test_a_shape_without_a_number_is_left_out():
    class Samples(dict):
        pass

    values = Samples({f"scene {k}": np.array([float("nan") if k == 1 else 1.0]) for k in range(4)})
    there = shapes_at(values, [Shape("point", 1, 2), Shape("point", 1, 2)], 0)
    assert [(k, drawn.points.tolist()) for k, drawn in there] == [(1, [[1.0, 1.0]])]


def test_a_spring_of_no_length_is_a_point():
    spring = Drawn("spring", np.ones((2, 2)), ())
    assert np.allclose(spring.outline, 1)


def test_a_film_lasts_as_the_run_or_as_its_speed_says(tmp_path):
    run = modes(8)
    assert len(frame_times(run, None)) == 8 * FPS + 1
    assert len(frame_times(run, 2.0)) == 4 * FPS + 1
    assert frame_times(modes(2), None)[-1] == 2 and len(frame_times(modes(2), None)) == 4 * FPS + 1
    with pytest.raises(UsageError, match=rf"choose a speed of at least {8 * FPS / MOST:.3g}"):
        frame_times(run, 1e-3)
    for speed in (0.0, -1.0, float("nan"), float("inf")):
        with pytest.raises(UsageError, match="positive speed"):
            frame_times(run, speed)


def test_a_film_of_a_run_that_blows_up_ends(tmp_path):
    """The last values are of size 1e15: shapes there are left out, as they would be drawn for minutes."""
    model = hsdsl.loads(
        "hsdsl: 1\nmodes: {grow: {flow: {x: x**2}}}\nscene: [{circle: [x + 1e6, 1], radius: x/10}]\n"
        "initial: {mode: grow, x: 1}\nexperiment: {until: 3}\n"
    )
    began = time.perf_counter()
    run = model.animate(tmp_path / "film.gif", speed=1, engine="python")
    assert not run.stop.complete and (tmp_path / "film.gif").stat().st_size > 1000
    assert time.perf_counter() - began < 30
    circle = Drawn("circle", np.array([[1e6 + 1, 1.0]]), (0.1,))
    assert circle.reach(np.array([1e6, 1.0])) == pytest.approx(1.1)


def test_a_film_has_its_frames(tmp_path):
    from PIL import Image

    model = hsdsl.loads(SCENE)
    run = model.animate(tmp_path / "film.gif", speed=10, engine="python")
    assert run.final.time == 5 and run.output_names[0] == "scene 0"
    with Image.open(tmp_path / "film.gif") as film:
        assert film.n_frames == round(5 / 10 * FPS) + 1 and film.info["duration"] == 1000 / FPS
        first = np.asarray(film.convert("L"), dtype=int)
        film.seek(6)
        assert np.abs(np.asarray(film.convert("L"), dtype=int) - first).max() > 100  # shapes have moved


FOLLOWED = """hsdsl: 1
modes:
  near:
    flow: {x: 1, h: 1}
    transitions: [{when: x >= 2, to: far}]
  far: {flow: {x: 1}}
scene:
  - line: [[0, 0], [8, 0]]
  - point: [x, 1]
  - {view: [x, h], width: 2, height: 1 - x/16}
initial: {mode: near, x: 0, h: 1}
experiment: {until: 4}
"""


def staged_at(text, times):
    model = hsdsl.loads(text)
    run = model._staged.simulate(engine="python")
    with styled():
        return Stage(run, run.sample(np.array(times)), model.system.scene, None)


def test_a_film_shows_its_view_and_else_everything():
    """The axes keep the shape of the first view, 2 by 1; a mode without h has none."""
    stage = staged_at(FOLLOWED, [0.0, 1.0, 3.0])
    for row, (x, y, width) in enumerate([(0, 1, 2), (1, 2, 2), (4, 0.5, 8 * 1.12)]):
        stage.frame(row)
        ends = np.array([stage.scene.get_xlim(), stage.scene.get_ylim()])
        assert np.allclose(ends.mean(axis=1), (x, y)) and np.allclose(np.ptp(ends, axis=1), (width, width / 2))


def test_a_view_without_size_is_refused():
    with pytest.raises(UsageError, match=r"expected a view with a positive size, got 2 by 0 at t = 1"):
        staged_at(FOLLOWED.replace("1 - x/16", "1 - x"), [0.0, 1.0]).frame(1)


def test_a_frame_does_not_depend_on_those_before_it():
    stage = staged_at(SCENE, np.linspace(0, 5, 6))
    forwards = [stage.frame(row) for row in range(6)]
    assert all(np.array_equal(stage.frame(row), forwards[row]) for row in reversed(range(6)))
    assert not np.array_equal(forwards[0], forwards[5])


def test_the_colours_of_a_film_are_those_of_the_picture(tmp_path):
    from PIL import Image

    hsdsl.loads(SCENE).animate(tmp_path / "film.gif", speed=10, engine="python")
    own = staged_at(SCENE, np.linspace(0, 5, round(5 / 10 * FPS) + 1))
    with Image.open(tmp_path / "film.gif") as film:
        for row in (0, 4, 12):
            film.seek(row)
            off = np.abs(np.asarray(film.convert("RGB"), dtype=int) - own.frame(row))
            assert off.max() <= 32 and np.mean(off == 0) > 0.98


def test_what_cannot_be_a_film_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr("hsdsl.analysis.plot.animation.which", lambda name: None)
    with pytest.raises(UsageError, match="needs the program ffmpeg") as refusal:
        hsdsl.loads(SCENE).animate(tmp_path / "film.mp4")
    assert "write a .gif" in (refusal.value.hint or "")
    with pytest.raises(UsageError, match="the model has no scene"):
        hsdsl.loads(SCENE.split("scene:")[0] + "initial: {mode: up, x: 0, a: 0}\nexperiment: {until: 1}\n").animate(
            tmp_path / "film.gif"
        )
    with pytest.raises(UsageError, match=r"should end in .gif or .mp4"):
        hsdsl.loads(SCENE).animate(tmp_path / "film.avi")
    assert list(tmp_path.iterdir()) == []


def test_a_failed_run_says_so_in_every_picture():
    failed = replace(modes(3), stop=Stop("not_finite", 3.0, "x has no value."))
    figure = picture([failed, modes(3)], View())
    assert "1 stopped before the end" in figure.axes[2].get_title(loc="left")
    ends = [drawn for drawn in figure.axes[0].get_lines() if list(drawn.get_xdata()) == [3.0, 3.0]]
    assert len(ends) == 1
    assert data_of(page([failed], View()))[1][0]["failed"]


def test_the_legend_of_many_sequences_is_short():
    from hsdsl.analysis.plot import analyses

    points = [(10.0**-k, 10.0**-k, (f"a_transition_with_a_name_{j}",) * 9) for k in (2, 3) for j in range(40)]
    figure = analyses.plot_nearby.__wrapped__(points, "title")
    texts = [text.get_text() for text in figure.legends[0].get_texts()]
    assert len(texts) == analyses.MOST + 2 and texts[-1] == "and 28 other sequences"
    figure.draw_without_rendering()
    (axis,) = figure.axes
    assert axis.get_window_extent().height > figure.bbox.height / 3
    assert not axis.get_window_extent().overlaps(figure.legends[0].get_window_extent())


def test_a_branch_says_which_lines_are_stable():
    from hsdsl.analysis.plot import analyses

    points = [(0.1 * k, float(k), k not in (4, 5, 6)) for k in range(12)]
    figure = analyses.plot_branch.__wrapped__("c", "x", points, [("fold", 0.3, 3.0)], "title")
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["stable", "unstable", "fold"]


def test_a_stable_piece_of_a_branch_ends_at_its_marks():
    from hsdsl.analysis.plot import analyses

    points = [(1.0, 4.0, False), (0.5, 3.5, None), (0.6, 3.0, True), (0.9, 2.0, None), (1.2, 1.0, False)]
    figure = analyses.plot_branch.__wrapped__("c", "x", points, [("fold", 0.5, 3.5), ("flip", 0.9, 2.0)], "title")
    lines = [(line.get_linestyle(), np.asarray(line.get_xdata()).tolist()) for line in figure.axes[0].lines]
    assert lines[:3] == [("--", [1.0, 0.5]), ("-", [0.5, 0.6, 0.9]), ("--", [0.9, 1.2])]


@pytest.mark.parametrize(("states", "jump"), [(["s", "w"], [(1, 0), (0, 0)]), (["s"], [(1, 1), (1, 0)])])
def test_an_orbit_has_the_jump_of_its_section(states, jump):
    """A timer over one period: s rises to 1 and is set to 0, w is 0."""
    text = "hsdsl: 1\nmodes: {m: {flow: {s: 1, w: 0}, transitions: [{when: s >= 1, to: m, reset: {s: 0}}]}}"
    run = hsdsl.loads(f"{text}\ninitial: {{mode: m, s: 0, w: 0}}\nexperiment: {{until: 2.5}}\n").simulate()
    drawn = lap(curves(run), 1.0)
    figure = analyses.plot_orbit.__wrapped__(drawn, states, np.zeros(1), View(), "m->m", "")
    marks = [each.get_xydata()[0] for each in figure.axes[0].lines if each.get_marker() == "o"]
    assert np.array(marks) == pytest.approx(np.array(jump, float), abs=1e-12)
    assert figure.legends[0].get_texts()[-1].get_text() == "after"


def test_pages_have_guards_that_move(tmp_path):
    model = hsdsl.load(Path(__file__).parents[2] / "models" / "gallery" / "moving-guard.yaml")
    model.plot(model.simulate(until=2), tmp_path / "run.html")
    text = re.search(r'id="model"[^>]*>(.*?)</script>', (tmp_path / "run.html").read_text("utf-8"), re.DOTALL)
    (plate,) = json.loads(text[1])["moving"]
    times, values = (np.frombuffer(base64.b64decode(plate[key])) for key in ("times", "values"))
    assert (plate["state"], plate["label"], times[0], times[-1]) == ("h", "bounce", 0, 2)
    np.testing.assert_allclose(values, 0.05 * np.sin(5 * times), atol=1e-15)


@pytest.mark.parametrize(("first", "whole"), [(1.0, True), (0.5, False)])
def test_counts_have_whole_ticks(first, whole):
    count = hsdsl.loads(f"""
hsdsl: 1
modes: {{m: {{flow: {{s: 1, n: 0}}, transitions: [{{when: s >= 1, to: m, reset: {{s: 0, n: n + 1}}}}]}}}}
initial: {{mode: m, s: 0, n: {first}}}
experiment: {{until: 2.5}}
""").simulate()
    (axis,) = picture([count], View(columns=["n"])).axes
    assert bool((axis.get_yticks() % 1 == 0).all()) is whole
