"""`--set experiment.*` of verbs: it means what their options mean."""

from __future__ import annotations

import pytest

DROP = """hsdsl: 1
parameters: {g: 9, e: 0.7}
modes:
  fly:
    flow: {h: v, v: -g - v/10}
    transitions: [{name: bounce, when: h <= 0, to: fly, reset: {v: -e*v}}]
initial: {mode: fly, h: 1.3, v: 0}
experiment: {until: 1.2}
"""


def shown(answer):
    """What was computed: not how long it took, nor how the settings were written."""
    return {key: value for key, value in answer.json.items() if key not in ("seconds", "overrides", "call")}


@pytest.mark.parametrize(("verb", "words"), [("run", ()), ("sensitivity", ("--wrt", "e"))])
@pytest.mark.parametrize(
    ("setting", "option"), [("tolerance=1e-5", "--tolerance"), ("method=dopri5", "--method"), ("until=0.9", "--until")]
)
def test_settings_mean_what_options_mean(command, model, verb, words, setting, option):
    file, value = model(DROP), setting.partition("=")[2]
    given = (verb, file, *words, "--engine", "python", "--json")
    plain, by_set = command(*given), command(*given, "--set", f"experiment.{setting}")
    assert by_set.code == 0 and shown(by_set) == shown(command(*given, option, value))
    assert shown(by_set) != shown(plain)


def test_a_method_of_set_that_keeps_no_tolerance_is_refused(command, model):
    answer = command("sensitivity", model(DROP), "--wrt", "e", "--set", "experiment.method=rk4")
    assert answer.code == 2 and "expected a method that keeps a tolerance" in answer.err
