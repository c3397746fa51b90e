"""The paper's two oscillators with a stop (Table I) as exact executions."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from hsdsl.base.errors import UsageError
from hsdsl.engine.execution import Execution, Verdict
from references.closed_form import ClosedForm, as_execution
from references.impact_oscillator import Flight, Motion, exact_example_1, exact_example_2
from references.interpolation import Number, Stretch, Vector, mp
from references.rests import UNRESOLVED, rest, tail

EXAMPLES = {1: exact_example_1, 2: exact_example_2}
SOURCE = (
    "closed form between impacts (Burden et al. 2013, Sec. V-B), impacts as its roots to 80 digits, "
    "Zeno tails summed to their limit, rest while the force presses on the stop"
)
DEGREE = 8


def oscillator(example: int) -> Execution:
    """Example 1 or 2 of Table I, exactly: 49 impacts, or two Zeno points and rest on the stop between.

    Parameters
    ----------
    example : {1, 2}
        The column of the table.

    Returns
    -------
    Execution
        In mode ``free`` with states ``x``, ``v``; ``settings["error"]`` bounds its error at any time.

    Raises UsageError: there is no such example.
    """
    if example not in EXAMPLES:
        raise UsageError(f"Table I has examples 1 and 2, not {example!r}")
    motion = EXAMPLES[example]()
    scene = ClosedForm(
        name=f"oscillator-with-stop-{example}.yaml",
        title=f"Forced linear oscillator with stop, example {example}",
        source=SOURCE,
        states={"free": ("x", "v")},
        stretches=stretches(motion),
        verdict=_verdict(motion),
        degree=DEGREE,
    )
    return as_execution(scene)


def stretches(motion: Motion) -> list[Stretch]:
    """Flights, tails and rests of a motion, in order."""
    found: list[Stretch] = []
    stop = motion.oscillator.number("x_max")
    velocity = {impact.time: impact.velocity for impact in motion.impacts}
    summed = mp.mpf(0)  # the end of the last tail put down as a line: its flights are left out
    for (start, flight), end in zip(motion.pieces, _ends(motion), strict=True):
        if start < summed:
            continue
        if flight is None:
            found.append(rest("free", start, end, (stop, mp.mpf(0))))
            continue
        limit = min((z for z in motion.zeno if z >= start), default=None)
        if limit is not None and limit - start <= UNRESOLVED * limit:
            found.append(tail("free", start, limit, flight.at(start), (stop, mp.mpf(0))))
            summed = limit
            continue
        last: Vector = (stop, velocity[end]) if end in velocity else flight.at(end)
        edge = "impact" if end in velocity else None
        found.append(
            Stretch("free", start, end, _first(motion, start, flight), last, flight.at, flight.derivative, edge)
        )
    return found


def _ends(motion: Motion) -> list[Number]:
    """Where each piece of a motion ends: the next one's start, but a last flight before a rest at its impact."""
    ends: list[Number] = []
    impacts = {impact.time for impact in motion.impacts}
    for (_, flight), (start, following) in pairwise(motion.pieces):
        summed = flight is not None and following is None and start not in impacts
        ends.append(max(t for t in impacts if t < start) if summed else start)
    return [*ends, motion.until]


def _first(motion: Motion, start: Number, flight: Flight) -> Vector:
    """Return a flight's initial values; on the stop its position exactly."""
    x, v = flight.at(start)
    return (motion.oscillator.number("x_max"), v) if start > 0 else (x, v)


def _verdict(motion: Motion) -> Verdict:
    if motion.zeno:
        points = " and ".join(f"{float(t):.10g}" for t in motion.zeno)
        rests = [start for start, flight in motion.pieces if flight is None]
        return Verdict(
            "left",
            (
                f"infinitely many impacts before t = {points}; those that floats cannot tell apart are one arc",
                f"at rest on the stop from t = {', '.join(f'{float(t):.10g}' for t in rests)}, where the paper's "
                "execution does not go on: it stands for the sticking mass, the limit of the relaxed executions",
            ),
        )
    slowest = min(float(impact.velocity) for impact in motion.impacts)
    distance, t = nearest_miss(motion)
    return Verdict(
        "holds",
        (
            f"{len(motion.impacts)} impacts, none slower than {slowest:.4g}",
            f"it misses the stop by {distance:.3g} at least (t = {t:.6g})",
        ),
    )


def nearest_miss(motion: Motion) -> tuple[float, float]:
    """Return the least distance from the stop at which a flight turns back, and when."""
    found: list[tuple[float, float]] = []
    stop = float(motion.oscillator.number("x_max"))
    for (start, flight), end in zip(motion.pieces, _ends(motion), strict=True):
        if flight is not None:
            times = np.arange(float(start), float(end), 1e-3)
            x, _ = flight.at(times, np)
            turns = np.flatnonzero((x[1:-1] >= x[:-2]) & (x[1:-1] > x[2:])) + 1
            found += [(stop - float(x[k]), float(times[k])) for k in turns]
    return min(found)
