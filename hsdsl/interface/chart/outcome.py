"""What came of a run against the exact execution: in one word, its error, and whether it is right."""

from __future__ import annotations

from math import nan
from typing import NamedTuple

import numpy as np

from hsdsl.analysis.metrics import Interval
from hsdsl.engine.execution import Execution, Verdict
from hsdsl.interface.chart.scene import Array, Result, Scene, sampled
from hsdsl.interface.model.distances import distance_of_runs

FINER = 8  # points of the exact curve from sample to sample
SAME_END = 1e-9  # of the run: ends nearer than this are one


class Tolerance(NamedTuple):
    """How near a right result comes: ``state``, a share of each state's span, and ``time``, a share of the run.

    A sample is right where the exact execution has its values at some time that near.
    """

    state: float
    time: float


WITHIN = Tolerance(state=0.05, time=0.005)  # of a right result


class Outcome(NamedTuple):
    """What came of a run, in a ``word``.

    ``right``: the exact execution within the tolerance. ``warns``: another one, with the verdict ``left`` or
    ``unknown``. ``wrong``: another one, without a word. ``stops``: an end before the end, with a reason.
    ``refuses``: no run. ``crashes``, ``hangs``: the process died, or took longer than its limit.
    """

    word: str
    why: str = ""  # the difference from the exact execution, or the tool's own words
    error: float = nan  # the largest of a state, as a share of that state's span; NaN where none compares
    transitions: int | None = None
    verdict: str = ""  # of the theorem: `holds`, `left` or `unknown`; empty where the tool has none
    other: str = ""  # what differs: `transitions` (their number), `modes`, `values` or `end`; empty where nothing does


def outcome(scene: Scene, result: Result, within: Tolerance, verdict: Verdict | None = None) -> Outcome:
    """Judge a result against the scene's exact execution; ``verdict`` is what the tool itself says about its run."""
    error, others, missing = compared(scene, result, within.time)
    known = "" if verdict is None else verdict.theorem
    until, last = float(scene.grid[-1]), float(scene.exact.final.time)
    ends = until - last > SAME_END * until  # the exact execution ends before the run is to end
    other, why = _difference(scene, result, others, missing, error, within)
    if result.problem:
        word = "right" if ends and not other else "stops"
        return Outcome(word, result.problem, error, result.transitions, known, other)
    if ends:
        other, why = "end", f"goes on past t = {last:.6g}, where the exact execution ends"
    word = ("warns" if known in ("left", "unknown") else "wrong") if other else "right"
    return Outcome(word, why, error, result.transitions, known, other)


def compared(scene: Scene, result: Result, slack: float) -> tuple[float, int, bool]:
    """The largest error of a sample as a share of a state's span, how many have another mode, and if one lacks values.

    Each sample is compared with the exact execution over all times no farther away than ``slack`` of the run, jumps
    with both their sides. Modes that the model does not have (along a surface) may be any.
    """
    times, values, modes = _exact_curve(scene)
    wide, span, until = slack * float(scene.grid[-1]), spans(scene), float(scene.exact.final.time) * (1 + SAME_END)
    free = ~np.isin(modes, scene.model.program.mode_names)
    low, high = np.fmin(values[:-1], values[1:]), np.fmax(values[:-1], values[1:])
    first = np.maximum(np.searchsorted(times, scene.grid - wide) - 1, 0)
    last = np.minimum(np.searchsorted(times, scene.grid + wide, side="right"), len(times) - 1)
    if result.transitions is None:  # a miss just before the end shows in the last sample alone
        first[-1] = last[-1] - 1
    worst, others, missing = nan, 0, False
    for i in np.flatnonzero((scene.grid <= until) & (result.modes != "")):
        at = slice(first[i], last[i])
        outside = np.maximum(np.maximum(low[at] - result.values[i], result.values[i] - high[at]), 0) / span
        worst = np.fmax(worst, np.where(np.isnan(outside), 0, outside).max(axis=1).min())
        near = slice(first[i], last[i] + 1)
        missing |= bool((~np.isfinite(result.values[i]) & np.isfinite(values[near]).all(axis=0)).any())
        others += not bool(((modes[near] == result.modes[i]) | free[near]).any())
    return float(worst), others, missing


