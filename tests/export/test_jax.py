"""Modules for JAX: they make a run's transitions, and their derivatives are those of the execution."""

from __future__ import annotations

import ast
import ctypes
import gc
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from shipped import assert_golden

import hsdsl
from hsdsl.export import files_of, source_of
from hsdsl.interface.cli.verbs import obey

# a product and a sum in one instruction round once: how deep a relaxed step ends in a strip may turn on that
os.environ.setdefault("XLA_FLAGS", "--xla_cpu_max_isa=AVX")
jax: Any = pytest.importorskip("jax")
from export.jax_modules import SETTINGS, assert_same, imported, jitted  # noqa: E402

pytestmark = pytest.mark.exports
jnp = jax.numpy
ROOT = Path(__file__).parents[2]
MODELS = ROOT / "models"
NAMES = [path.stem for path in sorted(MODELS.glob("*.yaml")) if path.stem != "stiff-switch"]
REST = """
hsdsl: 1
parameters: {e: 0.7, lift: 2}
inputs:
  push: {times: [0, 3], values: [0, lift], hold: linear}
modes:
  up: {flow: {h: v, v: push - 1}, transitions: [{when: h <= 0, to: up, reset: {v: -e*v}}]}
initial: {mode: up, h: 0.2, v: 0}
outputs: {energy: h + v**2/2}
experiment: {until: 5, method: rk4, step: 1e-2}
"""
HOSTILE = """
hsdsl: 1
title: "''' \\"\\"\\" {{ # \\\\"
parameters: {T: 1/2, b: 2*T}
inputs: {u: {times: [0, T, 2], values: [0, 1, b], hold: zero}}
modes:
  import: {flow: {x: 1 + u}, transitions: [{name: "a\\" ''' \\\\", when: x >= b, to: import, reset: {x: 0}}]}
initial: {mode: import, x: b/8}
experiment: {until: 4}
"""


def slow_or_campaign(campaign: bool) -> pytest.MarkDecorator:
    return pytest.mark.campaign if campaign else pytest.mark.slow


@pytest.fixture(autouse=True)
def _no_compiled_code_is_left() -> Iterator[None]:
    yield
    jax.clear_caches()  # else each test adds its own to the memory
    gc.collect()
    if sys.platform == "linux" and hasattr(libc := ctypes.CDLL(None), "malloc_trim"):
        libc.malloc_trim(0)


def hostile(path: Path) -> Path:
    path.write_text(HOSTILE, encoding="utf-8")
    return path


def ran(module: Any, **arguments: Any) -> Any:
    return jitted(lambda: module.simulate(transitions=512, **arguments))()


def differences(function: Any, at: Any, by: float) -> np.ndarray:
    steps = by * np.eye(len(at))
    return np.stack([(np.asarray(function(at + s)) - np.asarray(function(at - s))) / (2 * by) for s in steps], axis=1)


