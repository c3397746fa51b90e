"""Exact executions of models: stored ones against another integrator, and none given to a model it does not solve."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from references.build import REFERENCES, solved
from scipy.integrate import solve_ivp
from shipped import MODELS, shipped

import hsdsl
from hsdsl.analysis.exact import reference
from hsdsl.analysis.exact.references import STORED, residual
from hsdsl.base.numbers.arithmetic import FLOAT64
from hsdsl.engine.backends.python import PythonKernel

KEPT = [(name, block) for name, solutions in REFERENCES.items() for block in range(len(solutions))]
KEPT_IDS = [f"{name}-{block}" for name, block in KEPT]
BY_SERIES = [(name, block) for name, block in KEPT if name in ("constrained-pendulum", "pronking-runner")]
SERIES_IDS = [f"{name}-{block}" for name, block in BY_SERIES]


def test_every_model_has_its_exact_executions() -> None:
    assert set(REFERENCES) == {path.stem for path in MODELS.glob("*.yaml")}
    assert {name: len(solutions) for name, solutions in REFERENCES.items()} == {
        name: len(shipped(name).system.reference) for name in REFERENCES
    }
    assert {path.stem for path in STORED.glob("*.npz")} == set(KEPT_IDS)


@pytest.mark.parametrize(("name", "block"), BY_SERIES, ids=SERIES_IDS)
def test_stored_executions_say_what_they_rest_on(name: str, block: int) -> None:
    run = reference(shipped(name), block)
    assert run.digest == shipped(name).system.digest
    assert run.settings["error"] <= 2e-14
    assert run.settings["digits"] >= 30
    assert "Taylor series of order 40" in run.settings["source"]
    assert "the relaxed scheme, refined from the model's file, agrees to" in run.settings["source"]
    assert run.verdict.theorem == "holds"
    assert (STORED / f"{name}-{block}.npz").stat().st_size < 30_000


@pytest.mark.parametrize(("name", "block"), BY_SERIES, ids=SERIES_IDS)
def test_another_integrator_agrees(name: str, block: int) -> None:
    """DOP853 on the model's own flow along each arc: states in between, and at its end, where a guard is met."""
    run, program = reference(shipped(name), block), shipped(name).program
    kernel = PythonKernel(program, FLOAT64)
    parameters: tuple[float, ...] = ()
    for k in range(len(program.parameters)):
        parameters = (*parameters, *kernel.constant(f"parameter_{k}", parameters))
    modes = {mode.name: kernel.bind(k, parameters) for k, mode in enumerate(program.modes)}
    compared = 0
    for arc in run.arcs:
        start, end = run.times[arc.first], run.times[arc.last]
        if start == end:
            continue
        width = len(arc.states)
        times = np.linspace(start, end, 25)
        flow = modes[arc.mode].flow
        found = solve_ivp(
            lambda t, x, flow=flow: flow(t, *x),
            (start, end),
            run.values[arc.first, :width],
            "DOP853",
            times,
            rtol=1e-13,
            atol=1e-13,
            max_step=0.01,
        )
        inside = run.sample(times[1:-1])
        for name_of, column in zip(arc.states, found.y, strict=True):
            assert np.max(np.abs(inside[name_of] - column[1:-1])) <= 1e-12
        assert np.max(np.abs(run.values[arc.last, :width] - found.y[:, -1])) <= 1e-12
        compared += 1
    assert compared >= 3


DEFECTS = {"stiff-switch": 2e-10}  # pieces of 2e-7 s: values right to 1e-14 leave that much in a slope of 1e5


@pytest.mark.parametrize("name", REFERENCES)
def test_the_models_equations_hold(name: str) -> None:
    for block in range(len(REFERENCES[name])):
        assert residual(shipped(name).program, reference(shipped(name), block)) <= DEFECTS.get(name, 1e-11)


@pytest.mark.parametrize(  # the first of each model; all are rebuilt in a campaign
    ("name", "block"),
    [
        pytest.param(name, block, marks=pytest.mark.campaign if block else pytest.mark.slow, id=f"{name}-{block}")
        for name, block in KEPT
    ],
)
def test_rebuilt_it_is_the_same(name: str, block: int) -> None:
    stored, anew = reference(shipped(name), block), solved(name, block)
    assert [(t.edge, t.time, t.before, t.after, t.alternatives) for t in stored.transitions] == [
        (t.edge, t.time, t.before, t.after, t.alternatives) for t in anew.transitions
    ]
    assert np.array_equal(stored.values, anew.values, equal_nan=True)
    assert np.array_equal(stored.coefficients, anew.coefficients)


