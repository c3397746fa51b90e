"""Does the theorem hold for this run? Its hypotheses, looked at one by one in what a run recorded.

The convergence theorem (Burden et al. 2013, Thm 26, Cor. 28) is about executions that cross finitely many guards, each
transversally, with no other surface so near that an error could change the sequence, and where simultaneous choices
lead to the same point. A run shows its own neighbourhood of the execution, so every margin is held against the error
that the run allows itself.

================  ==============================================================================
`allowed`         the error of a run, as far as its settings tell
`looking`         a recorded run with its modes' routines, to be looked at anywhere
`crossings`       is each transition transversal, and its condition the same all around it?
`misses`          surfaces that are almost reached, and what happens within the error of the end
`choices`         do transitions that are reached together commute?
`accumulation`    Zeno points and rest, which the relaxed scheme goes through without a word
================  ==============================================================================
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from hsdsl.execution import Stop, Transition, Verdict
from hsdsl.simulate.stops import show
from hsdsl.simulate.verdict.accumulation import accumulations
from hsdsl.simulate.verdict.choices import choices
from hsdsl.simulate.verdict.crossings import crossings
from hsdsl.simulate.verdict.finding import Finding
from hsdsl.simulate.verdict.looking import Looking
from hsdsl.simulate.verdict.misses import misses

__all__ = ["Looking", "assess"]

MOST_NAMED = 4  # findings of one kind
INCOMPLETE = ("transition_limit", "memory_limit", "not_finite", "step_underflow", "interrupted")
LEFT = ("left_domain", "zeno")


def assess(run: Looking, departures: Sequence[str], doubts: Sequence[str]) -> Verdict:
    """Say whether the theorem's hypotheses hold for a run, are left, or cannot be told.

    Parameters
    ----------
    run : Looking
        What was recorded.
    departures, doubts : sequence of str
        What the loop itself noted: where it left what the theorem is about, and what it could not check.
    """
    left, unknown, said = [*departures], [*doubts], list[str]()
    left += [sentence for sentence in accumulations(run) if not departures]
    if run.stop.reason in LEFT:
        left.append(run.stop.message)
    if left:
        return Verdict("left", (*left, *unknown))
    found: list[Finding] = []
    for look in (crossings, choices, misses):
        findings, reasons = look(run)
        found += findings
        said += reasons
    left += _named(found, "left")
    unknown += _named(found, "unknown")
    unknown += _unchecked(run, run.stop, run.transitions)
    if left:
        return Verdict("left", (*left, *unknown))
    return Verdict("unknown", (*unknown, *said)) if unknown else Verdict("holds", tuple(said))


def _named(found: Sequence[Finding], theorem: str) -> Iterator[str]:
    """The sentences of one standing, the most telling of each kind first."""
    of = [f for f in found if f.theorem == theorem]
    for kind in dict.fromkeys(f.kind for f in of):
        same = [f for f in of if f.kind == kind]
        yield from (f.sentence for f in same[:MOST_NAMED])
        if len(same) > MOST_NAMED:
            yield f"and {len(same) - MOST_NAMED} more like the last"


def _unchecked(run: Looking, stop: Stop, transitions: Sequence[Transition]) -> Iterator[str]:
    if stop.reason in INCOMPLETE:
        yield f"the run did not get to its end: {stop.message}"
    if run.allowed is None:
        yield "a fixed step does not say how wrong it is, so no margin can be held against the error (a tolerance does)"
    if jumps := run.jumping_flows():
        names = ", ".join(jumps)
        yield f"the flow of mode {names} jumps where sign or floor does, and the theorem is about continuous ones"
    at_once = [t for t in transitions if t.entry]
    if at_once:
        first = at_once[0]
        yield (
            f"{len(at_once)} transition{'s' * (len(at_once) > 1)} fired at once on entry, the first {first.edge} at "
            f"t = {show(first.time)}: the state entered {first.source} outside its domain"
        )
