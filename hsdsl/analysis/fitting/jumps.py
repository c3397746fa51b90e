"""Where the sum of squares jumps: transitions that pass measurements, and values on the other side of a jump.

No derivative shows that a measurement agrees better with the other side of the transition next to it, nor that other
transitions lead to a lower sum.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from itertools import zip_longest
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from hsdsl.analysis.fitting.fit import Measurements
from hsdsl.analysis.sensitivity.result import Sensitivity
from hsdsl.base.numbers.arithmetic import TIE
from hsdsl.engine.execution import Array, Execution
from hsdsl.engine.simulate.stops import show

if TYPE_CHECKING:
    from hsdsl.analysis.fitting.least_squares import Objective

MOST_NAMED = 3
UNKNOWN = 1e-12  # singular values below this share of the largest are of values that nothing determines
HALVINGS = 8  # distances at which other values are tried, the largest the size of the value
BESIDE = 1e-9  # of the size of a value: so far beside the values found is the other side of a jump
Order = tuple[str, ...] | None
MOST_SIDES = 3  # that are tried, and named
ALONG, MOST_ALONG, LEVEL = 1e-3, 30, 1e-9  # the size of steps that show a jump's normal; steps along it; a last gain
JUMP = 1e-8  # of the size of a column: less is no jump
LONGER = 1.25  # of the time of measurements
FURTHER, NARROW = 1.1, 1e-6  # so many times as far, and by this share of the time, transitions are moved over them


class WrongSide(NamedTuple):
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
    found = objective.tried(x, LONGER * float(measured.times.max()))
    if found is None:
        return there
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


def same_order(a: Order, b: Order) -> bool:
    """Whether runs make the same transitions; one more or less at the end makes no other order."""
    return a == b or (a is not None and b is not None and a[: len(b)] == b[: len(a)])


def around(x: Array, limits: Array, sizes: Array) -> Iterator[Array]:
    """The values, and others of which one differs by its size, a half of it, a quarter, and so on."""
    yield x
    for k, (low, high) in enumerate(limits):
        for step in (sign * 0.5**h for h in range(HALVINGS) for sign in (1, -1)):
            other = x.copy()
            other[k] = np.clip(x[k] + step * sizes[k], low, high)
            yield other


def lowest(objective: Objective, points: Iterable[Array]) -> list[tuple[Array, Order, float]]:
    """The values with the lowest sum of each order of transitions, the lowest first; no run that ends early."""
    found: dict[Order, tuple[Array, Order, float]] = {}
    seen = objective.seen
    for x in points:
        order, total = objective.order(x), float(np.sum(objective.residuals(x) ** 2))
        if order is not None and (order not in found or total < found[order][2]):
            found[order] = x, order, total
    objective.seen = seen  # no search has been there
    return sorted(found.values(), key=lambda each: each[2])


def beside_jump(objective: Objective, x: Array, limits: Array, sizes: Array) -> list[str]:
    """What to say if the residuals jump where the sum of squares falls: values beside a jump are no minimum."""
    step = _step_over_jump(objective, x, limits, sizes)
    if step is None:
        return []
    here, there = objective.run(x).execution.transitions, objective.run(x + step).execution.transitions
    ways = zip_longest(here, there)
    first = next(((old, new) for old, new in ways if old is None or new is None or old.edge != new.edge), None)
    made = ""
    if first and first[1]:
        made = f", where the run makes {first[1].edge} at t = {show(first[1].time)}"
    elif first and first[0]:
        made = f", where the run no longer makes {first[0].edge} at t = {show(first[0].time)}"
    return [f"the fit ended beside a jump of the sum of squares{made}: the covariance knows of no jump"]


def _step_over_jump(objective: Objective, x: Array, limits: Array, sizes: Array) -> Array | None:
    """A short step down the slope of the sum of squares over which the residuals jump, if they do."""
    residuals, slopes = objective.residuals(x), objective.slopes(x)
    falls = -(residuals @ slopes) * sizes
    falls[(x == limits[:, 1]) & (falls > 0) | (x == limits[:, 0]) & (falls < 0)] = 0.0
    if not np.any(falls) or not np.isfinite(falls).all():
        return None
    step = np.clip(x + BESIDE * sizes * falls / np.max(np.abs(falls)), limits[:, 0], limits[:, 1]) - x
    off = np.abs(objective.residuals(x + step) - residuals - slopes @ step)
    return step if np.any(off > JUMP * max(map(objective.size, objective.measured.columns))) else None


def along_jump(objective: Objective, x: Array, limits: Array, sizes: Array) -> Array:
    """Values with a lower sum of squares along the jump that values are beside, on their side of it; else the same.

    Gauss-Newton steps are made in the tangent plane of the jump, and each ends beside the jump again.
    """
    step = _step_over_jump(objective, x, limits, sizes) if len(x) > 1 else None
    order, seen = objective.order(x), objective.seen
    if step is None or order is None or objective.order(x + step) == order:
        return x
    over = step / sizes / np.linalg.norm(step / sizes)
    total = float(np.sum(objective.residuals(x) ** 2))

    def beside(y: Array, reach: float) -> tuple[float, Array] | None:
        """How far over the jump lies from values, as shares of their sizes, and values there on this side of it."""

        def stays(share: float) -> bool:
            return objective.order(np.clip((y + share * over) * sizes, limits[:, 0], limits[:, 1])) == order

        low, high = -reach, reach
        if not stays(low) or stays(high):
            return None
        while high - low > BESIDE / 4:
            middle = (low + high) / 2
            low, high = (middle, high) if stays(middle) else (low, middle)
        return low, np.clip((y + low * over) * sizes, limits[:, 0], limits[:, 1])

    basis: Array | None = None
    for _ in range(MOST_ALONG):
        y, residuals, slopes = x / sizes, objective.residuals(x), objective.slopes(x) * sizes
        if fresh := basis is None:
            near = [beside(y + ALONG * way, 4 * ALONG) for way in (0 * over, *np.eye(len(x)))]
            known = [each[0] for each in near if each is not None]
            if len(known) < len(near):
                break
            basis = np.linalg.svd(known[0] - np.array([known[1:]]))[2][1:]
        move = -basis.T @ np.linalg.lstsq(slopes @ basis.T, residuals, rcond=UNKNOWN)[0]
        found, lower, share = None, np.inf, 2.0
        while not lower < total and share > 0.5**HALVINGS:
            share /= 2
            found = beside(y + share * move, max(ALONG, 2 * float(np.linalg.norm(share * move))))
            lower = float(np.sum(objective.residuals(found[1]) ** 2)) if found else np.inf
        level = not lower < (1 - LEVEL) * total
        if found and lower < total:
            x, total = found[1], lower
        if fresh and level:
            break
        basis = None if level or share < 1 else basis  # the jump bends
    objective.seen = seen
    return x


def close_transitions(found: Sensitivity, measured: Measurements, covariance: Array) -> Sequence[str]:
    """The transitions that the uncertainty of the values carries over a measurement."""
    close: list[str] = []
    spread, end = np.where(np.isfinite(covariance), covariance, 0.0), float(measured.times.max())
    for made, moves in zip(found.execution.transitions, found.as_made().transitions, strict=True):
        slope = np.array([moves.time[by] for by in found.wrt], float)
        reach = 2 * float(max(0.0, slope @ spread @ slope)) ** 0.5
        if reach <= TIE * max(abs(float(made.time)), end):
            continue  # its time depends on no value
        near = measured.times[np.abs(measured.times - made.time) <= reach]
        if len(near) and _measured_jumps(found, measured, float(made.time)):
            where = f"t = {show(near[0])}" + (f" and {len(near) - 1} more" if len(near) > 1 else "")
            close.append(
                f"{made.edge} at t = {show(made.time)} is within its uncertainty of the measurement at {where}"
            )
    more = [f"and {len(close) - MOST_NAMED} more transitions so"] if len(close) > MOST_NAMED else []
    return [*close[:MOST_NAMED], *more]


def _measured_jumps(found: Sensitivity, measured: Measurements, time: float) -> bool:
    """Whether anything that is measured, or its derivative by a value, jumps at a transition."""
    end = float(found.execution.times[-1])
    near = TIE * max(time, end)
    sides = found.as_made().sample(np.clip([time - near, time + near], 0.0, end))
    whole = found.as_made().sample(measured.times[measured.times <= end])
    for name in measured.columns:
        for table, all_ in ((sides.values, whole.values), (sides.slopes, whole.slopes)):
            if name not in table:
                return True
            before, after = np.asarray(table[name], float)
            size = np.nanmax(np.abs(np.asarray(all_[name], float)), axis=0, initial=0.0)
            if not np.all(np.abs(after - before) <= JUMP * size):
                return True
    return False
