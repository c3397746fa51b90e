"""Transitions that fire at once on entry (M5): does the same one fire wherever an error moves the state?

A reset that puts the state outside of the next mode's domain is not what the theorem is about. Where an event is set
off so, or a transition of another part, or by a jump of an input, it is what the model says: one reset after another is
a reset as well. The theorem holds for it where it is continuous: the state is clearly beyond the surface, and clearly
not beyond those that would go first. The order among these is the file's.
"""

from __future__ import annotations

from hsdsl.base.numbers.arithmetic import DOMAIN_ERRORS
from hsdsl.base.numbers.enclosures import Undecided, as_range
from hsdsl.engine.execution import Transition
from hsdsl.engine.simulate.stops import show
from hsdsl.engine.simulate.verdict.agreement import SAFE
from hsdsl.engine.simulate.verdict.finding import Finding
from hsdsl.engine.simulate.verdict.resets import smooth_reset
from hsdsl.engine.simulate.verdict.run_view import RunView


def entries(run: RunView) -> tuple[list[Finding], list[str]]:
    """Findings about transitions that fired at once on entry."""
    found: list[Finding] = []
    if run.errors is None or not run.execution.enters_beyond:
        return found, []
    at_once = [made for made in run.reliable_transitions if made.entry]
    meant = [_is_meant(run, made) for made in at_once]
    outside = [made for made, is_meant in zip(at_once, meant, strict=True) if not is_meant]
    undecided = [made for made, is_meant in zip(at_once, meant, strict=True) if is_meant and not _is_sure(run, made)]
    for some, why in (
        (outside, "the state entered {} outside its domain"),
        (undecided, "an error in {} may keep it from that"),
    ):
        if some:
            count, first = len(some), f"{some[0].edge} at t = {show(some[0].time)}: {why.format(some[0].source)}"
            many = f"{count} transition{'s' * (count > 1)} fired at once on entry, the first {first}"
            found.append(Finding("entry", "unknown", many))
    for made in at_once:
        found += smooth_reset(run, made)
    return found, []


def _is_meant(run: RunView, made: Transition) -> bool:
    """Whether the model says that a transition is set off so."""
    place, k = run.before(made)
    jumps = made.time > 0 and run.problem.timeline.at(made.time).start == made.time and len(run.cascade(made)) == 1
    return bool(run.problem.program.parts or place.mode.edges[k].of_event or jumps)


def _is_sure(run: RunView, made: Transition) -> bool:
    """Whether the state is beyond the surface of a transition, and beyond none that goes first, within the error."""
    assert run.errors is not None
    place, k = run.before(made)
    row, edges = run.row_before(made), place.mode.edges
    late = SAFE * run.errors.time_error_at(made.time)
    try:
        values = [as_range(r) for r in place.enclosing().surfaces(*place.box(run.safe_error(place, row), late))]
        tied = {name for before in run.cascade(made) for name in before.alternatives}  # `choices` decides on these
        before = [j for j, edge in enumerate(edges) if (edge.priority, -j) > (edges[k].priority, -k)]
        first = [j for j in before if not edges[j].conditional and edges[j].name not in tied]
        known = {j: not run.surface_error(place, j, row) > 0 for j in (k, *first)}
    except (Undecided, *DOMAIN_ERRORS):
        return False
    return (values[k].low > 0 or known[k]) and all(values[j].high < 0 or known[j] for j in first)
