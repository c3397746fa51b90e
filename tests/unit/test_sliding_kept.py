"""Models whose runs slide: kept like others, the same runs without SymPy; in both schemes; beside chattering."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

import hsdsl

GALLERY = Path(__file__).parents[2] / "models" / "gallery"
SECOND = """
import sys, hsdsl
run = hsdsl.load(sys.argv[1]).simulate(engine="python")
print(repr(run.final.state), run.final.mode, "sympy" in sys.modules)
"""


@pytest.mark.parametrize("name", ["relay", "stick-slip", "bouncing-ball"])
def test_a_run_that_slides_is_the_same_from_the_cache(name, tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    path = tmp_path / f"{name}.yaml"
    source = GALLERY / f"{name}.yaml"
    text = (source if source.exists() else GALLERY.parent / f"{name}.yaml").read_text()
    path.write_text(text if "completion:" in text else text.replace("experiment: {", "experiment: {completion: auto, "))
    first = hsdsl.load(path).simulate(engine="python")
    done = subprocess.run([sys.executable, "-c", SECOND, str(path)], capture_output=True, text=True, check=True)
    assert done.stdout == f"{first.final.state!r} {first.final.mode} False\n"
    assert hsdsl.load(path).simulate(completion="none", engine="python").final.mode != "sliding_positive_negative"


def test_parts_of_a_model_that_slides_are_kept_apart(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    path = GALLERY / "relay.yaml"
    sliding = [hsdsl.load(path).sliding.pipeline.only(("x",)).program for _ in range(2)]
    plain = hsdsl.load(path).pipeline.only(("x",)).program
    assert sliding[0] == sliding[1] and len(sliding[0].modes) == len(plain.modes) + 1


SWITCHED = """hsdsl: 1
parameters: {k: 2}
modes:
  down: {flow: {x: -k + 0.5, y: 1 + x}, transitions: [{when: x <= 0, to: up}]}
  up: {flow: {x: k + 0.5, y: 1 + x}, transitions: [{when: x >= 0, to: down}]}
initial: {mode: down, x: 0.9, y: 0}
experiment: {until: 3}
"""


@pytest.mark.parametrize("scheme", ["located", "relaxed"])
def test_switches_slide_stop_or_chatter(scheme):
    """Without completion a run ends where two flows point towards one surface; with a distance it stays near."""
    model, given = hsdsl.loads(SWITCHED), {"engine": "python", "scheme": scheme, "relaxation": 1e-4}
    assert model.simulate(**given).stop.reason == "zeno"
    slides = model.simulate(completion="auto", **given)
    assert slides.stop.complete and slides.final.mode == "sliding_down_up"
    for width in (0.04, 0.01):
        apart_by = SWITCHED.replace("<= 0", f"<= -{width}").replace(">= 0", f">= {width}")
        chatters = hsdsl.loads(apart_by).simulate(**given)
        assert chatters.stop.complete and len(chatters.transitions) > 0.5 / width
        waited = sum(made.resumed - made.time for made in chatters.transitions)
        assert abs(chatters.final["y"] - slides.final["y"]) < 3 * (width + waited)


SHARED = """hsdsl: 1
modes:
  a:
    flow: {x: 1, n: 0, c: 1}
    transitions:
      - {when: x >= 0, to: b}
      - {name: early, when: c >= 2, if: n > 0.5, to: a, reset: {n: 0, c: 0, x: -1}}
      - {name: late, when: c >= 2, if: n < 0.5, to: a, reset: {n: 1, c: 0, x: -1.5}}
  b:
    flow: {x: -1, n: 0, c: 1}
    transitions:
      - {when: x <= 0, to: a}
      - {name: early, when: c >= 2, if: n > 0.5, to: a, reset: {n: 0, c: 0, x: -1}}
      - {name: late, when: c >= 2, if: n < 0.5, to: b, reset: {n: 1, c: 0, x: 1.5}}
initial: {mode: a, x: -0.5, n: 0, c: 0}
experiment: {until: 5, completion: auto}
"""


def test_transitions_that_share_a_surface_are_all_made_while_sliding():
    """One of two that do the same is left out, and no other: 'late' differs between the modes, 'early' does not."""
    made = [tr for tr in hsdsl.loads(SHARED).simulate().transitions if tr.source == "sliding_a_b"]
    assert [(tr.edge, round(tr.time, 12), tr.alternatives) for tr in made] == [
        ("late", 2, ("late_b",)),
        ("early", 4, ()),
    ]


def test_a_kink_of_an_input_does_not_divide_sliding():
    inputs = "inputs: {u: {times: [0, 1, 2], values: [0, 0.1, 0], hold: linear}}\n"
    text = SWITCHED.replace("modes:", inputs + "modes:").replace("x: k + 0.5", "x: k + 0.5 + u")
    run = hsdsl.loads(text).simulate(completion="auto")
    assert run.verdict.reasons == ("sliding between down and up from t = 0.6 to t = 3",)


def test_a_completed_model_slides_in_its_own_modes_where_a_surface_has_choices():
    text = SWITCHED.replace("x: -k + 0.5, y: 1 + x", "x: -k, g: 0").replace("x: k + 0.5, y: 1 + x", "x: k, g: 0")
    text = (
        text.replace("x <= 0", "'x <= select(g, 1, 0)'").replace("x >= 0", "'x >= select(g, 1, 0)'").replace("y:", "g:")
    )
    written = hsdsl.loads(text).completed()
    again = hsdsl.loads(written)
    assert "sliding_down_up" in written and again.sliding is again


def test_the_order_of_states_does_not_matter_to_sliding():
    curved = SWITCHED.replace("x <= 0", "x + y**2/9 <= 0").replace("x >= 0", "x + y**2/9 >= 0")
    curved = curved.replace("x: k + 0.5, y: 1 + x", "x: k - y, y: 1")
    other = curved.replace("x: k - y, y: 1", "y: 1, x: k - y")
    one, two = (hsdsl.loads(text).simulate(completion="auto") for text in (curved, other))
    assert [t.edge for t in one.transitions][-1] == "sliding_down_up->up" and other != curved
    assert one.final == two.final and [t.time for t in one.transitions] == [t.time for t in two.transitions]
