"""How wrong is a run? The same run again, finer, and how far apart the two are."""

from __future__ import annotations

from bisect import bisect_right
from dataclasses import dataclass
from typing import Any

from hsdsl.arithmetic import Number
from hsdsl.execution import Execution, Transition
from hsdsl.simulate.stops import show

SAMPLES = 1000
FINER_TOLERANCE = 32  # a method of order 5 halves its steps


@dataclass(frozen=True)
class Estimate:
    """The distance between a run and a finer one.

    Attributes
    ----------
    settings : dict
        What the finer run used.
    same_transitions : bool
        Whether both made the same transitions in the same order.
    time : Number or None
        Largest difference between transition times, strips' delays subtracted; None where the sequences differ.
    final : dict or None
        Difference of each final state; None where the runs ended in different modes or at different times.
    largest : dict or None
        Largest difference of each state at `SAMPLES` times away from transitions; None where the sequences differ.
    """

    settings: dict[str, Any]
    same_transitions: bool
    time: Number | None
    final: dict[str, Number] | None
    largest: dict[str, Number] | None = None

    @property
    def error(self) -> dict[str, Number] | None:
        """What the coarser run's error may be where both errors fall at least linearly; None where nothing is known."""
        return None if self.largest is None else {name: 2 * value for name, value in self.largest.items()}

    def as_json(self) -> dict[str, Any]:
        """Return the ``estimate`` object of ``hsdsl run --estimate --json``."""
        return {
            "settings": self.settings,
            "same_transitions": self.same_transitions,
            "time": self.time,
            "final": self.final,
            "largest": self.largest,
        }

    @property
    def sentence(self) -> str:
        """What the estimate says, for a person."""
        finer = ", ".join(f"{name} {show(value)}" for name, value in self.settings.items())
        if not self.same_transitions:
            return f"estimate: left; the finer run ({finer}) makes other transitions, so neither can be trusted"
        if self.final is None:
            return f"estimate: left; the finer run ({finer}) ends elsewhere"
        apart = ", ".join(f"{name} {float(value):.2g}" for name, value in self.final.items()) or "no states"
        times = f", transition times {float(self.time):.2g}" if self.time is not None else ""
        return (
            f"estimate: the finer run ({finer}) ends {apart} away{times}; where both errors fall at least linearly, "
            "this run's error is at most about twice that"
        )


def finer_settings(execution: Execution) -> dict[str, Number]:
    """Return settings with half the step (or the tolerance of half steps, if there is one) and half the relaxation."""
    settings = execution.settings
    finer = {"relaxation": settings["relaxation"] / 2} if "relaxation" in settings else {}
    if "step" in settings:
        return {"step": settings["step"] / 2, **finer}
    last = execution.times[0]
    digit = last.context.eps if execution.times.dtype == object else 2.0**-52
    return {"tolerance": max(digit, settings["tolerance"] / FINER_TOLERANCE), **finer}


def compare(coarse: Execution, fine: Execution, settings: dict[str, Number]) -> Estimate:
    """Compare two runs of one model."""
    same = [t.edge for t in coarse.transitions] == [t.edge for t in fine.transitions]
    times = None
    if same:
        pairs = zip(corrected_times(coarse.transitions), corrected_times(fine.transitions), strict=True)
        times = max((abs(a - b) for a, b in pairs), default=None)
    a, b = coarse.final, fine.final
    comparable = (a.mode, coarse.stop.reason, list(a.state)) == (b.mode, fine.stop.reason, list(b.state))
    final = {name: abs(a.state[name] - b.state[name]) for name in a.state} if comparable else None
    return Estimate(settings, same, times, final, _largest(coarse, fine, times) if same else None)


def _largest(coarse: Execution, fine: Execution, apart: Number | None) -> dict[str, Number]:
    """The largest difference of each state at times at which neither run has a transition nearby."""
    start, end = coarse.time_span[0], min(coarse.time_span[1], fine.time_span[1])
    step = (end - start) / SAMPLES
    grid = [start + step * k for k in range(SAMPLES)] + [end]
    clear = [t for t in grid if not any(_close(run, t, 2 * (apart or 0)) for run in (coarse, fine))]
    if not clear:
        return {}
    a, b = coarse.sample(clear), fine.sample(clear)
    found: dict[str, Number] = {}
    for name in (name for name in a.states if name in b.states):
        differences = [abs(x - y) for x, y in zip(a[name].tolist(), b[name].tolist(), strict=True)]
        found[name] = max((d for d in differences if d == d), default=0.0)
    return found


def _close(run: Execution, t: Number, margin: Number) -> bool:
    """Whether a transition of a run, or a wait behind one, is near a time."""
    times = run.transitions
    k = bisect_right(times, t + margin, key=lambda made: made.time) - 1
    if k < 0:
        return False
    resumed = times[k].resumed
    return resumed is None or t - margin <= resumed


def corrected_times(transitions: tuple[Transition, ...]) -> list[Number]:
    """Return transition times less the time spent in strips before them."""
    times: list[Number] = []
    spent = 0
    for transition in transitions:
        times.append(transition.time - spent)
        if transition.resumed is not None:
            spent = spent + (transition.resumed - transition.time)
    return times
