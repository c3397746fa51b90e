"""Modules for JAX, run, and compared with runs of the engine."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import isnan
from pathlib import Path
from typing import Any

import pytest

NAN = float("nan")


@dataclass(frozen=True)
class Made:
    """A transition; ``after`` is empty where it is not printed, or not made."""

    edge: str
    time: float
    resumed: float
    after: Sequence[float] = ()


@dataclass(frozen=True)
class Outcome:
    """What a run gives: its transitions, why it ended and when, and the last state."""

    made: list[Made]
    stop: str
    time: float
    final: Sequence[float] = ()


def of_run(run: Any) -> Outcome:
    """What a run of the engine gives."""
    made = [
        Made(t.edge, float(t.time), NAN if t.resumed is None else float(t.resumed),
             () if t.after is None else [*map(float, t.after.values())])
        for t in run.transitions
    ]  # fmt: skip
    return Outcome(made, run.stop.reason, float(run.stop.time), [*map(float, run.final.state.values())])


def assert_agree(ours: Outcome, theirs: Outcome, within: float) -> None:
    """The same transitions and end, within an error of times relative to the run's length, 1000 times it of states."""
    allowed = within * max(1.0, ours.time)
    assert [made.edge for made in theirs.made] == [made.edge for made in ours.made]
    assert theirs.stop == ours.stop
    for one, other in zip(ours.made, theirs.made, strict=True):
        assert other.time == pytest.approx(one.time, rel=0, abs=allowed)
        assert other.resumed == pytest.approx(one.resumed, rel=0, abs=allowed, nan_ok=True)
        assert_near(one.after, other.after, 1e3 * within)
    assert theirs.time == pytest.approx(ours.time, rel=0, abs=allowed)
    assert_near(ours.final, theirs.final, 1e3 * within)


def assert_agree_until_turns(ours: Outcome, theirs: Outcome, within: float) -> None:
    """The same transitions until the engine ended a tail of edges that take turns, where the other goes on."""
    assert ours.stop == "zeno" and theirs.stop in ("zeno", "transition_limit")
    assert len(theirs.made) > len(ours.made)
    first = replace(theirs, made=theirs.made[: len(ours.made)], stop=ours.stop, time=ours.time, final=())
    assert_agree(ours, first, within)


def assert_near(ours: Sequence[float], theirs: Sequence[float], within: float) -> None:
    """Each state, relative to the largest, of those that both have."""
    if not ours or not len(theirs) or any(map(isnan, ours)):
        return
    size, both = max(1.0, *map(abs, ours)), min(len(ours), len(theirs))  # one may list what waits, or be padded
    assert list(theirs)[:both] == pytest.approx(list(ours)[:both], rel=0, abs=within * size)


def by_jax(model: Any, folder: Path, **arguments: Any) -> Outcome:
    """A module for JAX."""
    from export.jax_modules import imported, jitted

    module = imported(model, folder, **arguments)
    found = jitted(lambda: module.simulate(transitions=512))()
    names = [module.MODEL.edges[int(k)].name for k in found.edges if k >= 0]
    rows = zip(names, found.times, found.resumed, found.after, strict=False)
    made = [Made(name, float(t), float(resumed), after.tolist()) for name, t, resumed, after in rows]
    made += [Made("", NAN, NAN)] * (int(found.count) - len(made))
    return Outcome(made, module.STOPS[int(found.stop)], float(found.t), found.x.tolist())
