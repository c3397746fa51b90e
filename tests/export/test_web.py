"""Web pages: their text, and in a browser against runs, every transition to 1e-9 of its size after settings moved."""

from __future__ import annotations

import json
from collections.abc import Mapping
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import pytest
from export.web_pages import (
    after,
    browser,
    complaints,
    exported,
    in_browser,
    needs_compiler,
    numbers,
    opened,
    parts,
    typed,
)
from shipped import MODELS, assert_golden

import hsdsl
from hsdsl.analysis.report import as_json
from hsdsl.base.errors import UsageError
from hsdsl.base.names import without_memory
from hsdsl.export import files_of, source_of, web
from hsdsl.export.web import model as page
from hsdsl.export.web.model import model_of
from hsdsl.interface.cli.verbs import obey
from hsdsl.interface.model import Model

CONFORMANCE = Path(__file__).parents[1] / "conformance" / "cases"
# inputs of each kind, linear switches of time, derived parameters, and settings that follow parameters
FOLLOWING = """
hsdsl: 1
parameters: {k: 2, half: k/2, T: {value: 6, min: 1, max: 50}, low: -half}
inputs:
  u: {times: [0, half, 2.5], values: [1, -1, half], hold: zero}
  w: {times: [0, T/2], values: [0, 1], hold: linear}
modes:
  on:
    flow: {x: u + w + sign(3/2 - (t - floor(t/k)*k)), y: -y}
    transitions:
      - {when: x >= 1, to: on, reset: {x: low}}
      - {when: y <= 1/20, to: off, reset: {z: y}}
  off: {flow: {z: 1}, transitions: [{when: z >= half/2 + 1/10, to: end}]}
  end: {final: true}
outputs: {sum: x + y}
initial: {mode: on, x: 0, y: k}
experiment: {until: 2*T, method: dopri5, scale: {y: k}}
"""
CURVED = """
hsdsl: 1
parameters: {w: 3, phase: w/10, gain: 2, T: 4}
modes:
  on: {flow: {x: gain*sign(sin(w*t + phase)) - x}, transitions: [{when: x >= 1, to: on, reset: {x: -x/2}}]}
initial: {mode: on, x: 0}
experiment: {until: T}
"""
HOSTILE = "</script><img src=x onerror=hacked=1><!--{{wasm}} \\u2028 ${1} \" ' & \\\\ %s"
ESCAPING = f"""
hsdsl: 1
title: {json.dumps(HOSTILE)}
parameters: {{a: {{value: 1, about: {json.dumps(HOSTILE)}, unit: {json.dumps(HOSTILE)}}}}}
modes:
  "<b>&{{{{script}}}}":
    flow: {{x: a}}
    transitions: [{{when: x >= 1, to: "<b>&{{{{script}}}}", name: {json.dumps(HOSTILE)}, reset: {{x: 0}}}}]
units: {{x: {json.dumps(HOSTILE)}}}
initial: {{mode: "<b>&{{{{script}}}}", x: 0}}
experiment: {{until: 3}}
"""
STAND = """
hsdsl: 1
modes: {on: {flow: {x: v, v: -9.81}, transitions: [{when: x <= 0, to: on, reset: {v: -v/2}}]}}
initial: {mode: on, x: 1, v: 0}
experiment: {until: 4}
"""
# sliding has a mode of its own, with its part of outputs and scene; a ball that rolls on has none
SLIDING = """
hsdsl: 1
parameters: {up: 1}
modes:
  a: {flow: {x: up, y: 1}, transitions: [{when: x >= 0, to: b}]}
  b: {flow: {x: -1, y: 2}, transitions: [{when: x <= 0, to: a}]}
outputs: {sum: x + y}
scene: [{point: [x, y]}, {circle: [x, t], radius: up}]
initial: {mode: a, x: -1, y: 0}
experiment: {until: 3, completion: auto}
"""
ROLLING = """
hsdsl: 1
parameters: {g: 9.81}
modes: {on: {flow: {x: 1, h: v, v: -g}, transitions: [{when: h <= 0, to: on, reset: {v: -v/2}}]}}
initial: {mode: on, x: 0, h: 1, v: 0}
experiment: {until: 4}
"""
STATELESS = """
hsdsl: 1
parameters: {T: 1}
modes: {a: {flow: {}, transitions: [{when: t >= T, to: b}]}, b: {flow: {}}}
initial: {mode: a}
experiment: {until: 2}
"""
REMEMBERING = """
hsdsl: 1
modes: {m: {flow: {x: cos(t), n: 0}, transitions: [{name: up, event: x > 1/2, delay: 0.1, reset: {n: n + x}}]}}
initial: {mode: m, x: 0, n: 0}
experiment: {until: 9}
"""
USING = """
hsdsl: 1
parameters: {k: 2}
modes: {m: {flow: {x: -x, y: 1, z: -k*z, w: 0}}}
initial: {mode: m, x: k*y, y: z/3, z: 1, w: x + y}
experiment: {until: 1}
"""
IN_STRIP = """
hsdsl: 1
automata:
  A:
    modes: {off: {flow: {x: 1}, transitions: [{when: x >= 1, to: on}]}, on: {flow: {x: 0}}}
system:
  a: {automaton: A, initial: {mode: off, x: 0}}
  b: {automaton: A, initial: {mode: off, x: -5}}
experiment: {until: 1.05, scheme: relaxed, relaxation: 0.1}
"""
ENDINGS = ["m1-wall-stops", "m1-outside-a-wall", "m10-not-finite", "m10-reset-not-finite", "m10-start-in-final"]
ENDINGS += ["m10-sliding", "m10-transition-limit", "m10-zeno-cycle", "dimensions", "m5-entry-at-input-jump"]
REFUSING = """
hsdsl: 1
parameters: {a: {value: 1, min: 1/2, max: 2}, b: 1/a}
modes: {on: {flow: {x: b}}}
initial: {mode: on, x: a}
experiment: {until: 1/(2 - a)}
"""


