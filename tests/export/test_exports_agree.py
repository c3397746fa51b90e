"""Modules for JAX, which have a loop of their own, make the transitions of the engine on every case of the meaning.

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
from export.agreement import assert_agree, by_jax, of_run

HERE = Path(__file__).parent
CASES = sorted(p.stem for p in (HERE.parent / "conformance/cases").glob("*.yaml") if ".expect" not in p.name)
MOST = {"max_transitions": 300}  # the loop does the same with each further one
FIXED = {"method": "rk4", "step": "1/64", **MOST}
SETTINGS: dict[str, dict[str, Any]] = {
    "located": {"scheme": "located", **FIXED},
    "relaxed": {"scheme": "relaxed", **FIXED, "step": 0.017, "relaxation": 3e-4},
}
WITHIN = 1e-9  # of times, relative to the run
APART: dict[str, dict[str, str]] = yaml.safe_load((HERE / "apart.yaml").read_text(encoding="utf-8"))


def cases() -> list[Any]:
    """Every case in every setting; they take seconds each, so that few are not a campaign."""
    found = list[Any]()
    for setting in SETTINGS:
        apart = APART.get(setting, {})
        for k, case in enumerate(CASES):
            often = case.startswith("m11") if setting == "located" else k % 8 == 0
            marks: list[Any] = [pytest.mark.slow if often else pytest.mark.campaign, pytest.mark.exports]
            if case in apart:
                marks.append(pytest.mark.xfail(reason=apart[case], strict=True, raises=AssertionError))
            found.append(pytest.param(case, setting, marks=marks, id=f"{setting}-{case}"))
    return found


@pytest.mark.parametrize(("case", "setting"), cases())
def test_every_case(case: str, setting: str, tmp_path: Path) -> None:
    pytest.importorskip("jax")
    model, settings = hsdsl.load(HERE.parent / "conformance/cases" / f"{case}.yaml"), SETTINGS[setting]
    assert_agree(of_run(model.simulate(**settings)), by_jax(model, tmp_path, **settings), WITHIN)


def test_the_table_of_what_differs_names_cases() -> None:
    assert APART.keys() <= SETTINGS.keys()
    for table in APART.values():
        assert table.keys() <= set(CASES)
