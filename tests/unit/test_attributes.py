"""Attributes and items that runs and models lack: errors say where their values are."""

from __future__ import annotations

import copy
import pickle
from typing import Any

import pytest

import hsdsl
from hsdsl import UsageError

MODEL: Any = hsdsl.loads("""
hsdsl: 1
modes: {m: {flow: {level: -level}}}
outputs: {share: level/3}
initial: {mode: m, level: 2}
experiment: {until: 1}
""")
RUN: Any = MODEL.simulate()


@pytest.mark.parametrize(
    ("name", "place"),
    [("t", "run.times"), ("level", r"run.rows\(\)\['level'\]"), ("share", "run.sample"), ("u", "'u'$")],
)
def test_of_a_run(name: str, place: str) -> None:
    with pytest.raises(AttributeError, match=place):
        getattr(RUN, name)
    with pytest.raises(TypeError, match=r"run.rows\(\)" if name == "u" else place):
        RUN[name]
    with pytest.raises(TypeError, match="not iterable"):
        iter(RUN)


@pytest.mark.parametrize(("name", "place"), [("parameters", "model.program.parameters"), ("states", "all_states")])
def test_of_a_model(name: str, place: str) -> None:
    with pytest.raises(AttributeError, match=place):
        getattr(MODEL, name)
    with pytest.raises(AttributeError, match=r"no attribute 'other'$"):
        _ = MODEL.other
    assert not hasattr(MODEL, name)
    assert copy.copy(MODEL).columns == pickle.loads(pickle.dumps(MODEL)).columns == ["level", "share"]


def test_a_picture_at_a_path() -> None:
    with pytest.raises(UsageError, match="figure of Matplotlib, got the path 'level") as caught:
        RUN.plot("level.png")
    assert "hsdsl.analysis.plot.plot(run, 'level.png')" in str(caught.value.hint)