def check(driver: Any, run: Any, exactly: float = 1e-9) -> None:
    """Compare a page's last run with a run."""

    def near(value: Any) -> Any:
        return value if value is None else pytest.approx(value, rel=exactly, abs=exactly)

    found, expected = numbers(driver), as_json(run)
    assert driver.find_element("id", "outcome").text.startswith(expected["stop"]["reason"])
    assert found["time"] == near(expected["stop"]["time"])
    assert [t["edge"] for t in found["transitions"]] == [t["edge"] for t in expected["transitions"]]
    for one, other in zip(found["transitions"], expected["transitions"], strict=True):
        assert one["time"] == near(other["time"]) and one["resumed"] == near(other["resumed"])
        assert one["before"] == near(other["before"]) and one["after"] == near(other["after"])
        assert one["alternatives"] == other["alternatives"]
    final = {k: v for k, v in found["final"].items() if v is not None}
    outputs = {k: v for k, v in expected["final"]["outputs"].items() if v is not None}
    state = {name: expected["final"]["state"][name] for name in without_memory(expected["final"]["state"])}
    assert final == near(state | outputs)


def simulated(model: Model, changes: Mapping[str, Any], **arguments: Any) -> Any:
    """A run with settings by their names in a page."""
    initial = {name.removeprefix("initial."): v for name, v in changes.items() if name.startswith("initial.")}
    parameters = {name: v for name, v in changes.items() if "." not in name}
    return model.simulate(**arguments, parameters=parameters, initial=initial)


def page_of(text: str, **arguments: Any) -> str:
    (content,) = files_of(source_of(hsdsl.loads(text), arguments), "web").values()
    return content.decode()


@pytest.fixture(scope="module")
def driver():
    with browser() as started:
        yield started


