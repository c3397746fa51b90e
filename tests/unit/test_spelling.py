"""States misspelt in a flow, and lines indented too little: their corrections, and what is left alone."""

from __future__ import annotations

import pytest

import hsdsl
from hsdsl.base.errors import ModelError

TAIL = "initial: {mode: m, x: 0, vel: 1}\nexperiment: {until: 1}\n"
MODEL = """hsdsl: 1
parameters: {c: 1}
modes:
  m:
    flow: {x: vel, vel: -c*x}
    transitions: [{when: x >= 1, to: m, reset: {vel: -vel}}]
"""


def printed(text: str) -> list[tuple[str, int, str | None]]:
    with pytest.raises(ModelError) as raised:
        hsdsl.loads(text)
    return [(d.code, d.span.line if d.span else 0, d.hint) for d in raised.value.diagnostics]


def test_one_fault_for_one_slip():
    assert printed(MODEL.replace("vel: -c*x", "vle: -c*x") + TAIL) == [("HS111", 5, "did you mean 'vel'?")]


def test_a_state_that_nothing_uses_is_no_slip():
    hsdsl.loads(MODEL.replace("vel: -c*x", "vel: -c*x, vle: 1") + TAIL.replace("vel: 1", "vel: 1, vle: 0"))
    found = printed(MODEL.replace("vel: -c*x", "vel: -c*x, other: 1") + TAIL)
    assert [(code, line) for code, line, _ in found] == [("HS308", 7)]


def test_names_of_a_section_called_otherwise_are_no_states():
    model = MODEL.replace("parameters", "constants").replace("vel: -c*x", "vel: -c*x, c1: 1")
    assert printed(model + TAIL.replace("vel: 1", "vel: 1, c2: 0"))[0][0] == "HS201"
    assert not any("'c1', and the rest" in str(fault) for fault in printed(model + TAIL))


@pytest.mark.parametrize("name", ["final", "let", "domain", "transitions", "flow", "outputs"])
def test_a_mode_may_have_the_name_of_a_section(name):
    text = MODEL.replace("to: m", f"to: {name}") + f"  {name}: {{final: true}}\n" + TAIL
    assert [mode.name for mode in hsdsl.loads(text).program.modes] == ["m", name]


@pytest.mark.parametrize(
    ("right", "left", "line", "where"),
    [
        ("    transitions: [", "  transitions: [", 6, "in the mode 'm'"),
        ("    transitions: [", "transitions: [", 6, "in the mode 'm'"),
        ("    flow: {x: vel, vel: -c*x}", "    flow:\n    x: vel\n    vel: -c*x", 6, "under `flow`"),
        ("parameters: {c: 1}", "parameters:\nc: 1", 3, "under `parameters`"),
        ("initial: {mode: m, x: 0, vel: 1}", "initial:\nmode: m\nx: 0\nvel: 1", 8, "under `initial`"),
        ("experiment: {until: 1}", "experiment:\nuntil: 1", 9, "under `experiment`"),
    ],
)
def test_lines_too_far_left_are_told_once(right, left, line, where):
    text = MODEL + TAIL
    assert right in text
    ((code, place, hint),) = printed(text.replace(right, left))
    assert (code, place) == ("HS201", line) and hint is not None and hint.endswith(f"{where}")


def test_a_mode_and_all_its_sections_too_far_left():
    text = MODEL.replace("    flow", "  flow").replace("    transitions", "  transitions") + TAIL
    ((code, line, hint),) = printed(text)
    assert (code, line, hint) == ("HS201", 5, "indent these lines, so that they are in the mode 'm'")


def test_a_key_misspelt_behind_an_empty_section():
    text = MODEL.replace("{x: vel, vel: -c*x}", "").replace("    transitions", "    transition") + TAIL
    assert (printed(text)[0][0], printed(text)[0][2]) == ("HS201", "did you mean 'transitions'?")
    text = MODEL.replace("parameters: {c: 1}", "parameters:") + TAIL.replace("initial:", "initail:")
    assert ("HS201", 7, "did you mean 'initial'?") in printed(text)


def test_a_section_that_is_there_twice_is_not_moved():
    found = printed(MODEL + "  domain: [x >= 0]\n  transitions: []\n" + TAIL)
    assert found[0][1] >= 7 and all(code.startswith("HS2") for code, _, _ in found)
