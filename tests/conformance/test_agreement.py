"""Every engine gives the same execution, to the last bit: on every case, on every model, by every method.

Three are compared: the Python loop over the Python kernel, the Python loop over the compiled kernel, and the compiled
loop. Where the second differs the printer of C is wrong, where only the third does the C runtime.
"""

from __future__ import annotations

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
OVER_BOTH = ("midpoint", "adaptive")
JUDGED = (*OVER_BOTH, "taylor")  # verdicts of other methods are compared on models
LATER = ("method", "kernel", "verdict")  # arguments beside which runs by one method are one run
# steps that fall on nothing, a relaxation large enough for strips to be seen, few transitions: the loop is what counts
STEPS: list[dict[str, Any]] = [{"step": 0.017, "relaxation": 3e-4}, {"step": "1/16", "relaxation": "1/1024"}]


def calls(name: str, scheme: str) -> list[dict[str, Any]]:
    """The arguments of a case's runs in every setting, each once."""
    found: list[dict[str, Any]] = []
    for run, (key, setting) in product(map(Run.of, read(CASES[name])["runs"]), FLOATS.items()):
        if scheme in run.scheme and setting.get("only", scheme) == scheme:
            most = min(int(run.arguments.get("max_transitions", MOST)), MOST)
            call = {**given(key), **run.arguments, "scheme": scheme, "max_transitions": most}
            call |= {"kernel": key in OVER_BOTH, "verdict": key in JUDGED}
            found += [call] if call not in found else []
    return found


@pytest.mark.parametrize("scheme", COMPILED_SCHEMES)
@pytest.mark.parametrize("name", [pytest.param(n, marks=[pytest.mark.slow] * (n in LONG)) for n in CASES])
def test_every_case_in_every_setting(name: str, scheme: str) -> None:
    seen: list[Any] = []  # `auto` is a method that another setting names
    for call in calls(name, scheme):
        others = {key: value for key, value in call.items() if key not in LATER}
        if (others, call.get("method")) not in seen:
            seen.append((others, assert_engines_agree(model(name), **call).method))


@pytest.mark.parametrize(("scheme", "method"), COMPILED)
@pytest.mark.parametrize("name", MODELS)
def test_every_model_by_every_method(scheme: str, name: str, method: str) -> None:
    loaded = hsdsl.load(MODELS[name])
    settings = [*STEPS, *([{"tolerance": 1e-7, "relaxation": 1e-6}] if METHODS[method].adaptive else [])]
    for number, setting in enumerate(settings):
        assert_engines_agree(
            loaded,
            kernel=number == 0,
            verdict=number != 1,  # as in the first, with another step
            method=method,
            max_transitions=8 if method == "radau" else 40,  # it is slow in Python
            scheme=scheme,
            **setting,
            **SHORT.get(name, {}),
        )