CASES: list[tuple[str, dict[str, float], dict[str, Any]]] = [
    ("pronking-runner", {"k": 33.0, "initial.w": -0.4}, {}),
    ("oscillator-with-stop-1", {"c": 0.85, "initial.x": 12.5}, {"until": 20}),
    ("oscillator-with-stop-2", {"initial.v": 20.0}, {"until": 8}),
    ("bouncing-ball", {"initial.h": 2.5, "e": 0.8}, {"until": 2}),
    ("constrained-pendulum", {"pin": -0.2}, {}),
    ("digital-control", {"initial.x": -1.1}, {}),
    ("stiff-switch", {"high": 5.7}, {}),
    ("thermostat", {"heater": 31.0, "initial.T": 19.0}, {}),
    ("bouncing-ball", {"e": 0.4}, {"scheme": "relaxed", "method": "rk4", "step": 1e-2, "relaxation": 1e-4}),
    ("thermostat", {"rate": 0.2}, {"method": "dop853", "tolerance": 1e-7}),
]
CASES += [(path.stem, {}, {}) for path in MODELS.glob("*.yaml") if path.stem not in {name for name, _, _ in CASES}]


@in_browser
class TestASlider:
    def test_a_slider_moves_the_numbers_that_are_shown(self, driver, tmp_path):
        from selenium.webdriver.common.keys import Keys

        model = hsdsl.load(MODELS / "bouncing-ball.yaml")
        opened(driver, exported(model, tmp_path, until=2))
        box = driver.find_element("css selector", "input[name='e']")
        slider = driver.find_element("css selector", "input[name='e'] ~ input[type=range]")
        after(driver, lambda: slider.send_keys(Keys.ARROW_LEFT))
        e = float(box.get_property("value"))
        assert 0 < e < 0.8
        expected = [t.time for t in model.simulate(until=2, parameters={"e": e}).transitions]
        cells = driver.find_elements("css selector", "#transitions tbody td[data-value]")
        assert [float(cell.get_attribute("data-value")) for cell in cells] == pytest.approx(expected, rel=1e-9)
        assert f"after {len(expected)} transitions" in driver.find_element("id", "outcome").text