def _exact_curve(scene: Scene) -> tuple[Array, Array, Array]:
    """Times, values and modes of the exact execution, between the samples and on both sides of each jump."""
    exact, end = scene.exact, float(scene.exact.final.time)
    last = float(scene.grid[-1])
    even: Array = np.linspace(0.0, last, FINER * (len(scene.grid) - 1) + 1)
    inner: Array = np.append(even[even < end], min(end, last))
    values, find_modes = sampled(exact, inner, scene.states)
    jumps = np.array([float(t.time) for t in exact.transitions])
    sides = [(inner, values, find_modes())]
    for after in (False, True):
        points = [(t.target, t.after or {}) if after else (t.source, t.before) for t in exact.transitions]
        rows = [[point.get(state, nan) for state in scene.states] for _, point in points]
        modes = np.array([mode for mode, _ in points], dtype=object)
        sides.append((jumps, np.array(rows, dtype=float).reshape(len(jumps), len(scene.states)), modes))
    times, columns, names = (np.concatenate(parts) for parts in zip(*sides, strict=True))
    kind = np.concatenate([np.full(len(inner), 2), np.zeros(len(jumps)), np.ones(len(jumps))])
    number = np.concatenate([np.full(len(inner), len(jumps)), np.arange(len(jumps)), np.arange(len(jumps))])
    order = np.lexsort((kind, number, times))  # at one time: each jump before, after, then the sample
    return times[order], columns[order], names[order]


def spans(scene: Scene) -> Array:
    """How far each state goes in the exact execution; of one that stays, its size, or 1."""
    span: Array = np.nanmax(scene.exact_values, axis=0) - np.nanmin(scene.exact_values, axis=0)
    size = np.nanmax(np.abs(scene.exact_values), axis=0)
    return np.where(span > 0, span, np.where(size > 0, size, 1.0))


def _difference(
    scene: Scene, result: Result, others: int, missing: bool, error: float, within: Tolerance
) -> tuple[str, str]:
    """What of a result differs from the exact execution, in a word and a sentence; empty where nothing does."""
    fewest, most = scene.countable
    if not result.problem and result.transitions is not None and not fewest <= result.transitions <= most:
        return "transitions", f"{result.transitions} transition{'s' * (result.transitions != 1)} instead of {most:g}"
    if others:
        return "modes", f"another mode at {others} of {len(scene.grid)} samples"
    if not result.problem and missing:
        return "values", "no finite value where the exact execution has one"
    return ("values", f"an error of {error:.2g} of the span") if error > within.state else ("", "")


OF_CHARTS = Tolerance(state=0.1, time=0.005)  # beyond it a result of a chart is wrong


class Judgement(NamedTuple):
    """``verdict`` is ``right``, ``wrong`` (another execution) or ``failed`` (no end); ``why`` is the reason.

    ``error`` is the largest difference of any state over the samples clear of jumps at which both have it, NaN where
    no sample compares.
    """

    verdict: str
    error: float
    transitions: int | None
    why: str = ""
    rho: Interval | None = None


def judge(scene: Scene, result: Result) -> Judgement:
    """Compare a result with the exact execution."""
    apart = np.abs(scene.exact_values[scene.clear] - result.values[scene.clear])
    error = float(np.fmax.reduce(np.where(np.isfinite(apart), apart, nan), axis=None, initial=nan))
    found = outcome(scene, result, OF_CHARTS)
    return Judgement("failed" if result.problem else found.word, error, found.transitions, found.why)


def rho(scene: Scene, execution: Execution, seconds: float) -> Interval | None:
    """Return the distance to the exact execution; None where the run does not get to its end."""
    if not execution.stop.complete:
        return None
    return distance_of_runs(execution, scene.exact, model=scene.model, seconds=seconds).interval
