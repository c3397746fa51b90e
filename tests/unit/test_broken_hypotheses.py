"""The verdict of runs that break a hypothesis of the convergence theorem on purpose: it never is `holds`."""

from __future__ import annotations

import random
from pathlib import Path
from typing import Any

import pytest
import yaml

import hsdsl

BROKEN = yaml.safe_load((Path(__file__).parent / "broken_hypotheses.yaml").read_text())
DIGITS = 3
ALL_METHODS = ("taylor", "dopri5", "dop853", "radau")


def model(name: str) -> hsdsl.Model:
    """A model that breaks a hypothesis."""
    case = {key: value for key, value in BROKEN[name].items() if key != "kinked"}
    experiment = {key: case.pop(key) for key in ("until", "max_transitions") if key in case}
    parameters = {"c": 1, "b": 1, "a": 1} | case.pop("parameters", {})
    return hsdsl.loads(yaml.safe_dump({"hsdsl": 1, "parameters": parameters, **case, "experiment": experiment}))


def drawn(name: str, random: random.Random) -> dict[str, float]:
    """Values of its parameters, short decimals."""
    free = {"a", "b", "c"} - set(BROKEN[name].get("parameters", {}))
    return {p: round(random.uniform(0.5, 3), random.randint(0, DIGITS)) or 1.0 for p in sorted(free)}


def never_holds(name: str, count: int, **settings: Any) -> None:
    broken, source = model(name), random.Random(name + str(settings))
    for _ in range(count):
        parameters = drawn(name, source)
        run = broken.simulate(parameters=parameters, **settings)
        assert run.verdict.theorem != "holds", (parameters, run.stop, run.transitions)


@pytest.mark.parametrize("scheme", ["located", "relaxed"])
@pytest.mark.parametrize("name", BROKEN)
def test_verdicts(name: str, scheme: str) -> None:
    never_holds(name, 2, scheme=scheme, method="dopri5", tolerance=1e-6, relaxation=1e-4, engine="python")


@pytest.mark.campaign
@pytest.mark.parametrize("engine", ["c", "python"])
@pytest.mark.parametrize("method", ALL_METHODS)
@pytest.mark.parametrize("scheme", ["located", "relaxed"])
@pytest.mark.parametrize("name", BROKEN)
def test_verdicts_of_all_methods(name: str, scheme: str, method: str, engine: str) -> None:
    if (scheme, method) == ("relaxed", "radau") or (method == "taylor" and "kinked" in BROKEN[name]):
        pytest.skip("the method is not for this")
    for tolerance in (1e-3, 1e-6, 1e-9):
        count = 20 if engine == "c" else 5
        never_holds(name, count, scheme=scheme, method=method, tolerance=tolerance, relaxation=tolerance, engine=engine)