@pytest.mark.slow
@in_browser
class TestInABrowser:
    @pytest.mark.parametrize(("name", "changes", "arguments"), CASES)
    def test_moved_settings_give_the_run_with_them(self, driver, name, changes, arguments, tmp_path):
        model = hsdsl.load(MODELS / f"{name}.yaml")
        opened(driver, exported(model, tmp_path, **arguments))
        check(driver, model.simulate(**arguments))
        for setting, value in changes.items():
            typed(driver, setting, value)
        check(driver, simulated(model, changes, **arguments))
        assert complaints(driver) == []

    @pytest.mark.parametrize("name", ENDINGS)
    def test_runs_end_as_they_do(self, driver, name, tmp_path):
        model = hsdsl.load(CONFORMANCE / f"{name}.yaml")
        opened(driver, exported(model, tmp_path))
        check(driver, model.simulate())

    def test_every_digit_is_equal_where_no_function_of_a_library_is_called(self, driver, tmp_path):
        arguments = {"scheme": "relaxed", "method": "rk4", "step": 1e-2, "relaxation": 1e-4}
        model = hsdsl.load(MODELS / "bouncing-ball.yaml")
        opened(driver, exported(model, tmp_path, **arguments))
        typed(driver, "e", 0.6)
        check(driver, model.simulate(**arguments, parameters={"e": 0.6}), exactly=0)

    def test_a_model_without_states_is_a_page(self, driver, tmp_path):
        model = hsdsl.loads(STATELESS)
        opened(driver, exported(model, tmp_path))
        check(driver, model.simulate())
        typed(driver, "T", 1.5)
        check(driver, model.simulate(parameters={"T": 1.5}))
        assert complaints(driver) == []

    def test_expressions_follow_the_parameters_they_are_of(self, driver, tmp_path):
        model = hsdsl.loads(FOLLOWING)
        opened(driver, exported(model, tmp_path))
        assert driver.execute_script("return model.controls.filter((each) => each.fixed).length") == 0
        changes: dict[str, float] = {}
        check(driver, model.simulate())
        for name, value in [("k", 2.7), ("T", 9.5), ("low", -0.1), ("initial.y", 1.2), ("half", 0.6), ("k", 0.9)]:
            changes[name] = value
            typed(driver, name, value)
            run = simulated(model, changes)
            check(driver, run)
        after(driver, lambda: driver.find_element("id", "reset").click())
        check(driver, model.simulate())

    def test_what_decides_curved_switches_is_fixed(self, driver, tmp_path):
        model = hsdsl.loads(CURVED)
        opened(driver, exported(model, tmp_path, parameters={"w": 5}))
        fixed = "return model.controls.filter((each) => each.fixed).map((each) => each.name)"
        assert driver.execute_script(fixed) == ["w", "phase", "T"]
        assert "w, phase, T" in driver.find_element("id", "notes-on-settings").text
        assert not driver.find_element("css selector", "input[name='w']").is_enabled()
        typed(driver, "gain", 3.0)
        check(driver, model.simulate(parameters={"w": 5, "gain": 3}))

    @pytest.mark.parametrize(("text", "name", "value"), [(SLIDING, "up", 0.75), (ROLLING, "g", 5.0)])
    def test_motion_beyond_accumulation_is_that_of_a_run(self, driver, text, name, value, tmp_path):
        model = hsdsl.loads(text)
        opened(driver, exported(model, tmp_path))
        check(driver, model.simulate())
        typed(driver, name, value)
        check(driver, model.simulate(parameters={name: value}))

    def test_overrides_of_the_export_are_where_it_starts(self, driver, tmp_path):
        arguments = {"parameters": {"k": "1+2"}, "initial": {"x": 0.25}, "until": 5}
        model = hsdsl.loads(FOLLOWING)
        opened(driver, exported(model, tmp_path, **arguments))
        check(driver, model.simulate(**arguments))
        typed(driver, "T", 8.0)  # the end is given, and stays
        check(driver, model.simulate(parameters={"k": 3, "T": 8}, initial={"x": 0.25}, until=5))

    def test_a_link_carries_the_settings(self, driver, tmp_path):
        model = hsdsl.loads(FOLLOWING)
        path = exported(model, tmp_path)
        opened(driver, path)
        for name, value in (("k", 1 / 3), ("initial.y", 0.7)):
            typed(driver, name, value)
        link = driver.execute_script("return location.hash").lstrip("#")
        opened(driver, path, link)
        check(driver, simulated(model, {"k": 1 / 3, "initial.y": 0.7}))
        opened(driver, path, "k=4&nonsense&T=&low=x&%ff=1&initial.z=2")
        check(driver, simulated(model, {"k": 4}))

    def test_refused_settings_are_named_and_the_last_run_stays(self, driver, tmp_path):
        opened(driver, exported(hsdsl.loads(REFUSING), tmp_path))
        sentences = [
            ("a", 0.25, "parameter a is below its minimum"),
            ("a", 2.5, "parameter a is above its maximum"),
            ("a", 2.0, "until has no finite value"),
        ]
        for name, value, sentence in sentences:
            typed(driver, name, value)
            assert sentence in driver.find_element("id", "outcome").text
            assert driver.execute_script("return run.parameters[0]") == 1
        after(driver, lambda: driver.find_element("id", "reset").click())
        assert driver.find_element("id", "outcome").text.startswith("until: reached")

    def test_notes_of_a_run_are_shown(self, driver, tmp_path):
        opened(driver, exported(hsdsl.loads(STAND), tmp_path))
        printed = driver.find_element("id", "run").text
        assert "Zeno at t = " in printed and "at rest on the guard of on->on" in printed
        assert "left" in driver.find_element("id", "verdict").text
        typed(driver, "initial.x", 2.0)
        assert driver.find_element("id", "verdict-title").text.endswith("not of these")

    def test_sliding_is_named(self, driver, tmp_path):
        opened(driver, exported(hsdsl.loads(SLIDING.replace(", completion: auto", "")), tmp_path))
        assert "zeno: sliding at t = 1: the flows of" in driver.find_element("id", "outcome").text

    def test_memory_of_events_is_no_slider_and_follows_the_start(self, driver, tmp_path):
        model = hsdsl.loads(REMEMBERING)
        opened(driver, exported(model, tmp_path))
        names = "return [model.columns, [...document.querySelectorAll('#controls input[name]')].map((e) => e.name)]"
        assert driver.execute_script(names) == [["x", "n"], ["initial.x", "initial.n"]]
        assert "@" not in driver.find_element("id", "transitions").text
        for x in (0.75, -0.25):  # beyond the threshold, the event is not armed where the run starts
            typed(driver, "initial.x", x)
            check(driver, simulated(model, {"initial.x": x}))

    def test_initial_values_follow_those_that_they_use(self, driver, tmp_path):
        model = hsdsl.loads(USING)
        opened(driver, exported(model, tmp_path, initial={"z": 5}))
        for name, value in (("initial.y", 0.5), ("k", 3), ("initial.x", 2)):
            typed(driver, name, value)
        check(driver, simulated(model, {"initial.z": 5, "initial.y": 0.5, "k": 3, "initial.x": 2}))
        after(driver, lambda: driver.find_element("id", "reset").click())
        check(driver, model.simulate(initial={"z": 5}))

    def test_a_transition_in_whose_strip_the_run_ends_has_its_target(self, driver, tmp_path):
        model = hsdsl.loads(IN_STRIP)
        run = model.simulate()
        assert run.transitions[-1].resumed is None and run.transitions[-1].target == "a=on b=off"
        opened(driver, exported(model, tmp_path))
        row = driver.find_element("css selector", "#transitions tbody tr:last-child").text
        assert "a=on b=off" in row and "?" not in row

    def test_texts_of_a_model_stay_texts(self, driver, tmp_path):
        model = hsdsl.loads(ESCAPING)
        opened(driver, exported(model, tmp_path))
        assert driver.execute_script("return typeof hacked") == "undefined"
        assert driver.find_elements("css selector", "img, b") == []
        assert driver.find_element("tag name", "h1").text == HOSTILE
        assert driver.title == HOSTILE
        assert complaints(driver) == []
        check(driver, model.simulate())

    def test_keys_play_the_scene_and_move_the_time(self, driver, tmp_path):
        from selenium.webdriver.common.keys import Keys

        opened(driver, exported(hsdsl.load(MODELS / "pronking-runner.yaml"), tmp_path))
        cursor, play = driver.find_element("id", "cursor"), driver.find_element("id", "play")
        picture = "return document.getElementById('scene').toDataURL()"
        first = driver.execute_script(picture)
        for _ in range(3):
            cursor.send_keys(Keys.PAGE_UP)
        assert driver.execute_script(picture) != first
        shown = float(driver.find_element("css selector", "#values td[data-value]").get_attribute("data-value"))
        assert 0 < shown < 0.93 and "mode" in cursor.get_attribute("aria-valuetext")
        play.send_keys(Keys.ENTER)
        assert play.text == "Pause"
        driver.execute_async_script("setTimeout(arguments[0], 300)")
        play.send_keys(Keys.ENTER)
        assert play.text == "Play" and float(cursor.get_property("value")) > 0
        unlabelled = (
            "return [...document.querySelectorAll('input, select, button')].filter((each) => !(each.labels?.length"
        )
        unlabelled += " || each.getAttribute('aria-label') || each.textContent.trim())).length"
        assert driver.execute_script(unlabelled) == 0

    @pytest.mark.parametrize(("width", "dark"), [(360, False), (360, True), (1400, True)])
    def test_it_fits_the_screen_and_follows_the_colour_scheme(self, width, dark, tmp_path):
        path = exported(hsdsl.load(MODELS / "pronking-runner.yaml"), tmp_path)
        with browser(dark=dark) as started:
            metrics = {"width": width, "height": 800, "deviceScaleFactor": 2, "mobile": width < 500}
            started.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", metrics)
            opened(started, path)
            assert started.execute_script("return document.documentElement.scrollWidth") <= width
            ground = started.execute_script("return getComputedStyle(document.body).backgroundColor")
            assert ground == ("rgb(20, 24, 29)" if dark else "rgb(255, 255, 255)")


