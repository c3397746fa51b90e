"""The error of a run, estimated by its distance to a finer run."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

from hsdsl.base.errors import UsageError
from hsdsl.base.names import checks_methods
from hsdsl.base.numbers.arithmetic import TIE, Number
from hsdsl.engine.execution import Execution, Transition
from hsdsl.engine.simulate.stops import show
from hsdsl.engine.simulate.verdict.errors import Errors

SAMPLES = 1000


@checks_methods
@dataclass(frozen=True)
class Estimate:
    """The differences between a run and a finer run.

    ``settings`` has the settings of the finer run that differ. ``same_transitions`` says whether both runs made the
    same transitions in the same order and stopped for the same reason. ``time`` is the largest difference between
    transition times, without the delays of strips (None if there are no common transitions). ``final`` has the
    difference of each final state (None if the runs ended in different modes or at different times). ``largest`` has
    the largest difference of each state at `SAMPLES` times away from transitions (None if the transitions differ or no
    such time is left).
    """

    settings: dict[str, Any]
    same_transitions: bool
    time: Number | None
    final: dict[str, Number] | None
    largest: dict[str, Number] | None = None

    def as_json(self) -> dict[str, Any]:
        """Return the ``estimate`` object of ``hsdsl run --estimate --json``."""
        return asdict(self)

    @property
    def sentence(self) -> str:
        """The estimate as a sentence."""
        finer = ", ".join(f"{name} {show(value)}" for name, value in self.settings.items())
        if not self.same_transitions:
            return f"estimate: unknown; the finer run ({finer}) makes other transitions, so neither can be trusted"
        if self.final is None:
            return f"estimate: unknown; the finer run ({finer}) ends elsewhere"
        apart = ", ".join(f"{name} {float(value):.2g}" for name, value in self.final.items()) or "no states"
        times = f", transition times {float(self.time):.2g}" if self.time is not None else ""
        return (
            f"estimate: the finer run ({finer}) ends {apart} away{times}; where both errors fall at least linearly, "
            "this run's error is at most about twice that"
        )


def estimate(run: Execution) -> Estimate:
    """Compare a run with a finer run.

    Raises UsageError: the run was read from a file, so that it cannot be run again.
    """
    finer = run.finer
    if finer is None:
        raise UsageError("an execution that was read from a file cannot be run again, so its error is not estimated")
    given, tie = run.settings, TIE * float(run.time_span[1])
    errors = Errors(run, finer, float(given.get("tolerance") or 0), 0.0, tie)
    sizes = {k: finer.settings.get(k) for k in ("step", "tolerance", "relaxation")}
    changed = {k: value for k, value in sizes.items() if value != given.get(k)}
    if errors.parted is not None:
        return Estimate(changed, False, None, None)
    a, b = run.final, finer.final
    comparable = (a.mode, list(a.state)) == (b.mode, list(b.state))
    pairs = zip(corrected_times(run.transitions), corrected_times(finer.transitions), strict=False)
    return Estimate(
        changed,
        True,
        max((abs(one - other) for one, other in pairs), default=None),
        {name: abs(a.state[name] - b.state[name]) for name in a.state} if comparable else None,
        _largest(run, finer, float(errors.time_errors[-1]) if len(errors.time_errors) else 0.0),
    )


def _largest(coarse: Execution, fine: Execution, apart: float) -> dict[str, Number] | None:
    start, end = coarse.time_span[0], min(coarse.time_span[1], fine.time_span[1])
    step = (end - start) / SAMPLES
    grid = [start + step * k for k in range(SAMPLES)] + [end]
    clear = [t for t in grid if not any(_is_near_transition(run, t, 2 * apart) for run in (coarse, fine))]
    if not clear:
        return None
    a, b = coarse.sample(clear), fine.sample(clear)
    largest: dict[str, Number] = {}
    for name in (name for name in a.states if name in b.states):
        differences = (abs(x - y) for x, y in zip(a[name].tolist(), b[name].tolist(), strict=True))
        if known := [d for d in differences if d == d]:
            largest[name] = max(known)
    return largest or None


def _is_near_transition(run: Execution, t: Number, margin: Number) -> bool:
    """Whether a transition of a run, or the wait after one, is near a time."""
    times = run.transitions
    k = bisect_right(times, t + margin, key=lambda transition: transition.time) - 1
    return k >= 0 and (times[k].resumed is None or t - margin <= times[k].resumed)


def corrected_times(transitions: Sequence[Transition]) -> list[Number]:
    """Return the transition times minus the time spent in strips before them."""
    times: list[Number] = []
    spent = 0
    for transition in transitions:
        times.append(transition.time - spent)
        if transition.resumed is not None:
            spent = spent + (transition.resumed - transition.time)
    return times
