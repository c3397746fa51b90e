"""Measurements that agree better with the other side of the transition next to them, which no derivative shows."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from hsdsl.analysis.fitting.objective import Objective
from hsdsl.base.numbers.arithmetic import TIE
from hsdsl.engine.execution import Array, Execution
from hsdsl.engine.simulate.stops import show

MOST_SIDES = 3  # that are tried, and named
UNKNOWN = 1e-12  # singular values below this share of the largest are of values that nothing determines
JUMP = 1e-8  # of the size of a column: less is no jump
LONGER = 1.25  # of the time of measurements
FURTHER, NARROW = 1.1, 1e-6  # so many times as far, and by this share of the time, transitions are moved over them


@dataclass(frozen=True)
class WrongSide:
    """A measurement that agrees better with the other side of the transition next to it.

    ``gain`` is what the sum of squares would lose there, ``late`` how much later than the transition it is, and
    ``slope`` has the derivatives of the transition's time.
    """

    gain: float
    late: float
    slope: Array
    sentence: str


def wrong_sides(objective: Objective, x: Array) -> list[WrongSide]:
    """Those of a run with these values, the largest gains first: no derivative shows them.

    The run goes on for a while, since its next transition may be one that was measured.
    """
    measured, there = objective.measured, list[WrongSide]()
    found = objective.evaluate(objective.named(x), LONGER * float(measured.times.max()))
    end = float(found.execution.times[-1])
    for made, moves in zip(found.execution.transitions, found.as_made().transitions, strict=True):
        slope, time = np.array([moves.time[by] for by in found.wrt], float), float(made.time)
        near = TIE * max(time, end)
        if not np.isfinite(slope).all() or not np.any(slope) or not near < time < end - near:
            continue
        later = measured.times > time
        for rows in (np.flatnonzero(~later)[-1:], np.flatnonzero(later & (measured.times <= end))[:1]):
            for at in measured.times[rows].tolist():
                gain = _gain(objective, found.execution, at, [time - near, time + near][:: -1 if at > time else 1])
                if gain > 0:
                    sentence = f"the measurement at t = {show(at)} agrees better with the other side of {made.edge} at "
                    there.append(WrongSide(gain, at - time, slope, f"{sentence}t = {show(time)}"))
    return sorted(there, key=lambda each: -each.gain)


def _gain(objective: Objective, run: Execution, at: float, sides: Sequence[float]) -> float:
    """What squares at a time lose where the run is on the other side of a transition, from the first of two times."""
    own, table, gain = run.sample([at]), run.sample(sorted(sides)), 0.0
    order = np.argsort(np.argsort(sides))
    for name, column in objective.measured.columns.items():
        jump = float(np.diff(np.asarray(table[name], float)[order])[0])
        if not abs(jump) > JUMP * objective.size(name) / objective.weights[name]:
            continue
        for y in column[objective.measured.times == at].tolist():
            off = float(own[name][0]) - y
            change = off**2 - (off + jump) ** 2
            gain += objective.weights[name] ** 2 * change if np.isfinite(change) else 0.0  # was not measured
    return gain


def steps_across(objective: Objective, x: Array, sizes: Array) -> Iterator[Array]:
    """Steps by which a transition passes a measurement on its wrong side, those that change the others least."""
    end, slopes = float(objective.measured.times.max()), objective.slopes(x) * sizes
    shape = np.linalg.pinv(slopes.T @ slopes, rcond=UNKNOWN)
    for each in wrong_sides(objective, x)[:MOST_SIDES]:
        way = shape @ (each.slope * sizes)
        rate = float(each.slope * sizes @ way)
        if rate > 0:
            yield sizes * way * (FURTHER * each.late + np.copysign(NARROW * end, each.late)) / rate