@needs_compiler
class TestText:
    def test_it_is_one_small_page_of_itself(self):
        for name in ("pronking-runner", "oscillator-with-stop-1"):
            (content,) = files_of(source_of(hsdsl.load(MODELS / f"{name}.yaml"), {}), "web").values()
            assert len(content) <= 500_000
            found = _Markup.of(content.decode())
            assert not {"src", "href", "action"} & {key for _, keys in found.tags for key in keys} - {"href"}
            assert [keys["href"] for tag, keys in found.tags if "href" in keys] == ["data:,"]

    @pytest.mark.slow
    def test_the_same_model_gives_the_same_bytes(self, monkeypatch):
        monkeypatch.setattr(web, "find", lambda kind, key: None)  # compiled anew
        assert page_of(STAND) == page_of(STAND)

    def test_texts_of_a_model_are_no_markup(self):
        plain, hostile = _Markup.of(page_of(STAND)), _Markup.of(page_of(ESCAPING))
        assert [tag for tag, _ in hostile.tags] == [tag for tag, _ in plain.tags]
        assert json.loads(parts(page_of(ESCAPING))["model"])["title"] == HOSTILE

    def test_it_names_model_version_and_settings(self):
        about = json.loads(parts(page_of(STAND, initial={"x": 2}))["model"])["about"]
        assert any(hsdsl.__version__ in line for line in about)
        assert any("initial.x=2" in line for line in about)


