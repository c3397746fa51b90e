"""States that no output depends on are not integrated, and what stays runs as if they had not been written."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np
import pytest

import hsdsl
from hsdsl.interface.cli import main
from hsdsl.language.elaborate import elaborate
from hsdsl.language.elaborate.derived import only

HEAD = "hsdsl: 1\nmodes: {modes}\n{more}experiment: {{until: 3, tolerance: 1e-7, method: dopri5, scheme: relaxed}}\n"
BALL = "{up: {flow: {h: v, v: -9.8%s}, transitions: [{when: h <= 0, to: up, reset: {v: -0.8*v%s}}]%s}}"
# modes, the rest, outputs of the call, modes without the rest, the rest, what is left out
CASES = {
    "a state beside": (
        BALL % (", y: 2*y", ", y: y + v", ""), "initial: {mode: up, h: 1, v: 0, y: 1}\n", ["v"],
        BALL % ("", "", ""), "initial: {mode: up, h: 1, v: 0}\n", ("y",),
    ),
    "a chain of them": (
        BALL % (", y: z, z: w + h, w: v", "", ""), "initial: {mode: up, h: 1, v: 0, y: 1, z: 0, w: 0}\n", ["w"],
        BALL % (", w: v", "", ""), "initial: {mode: up, h: 1, v: 0, w: 0}\n", ("y", "z"),
    ),
    "needed by a reset alone": (
        BALL % (", y: 1, z: 1", " + y/9", ""), "initial: {mode: up, h: 1, v: 0, y: 0, z: 0}\n", ["h"],
        BALL % (", y: 1", " + y/9", ""), "initial: {mode: up, h: 1, v: 0, y: 0}\n", ("z",),
    ),
    "needed by a domain": (
        BALL % (", y: 1, z: 1", "", ", domain: [y <= 2]"), "initial: {mode: up, h: 1, v: 0, y: 0, z: 0}\n", ["h"],
        BALL % (", y: 1", "", ", domain: [y <= 2]"), "initial: {mode: up, h: 1, v: 0, y: 0}\n", ("z",),
    ),
    "an output": (
        BALL % (", y: -y, z: y, s: 1", "", ""),
        "outputs: {e: y*h, f: s}\ninitial: {mode: up, h: 1, v: 0, y: 1, z: 0, s: 0}\n", ["e"],
        BALL % (", y: -y", "", ""), "outputs: {e: y*h}\ninitial: {mode: up, h: 1, v: 0, y: 1}\n", ("z", "s"),
    ),
    "a state of one mode": (
        "{a: {flow: {x: 1, y: x}, transitions: [{when: x >= 1, to: b}]}, b: {flow: {x: y, y: 0}}}",
        "initial: {mode: a, x: 0, y: 1}\n", ["x"],
        "{a: {flow: {x: 1, y: x}, transitions: [{when: x >= 1, to: b}]}, b: {flow: {x: y, y: 0}}}",
        "initial: {mode: a, x: 0, y: 1}\n", (),
    ),
    "needed in one mode only": (
        "{a: {flow: {x: 1, y: x}, transitions: [{when: x >= 1, to: b, reset: {y: x}}]}, b: {flow: {x: y, y: 0}}}",
        "initial: {mode: a, x: 0, y: 1}\n", ["x"],
        "{a: {flow: {x: 1}, transitions: [{when: x >= 1, to: b, reset: {y: x}}]}, b: {flow: {x: y, y: 0}}}",
        "initial: {mode: a, x: 0}\n", ("y in a",),
    ),
    "a final mode": (
        "{a: {flow: {x: 1, y: 1}, transitions: [{when: x >= 1, to: end, reset: {y: 7}}]}, end: {final: true}}",
        "initial: {mode: a, x: 0, y: 1}\n", ["x"],
        "{a: {flow: {x: 1}, transitions: [{when: x >= 1, to: end}]}, end: {final: true}}",
        "initial: {mode: a, x: 0}\n", ("y",),
    ),
}  # fmt: skip


def write(folder: Path, name: str, modes: str, more: str) -> Path:
    path = folder / f"{name}.yaml"
    path.write_text(HEAD.format(modes=modes, more=more))
    return path


@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize("times", [1, 2], ids=["first", "seen"])
def test_what_stays_runs_as_if_it_were_all(name: str, times: int, tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "caches"))
    modes, more, given, fewer, less, gone = CASES[name]
    path, small = write(tmp_path, "whole", modes, more), write(tmp_path, "small", fewer, less)
    for _ in range(times):
        run = hsdsl.load(path).simulate(outputs=given, engine="python")
    alone = hsdsl.load(small).simulate(engine="python")
    assert np.array_equal(run.times, alone.times) and np.array_equal(run.values, alone.values, equal_nan=True)
    assert np.array_equal(run.outputs, alone.outputs, equal_nan=True)
    assert run.transitions == alone.transitions and run.final == alone.final and run.stop == alone.stop
    assert tuple(run.settings.get("left_out", {}).get("states", ())) == gone


def test_nothing_is_left_out_where_all_is_needed(tmp_path: Path) -> None:
    path = write(tmp_path, "m", BALL % ("", "", ""), "initial: {mode: up, h: 1, v: 0}\n")
    model = hsdsl.load(path)
    assert model.only(["h"]) is model
    system = elaborate(path)
    assert only(system, ["h"]) is system
    with pytest.raises(hsdsl.UsageError, match="no state or output 'q'"):
        model.only(["q"])


def test_overrides_of_what_is_left_out_are_heard_and_without_effect(tmp_path: Path) -> None:
    modes, more, *_ = CASES["a state beside"]
    model = hsdsl.load(write(tmp_path, "m", modes, more))
    run = model.simulate(outputs=["v"], initial={"y": 5, "h": 2}, engine="python")
    assert run.final == model.simulate(outputs=["v"], initial={"h": 2}, engine="python").final
    with pytest.raises(hsdsl.UsageError, match="no state 'q'"):
        model.simulate(outputs=["v"], initial={"q": 5}, engine="python")


def test_the_command_line_says_so(tmp_path: Path, monkeypatch, capsys) -> None:
    modes, more, *_ = CASES["a state beside"]
    path = write(tmp_path, "m", modes, more)
    printed = {}
    for options in ([], ["--json"]):
        monkeypatch.setattr(sys, "argv", ["hsdsl", "run", str(path), "--outputs", "v", "--engine", "python", *options])
        with pytest.raises(SystemExit):
            main()
        printed[bool(options)] = capsys.readouterr().out
    found = json.loads(printed[True])
    assert found["left_out"]["states"] == ["y"] and "depends on them" in found["left_out"]["reason"]
    assert set(found["final"]["state"]) == {"h", "v"}
    assert "left out  y: no requested output" in printed[False]
