"""A solution by Taylor series as an execution."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from hsdsl.base.errors import UsageError
from hsdsl.engine.execution import Execution, Verdict
from references.closed_form import ClosedForm, as_execution
from references.interpolation import mp
from references.taylor import ORDER, Mode, Solved, digits, solve

METHOD = "Taylor series"
SOURCE = (
    "Taylor series of order {order} in {digits} digits, crossings as roots of the surfaces' series; "
    "half the steps ({step}) change nothing in {agreed} digits"
)
DEGREE = 12
ORDERED = mp.mpf(10) ** -25  # ends as near as this are one, whichever order simultaneous transitions had


def by_series(
    name: str, title: str, modes: Mapping[str, Mode], mode: str, start: Sequence[Any], until: Any, step: str
) -> Execution:
    """Solve a system twice, with a step and with half of it, and cut the finer solution into pieces.

    Raises UsageError: the solutions make other transitions, or the order of simultaneous ones matters.
    """
    x, end = [mp.convert(a) for a in start], mp.convert(until)
    coarse, fine = (solve(modes, mode, x, end, mp.mpf(step) / n) for n in (1, 2))
    agreed = digits(coarse, fine)
    if any(stretch.alternatives for stretch in fine.stretches):
        _check_order(coarse, solve(modes, mode, x, end, mp.mpf(step), order=-1))
    states = {name: each.states for name, each in modes.items()}
    if fine.final is not None:
        states[fine.final] = modes[fine.stretches[-1].mode].states
    scene = ClosedForm(
        name=f"{name}.yaml",
        title=title,
        source=SOURCE.format(order=ORDER, digits=mp.dps, step=step, agreed=agreed),
        states=states,
        stretches=fine.stretches,
        verdict=verdict(fine),
        degree=DEGREE,
        method=METHOD,
        digits=agreed,
        final=fine.final,
    )
    return as_execution(scene)


def _check_order(one: Solved, other: Solved) -> None:
    ends = [(*solved.stretches[-1].last, solved.stretches[-1].end) for solved in (one, other)]
    if one.final != other.final or any(abs(a - b) > ORDERED for a, b in zip(*ends, strict=True)):
        raise UsageError("two transitions fall together and their order matters: there is no one reference")


def verdict(solved: Solved) -> Verdict:
    """Finitely many transitions, how transversal they are, and how near the others came."""
    reasons = [
        f"{len(solved.rates)} transitions cross their surfaces at a rate of at least {float(min(solved.rates)):.4g}"
    ]
    if solved.misses:
        reasons.append(f"elsewhere no surface is missed by less than {float(min(solved.misses)):.3g}")
    together = [stretch for stretch in solved.stretches if stretch.alternatives]
    if together:
        times = ", ".join(f"{float(stretch.end):.10g}" for stretch in together)
        reasons.append(f"two surfaces are reached together at t = {times}; either order leads to the same point")
    return Verdict("holds", tuple(reasons))
