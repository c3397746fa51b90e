"""Exports that have a loop of their own make the transitions of the engine, on every case of the meaning.

`apart.yaml` names what differs, and why: a case in it must differ, so that it leaves the table when it no longer does.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import pytest
import yaml

import hsdsl

# a product and a sum in one instruction round once: how deep a relaxed step ends in a strip may turn on that
os.environ.setdefault("XLA_FLAGS", "--xla_cpu_max_isa=AVX")
from export.agreement import BY, OF_TOOLS, assert_agree, of_run

HERE = Path(__file__).parent
CASES = sorted(p.stem for p in (HERE.parent / "conformance/cases").glob("*.yaml") if ".expect" not in p.name)
MOST = {"max_transitions": 300}  # the loop does the same with each further one
FIXED = {"method": "rk4", "step": "1/64", **MOST}
SETTINGS: dict[str, dict[str, Any]] = {
    "located": {"scheme": "located", **FIXED},
    "relaxed": {"scheme": "relaxed", **FIXED, "step": 0.017, "relaxation": 3e-4},
}
# within what times agree, relative to the run
WITHIN = {"jax": {"located": 1e-9, "relaxed": 1e-9}, "matlab": {"located": 1e-9, "relaxed": 1e-9}}
APART: dict[str, dict[str, dict[str, str]]] = yaml.safe_load((HERE / "apart.yaml").read_text(encoding="utf-8"))


def cases() -> list[Any]:
    """Every case in every export and setting; of those in JAX, which take seconds each, few are not a campaign."""
    found = list[Any]()
    for target, settings in WITHIN.items():
        for setting in settings:
            apart = APART.get(target, {}).get(setting, {})
            for k, case in enumerate(CASES):
                often = case.startswith("m11") if setting == "located" else k % 8 == 0
                marks = [pytest.mark.slow if target != "jax" or often else pytest.mark.campaign]
                marks += [pytest.mark.exports] if target == "jax" else [pytest.mark.tools]
                if case in apart:
                    marks.append(pytest.mark.xfail(reason=apart[case], strict=True, raises=AssertionError))
                found.append(pytest.param(target, case, setting, marks=marks, id=f"{target}-{setting}-{case}"))
    return found


@pytest.mark.parametrize(("target", "case", "setting"), cases())
def test_every_case_in_every_export(target: str, case: str, setting: str, tmp_path: Path) -> None:
    if target == "jax":
        pytest.importorskip("jax")
    elif OF_TOOLS[target] is None:
        pytest.skip(f"no tool for {target}: tests/export/install-tools.sh")
    model, settings = hsdsl.load(HERE.parent / "conformance/cases" / f"{case}.yaml"), SETTINGS[setting]
    assert_agree(of_run(model.simulate(**settings)), BY[target](model, tmp_path, **settings), WITHIN[target][setting])


def test_the_table_of_what_differs_names_cases() -> None:
    for target, settings in APART.items():
        assert settings.keys() <= WITHIN[target].keys()
        for table in settings.values():
            assert table.keys() <= set(CASES)
