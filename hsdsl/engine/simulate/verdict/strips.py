"""Transitions lost in strips: a surface with an `if` that moves past a state which waits is never crossed by it.

Of transitions that are reached together one goes. Where it waits in a strip, time goes on. Another one whose `if` holds
is behind its surface afterwards, and so is one that the reset makes due at once.
"""

from __future__ import annotations

from collections.abc import Iterator

from hsdsl.base.numbers.arithmetic import DOMAIN_ERRORS
from hsdsl.engine.execution import Transition
from hsdsl.engine.simulate.stops import show
from hsdsl.engine.simulate.verdict.run_view import RunView


def lost_in_strips(run: RunView) -> Iterator[str]:
    """Say which transition was first lost while another one waited in a strip."""
    conditional = {mode.name for mode in run.problem.program.modes if any(edge.conditional for edge in mode.edges)}
    if not conditional:
        return
    for made in run.transitions:
        if made.resumed is not None and made.resumed > made.time and made.target in conditional:
            for name in lost(run, made):
                yield (
                    f"{name} was lost at t = {show(made.time)}: its surface has an `if` and moved on "
                    f"while {made.edge} waited in a strip"
                )
                return


def lost(run: RunView, made: Transition) -> list[str]:
    """Edges whose surfaces moved past the state in the strip of a transition, with their `if` true behind it."""
    if made.after is None:
        return []
    x = tuple(made.after.values())
    before, place = run.place(made.target, made.time, x), run.place(made.target, made.resumed, x)
    edges, kernel = place.mode.edges, place.kernel
    found: list[str] = []
    try:
        then, now = before.kernel.surfaces(before.t, *x), kernel.surfaces(place.t, *x)
        for k, edge in enumerate(edges):
            passed = edge.conditional and now[k] > place.roundoff_bound(k) >= then[k]
            if passed and kernel.conditions[k](place.t, *x)[0]:
                found.append(edge.name)
    except DOMAIN_ERRORS:
        pass
    return found
