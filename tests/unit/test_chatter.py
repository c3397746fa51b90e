"""Flows that jump: a run that goes to and fro across a jump says so soon, and one that passes it goes on."""

from __future__ import annotations

from typing import Any

import pytest

import hsdsl

ADAPTIVE = ("dopri5", "dop853", "radau")
FRICTION = {
    "held at once": ("{x: v, v: -sign(v)}", "v", 1),
    "held after a while": ("{x: v, v: -x - 0.3*sign(v) + 0.1*cos(t)}", "v", None),
    "by a floor": ("{x: v, v: -1 - 2*floor(v)}", "v", None),
    "of a moving belt": ("{x: v, v: 0.4 - 3*sign(v - sin(t))}", "v", None),
}


def run(directory: Any, flow: str, **more: Any) -> Any:
    path = directory / "model.yaml"
    start = ", ".join(f"{name}: {value}" for name, value in {"x": 1, "v": 1}.items())
    path.write_text(
        f"hsdsl: 1\nmodes: {{a: {{flow: {flow!s}}}}}\ninitial: {{mode: a, {start}}}\nexperiment: {{until: 40}}\n"
    )
    return hsdsl.load(path).simulate(**more)


@pytest.mark.parametrize("method", ADAPTIVE)
@pytest.mark.parametrize("scheme", ["located", "relaxed"])
@pytest.mark.parametrize("name", FRICTION)
def test_friction_that_holds_is_named_after_some_thousand_steps(
    name: str, scheme: str, method: str, tmp_path: Any
) -> None:
    flow, state, time = FRICTION[name]
    made = run(tmp_path, flow, method=method, scheme=scheme)
    assert made.stop.reason == "step_underflow"
    assert f"the flow of {state}" in made.stop.message and "jumps from" in made.stop.message
    assert len(made.times) < 20_000
    assert time is None or made.stop.time == pytest.approx(time, abs=1e-3)


@pytest.mark.parametrize("method", ADAPTIVE)
def test_a_jump_that_is_passed_thousands_of_times_ends_no_run(method: str, tmp_path: Any) -> None:
    made = run(tmp_path, "{x: v, v: -sign(x)}", method=method, until=2000, tolerance=1e-6)
    assert made.stop.reason == "until"


@pytest.mark.parametrize("method", ["dopri5", "dop853"])
def test_a_stiff_flow_at_the_edge_of_stability_is_no_jump(method: str, tmp_path: Any) -> None:
    """Steps of some thousandths, each of which turns the fast flow around."""
    made = run(tmp_path, "{x: -1000*(x - cos(t)), v: -x}", method=method, until=20)
    assert made.stop.reason == "until"