NEAR = {name: ({"tolerance": "1e-11"}, 1e-5) for name in ("bouncing-ball", "constrained-pendulum", "thermostat")} | {
    "digital-control": ({"tolerance": "1e-11"}, 1e-6),
    "oscillator-with-stop-1": ({"tolerance": "1e-11"}, 3e-5),  # two impacts, the faster at a speed of 25
    "oscillator-with-stop-2": ({"method": "midpoint", "step": "1e-3"}, 1e-6),  # at rest, then released
}


@pytest.mark.parametrize("name", NEAR)  # not the runner: bounds between curved guards take seconds
def test_a_run_is_near_its_reference(name: str) -> None:
    settings, bound = NEAR[name]
    run = shipped(name).simulate(relaxation="1e-7", until=3, **settings)
    found = hsdsl.distance(run, reference(shipped(name)), model=shipped(name))
    assert found.upper <= bound
    assert found.upper - found.lower <= 0.02 * found.upper + 1e-12


def edited(folder: Path, *edits: tuple[str, str], name: str = "constrained-pendulum") -> Any:
    """A copy of a model under another name, with texts replaced."""
    text = (MODELS / f"{name}.yaml").read_text()
    for old, new in edits:
        assert old in text
        text = text.replace(old, new)
    path = folder / "copy.yaml"
    path.write_text(text)
    return hsdsl.load(path)


def test_a_model_edited_in_its_words_keeps_its_reference(tmp_path: Path) -> None:
    changed = edited(tmp_path, ("title: Pendulum", "# a remark\ntitle: The pendulum"))
    run = reference(changed)
    assert run.digest == changed.system.digest != shipped("constrained-pendulum").system.digest
    assert hsdsl.distance(run, changed.simulate(until=1)).upper <= 1e-5


def test_a_run_stored_next_to_a_model_is_its_reference(tmp_path: Path) -> None:
    mine = edited(tmp_path, ("rate: 0.1", "rate: 0.2"), name="thermostat")
    (tmp_path / "references").mkdir()
    (tmp_path / "references" / "another-file.npz").write_bytes(b"no execution")
    hsdsl.exact.precise(mine, 6, until=3).save(tmp_path / "references" / "any-name.npz")
    assert "refined" in reference(mine).engine


EDITS = {
    "gravity": ([("g: 9.81", "g: 9.8101")], "does not solve"),
    "a reset": ([("w: w*L/L_short}", "w: w*L/L_short + 1e-6}")], "does not solve"),
    "a guard": ([("when: phi <= pin", "when: phi <= pin + 1e-6")], "does not solve"),
    "a wall that it passes": ([("  short:\n", "  short:\n    domain: [w <= 4]\n")], "does not solve"),
    "a guard that it passes": (
        [("transitions: [{when: phi >= pin,", "transitions: [{when: w >= 4, to: long}, {when: phi >= pin,")],
        "does not solve",
    ),
    "the start": ([("phi: pi/6", "phi: pi/6 + 1e-6")], "starts elsewhere"),
    "the first mode": ([("initial: {mode: long", "initial: {mode: short")], "starts in another mode"),
    "a mode's name": ([("short", "brief")], "does not fit"),
    "an edge's name": (
        [("{when: phi >=", "{name: freed, when: phi >="), ("edge: short->long", "edge: freed")],
        "not fit",
    ),
}


@pytest.mark.parametrize("edit", EDITS)
def test_a_model_edited_in_its_mathematics_has_none(edit: str, tmp_path: Path) -> None:
    edits, message = EDITS[edit]
    with pytest.raises(hsdsl.UsageError, match=message):
        reference(edited(tmp_path, *edits))


def test_a_closed_form_is_not_given_to_another_model(tmp_path: Path) -> None:
    with pytest.raises(hsdsl.UsageError, match="does not solve"):
        reference(edited(tmp_path, ("rate: 0.1", "rate: 0.2"), name="thermostat"))


def test_nothing_known_is_said(tmp_path: Path) -> None:
    with pytest.raises(hsdsl.UsageError, match=r"no exact execution is known for block 0 of copy\.yaml\n"):
        reference(edited(tmp_path, ("heating", "warming"), name="thermostat"))
    with pytest.raises(hsdsl.UsageError, match="block 1 of thermostat"):
        reference(shipped("thermostat"), 1)
    with pytest.raises(hsdsl.UsageError, match="block -1 of thermostat"):
        reference(shipped("thermostat"), -1)
