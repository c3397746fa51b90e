"""Both engines give the same execution, to the last bit: on every case, on every model, by every method.

Explicit methods are rows of one table in both loops, so that a case takes two settings of those in turn; a campaign
takes the others.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from pathlib import Path
from typing import Any

import pytest
from conformance.test_conformance import CASES, SETTINGS, Run, given, model, read
from engines import assert_engines_agree, needs_compiler

import hsdsl
from hsdsl.engine.integrators import METHODS
from hsdsl.engine.runtime.structures import COMPILED_SCHEMES

pytestmark = needs_compiler
COMPILED = list(product(COMPILED_SCHEMES, METHODS))
MODELS = {path.stem: path for path in sorted((Path(__file__).parents[2] / "models").glob("*.yaml"))}
FLOATS = {name: setting for name, setting in SETTINGS.items() if "precision" not in setting}
LONG = ("m4-chattering", "m10-sliding", "zeno-ball")  # thousands of transitions
MOST = 250  # the loop does the same with each further one
# explicit steps on the first are a ten-millionth long; the second does the same with each further impact
SHORT = {"stiff-switch": {"until": "1e-4"}, "oscillator-with-stop-1": {"until": "40"}}
JUDGED = ("midpoint", "adaptive", "taylor")  # verdicts of other methods are compared on models
ALWAYS = (*JUDGED, "radau")
IN_TURN = [key for key in FLOATS if key not in ALWAYS]
LATER = ("method", "verdict")  # arguments beside which runs by one method are one run
# steps that fall on nothing, a relaxation large enough for strips to be seen, few transitions: the loop is what counts
STEPS: list[dict[str, Any]] = [{"step": 0.017, "relaxation": 3e-4}, {"step": "1/16", "relaxation": "1/1024"}]


def taken(name: str, scheme: str) -> list[str]:
    """The settings that a case takes in the ordinary tests."""
    turn = [*CASES].index(name) + COMPILED_SCHEMES.index(scheme)
    return [*ALWAYS, *IN_TURN[turn % 3 :: 3]]


def calls(name: str, scheme: str, keys: Sequence[str] = (*FLOATS,)) -> list[dict[str, Any]]:
    """The arguments of a case's runs in settings, each once."""
    found: list[dict[str, Any]] = []
    for run, key in product(map(Run.of, read(CASES[name])["runs"]), keys):
        if scheme in run.scheme and FLOATS[key].get("only", scheme) == scheme:
            most = min(int(run.arguments.get("max_transitions", MOST)), MOST)
            call = {**given(key), **run.arguments, "scheme": scheme, "max_transitions": most}
            call["verdict"] = key in JUDGED
            found += [call] if call not in found else []
    return found


@pytest.mark.parametrize("share", ["some", pytest.param("others", marks=pytest.mark.campaign)])
@pytest.mark.parametrize("scheme", COMPILED_SCHEMES)
@pytest.mark.parametrize("name", [pytest.param(n, marks=[pytest.mark.slow] * (n in LONG)) for n in CASES])
def test_every_case_in_every_setting(name: str, scheme: str, share: str) -> None:
    keys = taken(name, scheme)
    seen: list[Any] = []  # `auto` is a method that another setting names
    for call in calls(name, scheme, keys if share == "some" else [key for key in FLOATS if key not in keys]):
        others = {key: value for key, value in call.items() if key not in LATER}
        if (others, call.get("method")) not in seen:
            seen.append((others, assert_engines_agree(model(name), **call).method))


@pytest.mark.parametrize(("scheme", "method"), COMPILED)
@pytest.mark.parametrize("name", MODELS)
def test_every_model_by_every_method(scheme: str, name: str, method: str) -> None:
    loaded = hsdsl.load(MODELS[name])
    settings = [*STEPS, *([{"tolerance": 1e-7, "relaxation": 1e-6}] if METHODS[method].adaptive else [])]
    slow = (scheme, method) == ("relaxed", "radau")  # a verdict runs once more by smaller steps
    for number, setting in enumerate(settings):
        assert_engines_agree(
            loaded,
            verdict=number == 0 or (number == 2 and not slow),  # that of the second differs by its step only
            method=method,
            max_transitions=8 if method == "radau" else 40,  # it is slow in Python
            scheme=scheme,
            **setting,
            **SHORT.get(name, {}),
        )
