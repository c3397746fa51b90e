"""Modules for JAX, which have a loop of their own, make the transitions of the engine, or are refused.

On every case of the meaning and every model, none left out: what is refused is told from the lowered model. The models
in ``loops`` are of rules that one loop may have and another not.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import pytest

import hsdsl
from hsdsl.export import files_of, source_of

# a product and a sum in one instruction round once: how deep a relaxed step ends in a strip may turn on that
os.environ.setdefault("XLA_FLAGS", "--xla_cpu_max_isa=AVX")
from export.agreement import assert_agree, assert_agree_until_turns, by_jax, of_run

ROOT = Path(__file__).parents[2]
CASES = {
    p.stem: p
    for folder in ("conformance/cases", "conformance/events", "conformance/parts", "export/loops")
    for p in sorted((ROOT / "tests" / folder).glob("*.yaml"))
    if ".expect" not in p.name
}
MODELS = {str(p.relative_to(ROOT)): p for p in sorted((ROOT / "models").rglob("*.yaml"))}
MOST = {"max_transitions": 300}  # the loop does the same with each further one
FIXED = {"method": "rk4", "step": "1/64", **MOST}
SETTINGS: dict[str, dict[str, Any]] = {
    "located": {"scheme": "located", **FIXED},
    "relaxed": {"scheme": "relaxed", **FIXED, "step": 0.017, "relaxation": 3e-4},
}
OWN = {"method": "dopri5", "max_transitions": 40}
SHORT = {"stiff-switch": {"until": "1e-4"}}  # explicit steps are a ten-millionth long
WITHIN = 1e-9  # of times, relative to the run


def cases() -> list[Any]:
    """Every case in every setting; they take seconds each, so that few are not a campaign."""
    found = list[Any]()
    for setting in SETTINGS:
        for k, case in enumerate(CASES):
            often = case.startswith("m11") if setting == "located" else k % 8 == 0
            marks: list[Any] = [pytest.mark.slow if often else pytest.mark.campaign, pytest.mark.exports]
            found.append(pytest.param(case, setting, marks=marks, id=f"{setting}-{case}"))
    return found


def assert_agrees_or_lacks(path: Path, folder: Path, settings: dict[str, Any]) -> None:
    pytest.importorskip("jax")
    model = hsdsl.load(path)
    source = source_of(model, settings)
    queues = [queue for mode in source.problem.program.modes for queue in mode.queues]
    if source.system.parts:
        with pytest.raises(hsdsl.UsageError, match="jax has no systems of parts"):
            files_of(source, "jax")
    elif any(queue.most > 1 for queue in queues):
        with pytest.raises(hsdsl.ModelError, match=r"error HS341: jax keeps one execution of '.*' that waits"):
            files_of(source, "jax")
    else:
        run, theirs = model.simulate(**settings), by_jax(model, folder, **settings)
        if "take turns" in run.stop.message:
            assert_agree_until_turns(of_run(run), theirs, WITHIN)
        else:
            assert_agree(of_run(run), theirs, WITHIN)


@pytest.mark.parametrize(("case", "setting"), cases())
def test_every_case(case: str, setting: str, tmp_path: Path) -> None:
    assert_agrees_or_lacks(CASES[case], tmp_path, SETTINGS[setting])


@pytest.mark.campaign
@pytest.mark.exports
@pytest.mark.parametrize("name", MODELS)
def test_every_model_of_the_folder(name: str, tmp_path: Path) -> None:
    assert_agrees_or_lacks(MODELS[name], tmp_path, {**OWN, **SHORT.get(MODELS[name].stem, {})})


@pytest.mark.parametrize(
    ("waiting", "place"),
    [("", None), ("waiting: 2, ", None), ("waiting: 1, ", "kept"), ("persistent: false, ", "kept")],
)
def test_an_event_of_which_more_may_wait_is_refused(waiting: str, place: str | None) -> None:
    model = hsdsl.loads(
        "hsdsl: 1\nmodes:\n  m:\n    flow: {x: 1, a: 0}\n    transitions:\n"
        "      - {when: x >= 2, to: m, reset: {x: 0}}\n"
        f"      - {{event: x >= 1, {waiting}delay: 3, reset: {{a: a + x}}}}\n"
        "initial: {mode: m, x: 0, a: 0}\nexperiment: {until: 9}\n"
    )
    source = source_of(model, {})
    if place == "kept":
        assert files_of(source, "jax")
        return
    with pytest.raises(hsdsl.ModelError) as refused:
        files_of(source, "jax")
    (diagnostic,) = refused.value.diagnostics
    assert diagnostic.code == "HS341"
    assert "expected `waiting: 1`, got " in diagnostic.message
    assert diagnostic.span and diagnostic.span.line == 7 and diagnostic.span.column == 32 + len(waiting)