def test_impacts_of_many_balls_and_their_derivatives(tmp_path: Path) -> None:
    model = hsdsl.load(MODELS / "bouncing-ball.yaml")
    module = imported(model, tmp_path, until=4, **SETTINGS[0])

    def both(p: Any) -> Any:
        found = module.simulate(p)
        return found, jnp.stack([found.times[0], found.times[1], *found.x])

    batch = jnp.stack([module.parameters({"e": e}) for e in np.linspace(0.5, 0.9, 5)])
    slopes, found = jitted(jax.vmap(jax.jacfwd(lambda p: both(p)[::-1], has_aux=True)))(batch)
    for i, e in enumerate(np.linspace(0.5, 0.9, 5)):
        run = model.simulate(until=4, parameters={"e": float(e)}, **SETTINGS[0])
        assert_same(module, jax.tree.map(lambda a, i=i: a[i], found), run)
    g, e, h = 9.81, 0.7, 10.0
    fall = np.sqrt(2 * h / g)
    exact = np.array([[-fall / (2 * g), 0], [-fall * (1 + 2 * e) / (2 * g), 2 * fall]])
    assert np.allclose(slopes[2][:2], exact, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("reset", ["select(v, v, -0.3*v)", "max(-0.4*v, 0)"])
def test_a_body_rests_where_its_reset_has_kinks(reset: str, tmp_path: Path) -> None:
    model = hsdsl.loads(
        "hsdsl: 1\nmodes: {m: {flow: {x: v, v: -3}, transitions: [{when: x <= 0, to: m, "
        f"reset: {{v: '{reset}'}}}}]}}}}\n"
        "initial: {mode: m, x: 1, v: 0}\nexperiment: {until: 4}\n"
    )
    module = imported(model, tmp_path)
    assert_same(module, jitted(module.simulate)(), model.simulate(method="dopri5"), 1e-7)


def test_texts_of_a_model_stay_strings(tmp_path: Path) -> None:
    files = files_of(source_of(hsdsl.load(hostile(tmp_path / "jax.yaml")), {}), "jax")
    ((name, content),) = files.items()
    assert name == "jax_.py"  # else it would stand in for the library
    tree = ast.parse(content)
    strings = {node.value for node in ast.walk(tree) if isinstance(node, ast.Constant)}
    assert {"import", "a\" ''' \\"} <= strings
    targets = [target for node in tree.body if isinstance(node, ast.Assign) for target in node.targets]
    defined = [name.id for target in targets for name in ast.walk(target) if isinstance(name, ast.Name)]
    defined += [node.name for node in tree.body if isinstance(node, ast.FunctionDef | ast.ClassDef)]
    assert len(defined) == len(set(defined))


def test_generated_text() -> None:
    content = files_of(source_of(hsdsl.load(MODELS / "thermostat.yaml"), {}), "jax")["thermostat.py"].decode()
    found = content.partition("# The model\n")[2]
    assert_golden(found, Path(__file__).parent / "golden" / "thermostat.jax.txt")


def test_what_it_cannot_keep_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    ball, out = str(MODELS / "bouncing-ball.yaml"), str(tmp_path / "out")
    for method in ("radau", "taylor"):
        assert obey(["export", ball, "--to", "jax", "--out", out, "--method", method]) == 2
        assert "--method dopri5" in capsys.readouterr().err
    assert not Path(out).exists()
    module = imported(hsdsl.loads(HOSTILE), tmp_path)
    with pytest.raises(ValueError, match="fixed"):
        module.parameters({"T": 1})
    with pytest.raises(KeyError, match="no parameter 'U'"):
        module.parameters({"U": 1})


@pytest.mark.parametrize("setting", [pytest.param(k, marks=slow_or_campaign(k > 0)) for k in range(len(SETTINGS))])
@pytest.mark.parametrize("name", NAMES)
def test_every_model(name: str, setting: int, tmp_path: Path) -> None:
    model, settings = hsdsl.load(MODELS / f"{name}.yaml"), SETTINGS[setting]
    module = imported(model, tmp_path, **settings)
    assert_same(module, ran(module), model.simulate(**settings))


@pytest.mark.slow
def test_settings_of_the_file_are_kept(tmp_path: Path) -> None:
    model = hsdsl.load(MODELS / "thermostat.yaml")
    module = imported(model, tmp_path)
    assert_same(module, ran(module), model.simulate(), within=1e-8)
    shown = subprocess.run(
        [sys.executable, str(tmp_path / "thermostat.py")], capture_output=True, text=True, check=True
    )
    lines = shown.stdout.splitlines()
    assert len(lines) == 7
    assert lines[0].endswith("switch_off heating -> idle") and lines[-1].startswith("until at t = 24.0 in heating")


@pytest.mark.slow
def test_rest_ends_and_outputs_and_samples_follow(tmp_path: Path) -> None:
    model = hsdsl.loads(REST)
    module = imported(model, tmp_path)
    times = np.linspace(0, 5, 41)
    found, run = ran(module, times=times), model.simulate()
    assert_same(module, found, run)
    assert np.allclose(found.sampled, np.array([list(run(t).state.values()) for t in times]), atol=1e-7)
    assert np.allclose(found.outputs, found.x[0] + found.x[1] ** 2 / 2)


@pytest.mark.parametrize(
    ("name", "settings", "by"),
    [
        pytest.param(
            "oscillator-with-stop-1",
            {"scheme": "located", "method": "rk4", "step": 1e-3, "until": 6},
            1e-6,
            marks=pytest.mark.slow,
        ),
        pytest.param("pronking-runner", {"initial": {"w": -0.4}}, 1e-5, marks=pytest.mark.campaign),
    ],
)
def test_derivatives_through_impacts_are_differences(name: str, settings: Any, by: float, tmp_path: Path) -> None:
    module = imported(hsdsl.load(MODELS / f"{name}.yaml"), tmp_path, **settings)
    p, x = module.parameters(), module.initial()

    def ends(p: Any, x: Any) -> Any:
        return module.simulate(p, x).x

    plain = jitted(ends)
    by_p, by_x = jitted(jax.jacfwd(ends, (0, 1)))(p, x)
    for slopes, expected in (
        (by_p, differences(lambda p: plain(p, x), p, by)),
        (by_x, differences(lambda x: plain(p, x), x, by)),
    ):
        assert np.abs(slopes - expected).max() <= 1e-6 * max(1, np.abs(expected).max())


@pytest.mark.slow
@pytest.mark.parametrize("scheme", ("located", "relaxed"))
def test_reverse_mode_gives_the_derivatives_of_the_limit(scheme: str, tmp_path: Path) -> None:
    settings = {"method": "rk4", "step": 1e-2, "until": 4, "relaxation": 1e-7}
    module = imported(hsdsl.load(MODELS / "bouncing-ball.yaml"), tmp_path, scheme=scheme, **settings)
    p = module.parameters()
    rounds = int(ran(module).rounds)
    slopes = jitted(jax.grad(lambda p: module.simulate(p, rounds=rounds).x[0]))(p)
    g, e, h, t = 9.81, 0.8, 10.0, 4.0
    fall = np.sqrt(2 * h / g)  # the second flight is over at fall (1 + 2 e), the third begins at speed e**2 g fall

    def height(g: Any, e: Any) -> Any:
        fall = jnp.sqrt(2 * h / g)
        late = t - fall * (1 + 2 * e)
        return e**2 * g * fall * late - g * late**2 / 2

    assert fall * (1 + 2 * e) < t
    assert np.allclose(slopes, jax.grad(height, (0, 1))(g, e), rtol=1e-6)


@pytest.mark.slow
def test_derivatives_by_samples_of_an_input(tmp_path: Path) -> None:
    module = imported(hsdsl.loads(REST), tmp_path)

    def ends(p: Any) -> Any:
        return module.simulate(p).x

    slopes = jitted(jax.jacfwd(ends))(module.parameters())
    expected = differences(jitted(ends), module.parameters(), 1e-6)
    assert np.abs(slopes - expected).max() <= 1e-6


@pytest.mark.slow
def test_ten_thousand_oscillators(tmp_path: Path) -> None:
    settings = {"until": 1}
    model = hsdsl.load(MODELS / "oscillator-with-stop-1.yaml")
    module = imported(model, tmp_path, **settings)
    starts = module.initial() + jnp.stack([jnp.linspace(-1, 1, 10_000), jnp.zeros(10_000)], axis=1)
    found = jitted(jax.vmap(lambda x: module.simulate(x0=x, transitions=4)))(starts)
    for i in (0, 1234, 9999):
        run = model.simulate(initial={"x": float(starts[i, 0])}, **settings)
        assert_same(module, jax.tree.map(lambda a, i=i: a[i], found), run)


KEPT = """
hsdsl: 1
parameters: {k: 2}
modes: {a: {flow: {x: 1}, transitions: [{name: done, when: x >= 1, to: end, reset: {x: k}}]}, end: {final: true}}
outputs: {o: k*x}
initial: {mode: a, x: 0}
experiment: {until: 3, method: rk4, step: 1/100}
"""


def test_a_final_mode_without_flow_has_the_outputs_before(tmp_path: Path) -> None:
    module = imported(hsdsl.loads(KEPT), tmp_path)
    found = jitted(module.simulate)(module.parameters({"k": 3}))
    assert found.outputs.tolist() == [9]


RISING = """
hsdsl: 1
parameters: {A: 0.2, g: 9.81}
modes:
  air:
    flow: {h: v, v: -g}
    transitions: [{name: bounce, when: h <= A*t**2, to: air, reset: {v: 2*A*t - 0.5*(v - 2*A*t)}}]
initial: {mode: air, h: 1, v: 0}
experiment: {until: 3, scheme: located, method: dopri5, tolerance: 1e-11}
"""


@pytest.mark.slow
def test_derivatives_behind_a_tail_onto_a_guard_that_moves(tmp_path: Path) -> None:
    """Held by the guard the state is (A t**2, 2 A t), for any g."""
    module = imported(hsdsl.loads(RISING), tmp_path)
    slopes = jitted(jax.jacfwd(lambda p: module.simulate(p).x))(module.parameters())
    assert np.allclose(slopes, [[9, 0], [6, 0]], rtol=0, atol=1e-4)
