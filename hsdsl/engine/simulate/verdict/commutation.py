"""Does the order of simultaneous transitions matter, or of executions that wait?

Do simultaneous transitions commute? That question is defined in `hsdsl.mathematics.decisions.commutation`.

Executions that wait are made in the order of times that an error may change. A delay that is the same for all keeps the
order in which they began, whatever the error is.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise

from hsdsl.base.names import memory
from hsdsl.base.numbers.arithmetic import DOMAIN_ERRORS, Number
from hsdsl.engine.execution import Transition
from hsdsl.engine.integrators.stepper import State
from hsdsl.engine.simulate.problem import Tails
from hsdsl.engine.simulate.stops import show
from hsdsl.engine.simulate.verdict.run_view import Finding, Place, RunView
from hsdsl.mathematics.program import EdgeProgram, ModeProgram, Queue

SAME = 2.0**-44  # round-off, relative to the largest size that a state has in the run: one point
LONGEST = 64  # transitions at one instant
MOST_CHOICES = 256  # that a verdict looks at once one matters
TIES = 4  # how much delays that are the same may differ by

Landed = tuple[str, State]


def choices(run: RunView) -> tuple[list[Finding], list[str]]:
    """Findings about every transition that others were passed over for, and the ties that commute."""
    if run.screen is not None and not run.undecided("choice"):
        return [], together(run.screen.commuting)
    found: list[Finding] = []
    commuting: list[Number] = []
    tied = [made for made in run.reliable_transitions if made.alternatives]
    for i, made in enumerate(tied):
        error = tuple(abs(x) for x in run.before(made)[0].x) if run.errors is None else run.error_before(made)
        rivals, matters = _choice(run, made, error)
        if matters:
            enough = len(found) == MOST_CHOICES or run.by_shadow  # which a finer run confirms
            found.append(Finding("choice", "left", _and_later(matters, len(tied) - i - 1) if enough else matters))
            if enough:
                break
        elif rivals:
            commuting.append(made.time)
    return found, together(commuting)


def first_of_many(run: RunView) -> str:
    """Say of a run with many choices that one of the first matters, whatever its error; nothing for other runs."""
    if run.screen_made is not None and not run.screen_made.undecided("choice"):
        return ""
    tied = [made for made in run.transitions if made.alternatives]
    for i, made in enumerate(tied[:MOST_CHOICES] if len(tied) > MOST_CHOICES else ()):
        if matters := _choice(run, made, (0.0,) * len(made.before))[1]:
            return _and_later(matters, len(tied) - i - 1)
    return ""


def _and_later(sentence: str, count: int) -> str:
    return f"{sentence}; {count:,} later choices were not looked at" if count else sentence


def _choice(run: RunView, made: Transition, error: State) -> tuple[bool, str]:
    """Whether others could go in the place of a transition, within an error, and a sentence where that matters."""
    place, k = run.before(made)
    rivals = {name: run.edge_at(place, name) for name in made.alternatives}
    rivals = {name: other for name, other in rivals.items() if not place.outranks(k, other, error)}
    rivals = {name: other for name, other in rivals.items() if not _set_off_together(run, made, k, other)}
    if not rivals or commute(run, place, [k, *rivals.values()], run.tails_before(made)):
        return bool(rivals), ""
    choice = f"at t = {show(made.time)} the choice of {made.edge} rather than {' or '.join(rivals)} matters"
    return True, f"{choice}: they lead to different points"


def _set_off_together(run: RunView, made: Transition, k: int, other: int) -> bool:
    """Whether edge k has the higher priority, and crossings of one surface set off both, after the same delay."""
    edges = run.before(made)[0].mode.edges
    if not edges[k].priority > edges[other].priority:
        return False
    one, rival = (_origin(run, made, edges[j]) for j in (k, other))
    if one is None or rival is None or one[1] != rival[1] or one[0].time != rival[0].time:
        return False
    place, first = run.before(one[0])
    second = other if rival[0] is made else run.before(rival[0])[1]
    try:
        return place.coincide(first, second, run.error_before(one[0]) if run.errors else (0.0,) * len(place.x))
    except DOMAIN_ERRORS:
        return False


_NO_DELAY = "delay 0"


def _origin(run: RunView, made: Transition, edge: EdgeProgram) -> tuple[Transition, str] | None:
    """The crossing that sets off an edge at a transition, and the delay from it on; None where it is not known.

    Of an execution that waits it is where the execution began, of other edges the transition itself.
    """
    at, begins = memory(edge.name, "at"), f"{edge.name} triggers"
    if edge.name not in edge.of_event or at not in made.before:
        return None if made.entry else (made, _NO_DELAY)
    for i in reversed(range(made.index)):
        earlier = run.transitions[i]
        if earlier.source != made.source or earlier.target != made.source or earlier.after is None:
            break
        if earlier.edge == begins and earlier.after[at] == made.before[at]:
            delay = next((word for word in edge.of_event if word.startswith("delay ")), "")
            return None if earlier.entry else (earlier, delay)
    return None


def together(commuting: Sequence[Number]) -> list[str]:
    """Say when transitions are reached together that commute."""
    instants = list(dict.fromkeys(map(show, commuting)))
    if not instants:
        return []
    listed = ", ".join(instants[:3]) + (f" and {len(instants) - 3} more" if len(instants) > 3 else "")
    return [f"surfaces are reached together at t = {listed}; every order leads to the same point"]


def commute(run: RunView, place: Place, tied: Sequence[int], tails: Tails, since: Number = 0) -> bool:
    """Whether each of the tied edges of a place, taken first, leads to the same point.

    Surfaces that are reached within the time ``since`` count as reached together. ``tails`` are what waits there.
    """
    since = max(since, 2 * run.tie(place.t))  # what is tied may be that far apart, and off a surface by the rest
    try:
        landed = [land_after(run, place, k, since, tails.copy()) for k in tied]
    except DOMAIN_ERRORS:
        return False
    return None not in landed and all(_same_point(run, landed[0], other) for other in landed[1:])


def _same_point(run: RunView, one: Landed | None, other: Landed | None) -> bool:
    if one is None or other is None or one[0] != other[0] or len(one[1]) != len(other[1]):
        return False
    names = run.problem.program.modes[run.index(one[0])].states
    sizes = [run.sizes.get(name, 0.0) for name in names] or [0.0] * len(one[1])
    pairs = zip(one[1], other[1], sizes, strict=True)
    return all(abs(a - b) <= SAME * max(abs(a), abs(b), size) for a, b, size in pairs)


def land_after(run: RunView, place: Place, k: int, since: Number, tails: Tails) -> Landed | None:
    """Take edge k, then what fires at the same instant; None where that has no end."""
    for _ in range(LONGEST):
        target, x = place.mode.edges[k].target, place.kernel.resets[k](place.t, *place.x)
        x = tails.advance(place.mode, place.x, run.problem.program.modes[target], x)
        place = run.place(target, place.t, x)
        if place.mode.final:
            return place.mode.name, place.x
        following = _goes_at_once(place, since)
        if following is None:
            return place.mode.name, place.x
        k = following
    return None


def _goes_at_once(place: Place, since: Number) -> int | None:
    """The edge that goes at once from a state."""
    surfaces, edges = place.surfaces, place.mode.edges
    from hsdsl.engine.simulate.surfaces import Arrival  # few runs come here

    beyond = surfaces.enter(place.t, place.x, place.kernel.surfaces(place.t, *place.x), Arrival(since))
    ready = [k for k in beyond if k < len(edges) and not edges[k].conditional]
    ready = ready or surfaces.standing(place.t, place.x, since)
    return min(ready, key=lambda k: (-edges[k].priority, k), default=None)


def waiting_orders(run: RunView) -> Iterator[str]:
    """Say which executions of an event, of different values, may have another order."""
    for mode in run.problem.program.modes:
        for queue in mode.queues:
            if len(queue.values) > 1:
                yield from _of_queue(run, mode, queue)


def _of_queue(run: RunView, mode: ModeProgram, queue: Queue) -> Iterator[str]:
    values = [mode.states[i] for i in queue.values[1:]]
    changing = {edge.name: edge.changes for edge in mode.edges if queue.waiting in edge.changes}
    begins = {name for name, changes in changing.items() if queue.values[0] in changes}
    own = [made for made in run.transitions if made.source == mode.name and made.edge in changing]
    began = [made.time for made in own if made.edge in begins]
    ends = [made for made in own if made.edge not in begins]
    delays = [end.time - begin for end, begin in zip(ends, began, strict=False)]
    for k, (one, other) in enumerate(pairwise(ends)):
        tie, apart = run.tie(other.time), other.time - one.time
        if not apart > tie or all(one.before[name] == other.before[name] for name in values):
            continue
        alike = k + 1 < len(delays) and abs(delays[k] - delays[k + 1]) <= TIES * tie
        if not alike and run.errors is not None and apart <= run.late(other.time):
            yield f"the order of executions of {one.edge} that wait until t = {show(one.time)} is within the error"
            return