class _Markup(HTMLParser):
    tags: list[tuple[str, dict[str, str | None]]]

    @classmethod
    def of(cls, text: str) -> _Markup:
        made = cls()
        made.tags = []
        made.feed(text)
        return made

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))


def test_without_its_compiler_it_is_refused_before_anything_is_written(monkeypatch, tmp_path, capsys):
    monkeypatch.setattr(web, "zig_compiler", lambda: None)
    model = str(MODELS / "thermostat.yaml")
    assert obey(["export", model, "--to", "web", "--out", str(tmp_path / "out")]) == 2
    printed = capsys.readouterr().err
    assert "ziglang" in printed and "pip install 'hsdsl[web]'" in printed
    assert not (tmp_path / "out").exists()


def test_a_scheme_that_has_no_c_is_refused():
    source = source_of(hsdsl.loads(STAND), {"scheme": "paoli-schatzman", "step": 1e-3})
    with pytest.raises(UsageError, match="paoli-schatzman"):
        files_of(source, "web")


def test_numbers_and_data_of_a_page_are_as_they_were():
    model = hsdsl.load(MODELS / "thermostat.yaml")
    source = source_of(model, {})
    data = model_of(source, source, model.simulate())
    del data["about"]  # it names the version
    found = page.page_numbers(source.problem) + json.dumps(data, indent=1) + "\n"
    assert_golden(found, Path(__file__).parent / "golden" / "thermostat.web.txt")


def test_fixed_parameters_are_those_that_curved_switches_and_tolerances_depend_on():
    def fixed(text: str, **arguments: Any) -> set[str]:
        return page.fixed(source_of(hsdsl.loads(text), arguments).problem)

    assert fixed(FOLLOWING) == set()
    assert fixed(CURVED) == {"w", "phase", "T"}
    assert fixed(CURVED, parameters={"phase": 1}) == {"w", "phase", "T"}
    assert fixed(CURVED, until=3) == {"w", "phase"}
    tolerance = STAND.replace("{until: 4}", "{until: 4, tolerance: tol/10}").replace(
        "modes", "parameters: {tol: 1e-6}\nmodes"
    )
    assert fixed(tolerance) == {"tol"} and fixed(tolerance, tolerance=1e-8) == set()
