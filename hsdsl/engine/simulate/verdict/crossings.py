"""Are there finitely many transitions, each made by the flow across its surface, whatever the error is?

Where a surface rises at the rate a and bends by b, an error that moves it by d leaves it crossed while d is below
a**2 / (2 abs(b)): that depth is the margin. Where it turns back at a kink of an input, its height there is one as well.

The relaxed scheme goes on after a Zeno point and creeps along a guard where the execution rests or slides. Either way
many transitions follow each other with hardly any flow between them. Where a transition waits in a strip, time goes on:
another one that was reached together with it and whose `if` holds is beyond its surface afterwards, and so is one that
the reset makes due at once. Such a surface moves past the state and is never crossed by it.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import accumulate, pairwise

from hsdsl.base.numbers.arithmetic import DOMAIN_ERRORS, Number
from hsdsl.engine.execution import Arc, Transition
from hsdsl.engine.simulate.stops import FREE, show
from hsdsl.engine.simulate.verdict.errors import SAFE, times
from hsdsl.engine.simulate.verdict.run_view import Finding, Place, RunView
from hsdsl.engine.simulate.verdict.screen import CROSSING_UNDECIDED

BEYOND = 4  # errors beyond a surface, so that no error takes a state back to it


def crossings(run: RunView) -> tuple[list[Finding], list[str]]:
    """Findings about every transition that the flow made, and the margins of the others."""
    found: list[Finding] = []
    slowest: Number | None = None
    least: Number | None = None
    known = None if run.undecided("crossing") or run.screen is None else run.screen.margins
    made = run.reliable_transitions if known is None else run.undecided_transitions(CROSSING_UNDECIDED)
    made = [t for t in made if not t.entry]
    ends = {arc.jump: arc for arc in run.flows} if made else {}
    for transition in made:
        place, k = run.before(transition)
        try:
            rate = place.rate(k)
            slowest = rate if slowest is None else min(slowest, rate)
            margin = _margin(run, place, k, ends.get(transition.index), transition)
            found += _findings(run, place, k, rate, margin, transition)
        except DOMAIN_ERRORS:
            where = f"at t = {show(transition.time)}"
            found.append(Finding("no value", "unknown", f"{transition.edge} has no rate {where}"))
            continue
        if margin is not None:
            least = margin if least is None else min(least, margin)
    if known is not None:
        return found, summary(run.execution.made, known.crossed, known.slowest, known.least)
    return found, summary(run.execution.made, len(made), slowest, least)


def summary(made: int, count: int, slowest: Number | None, least: Number | None) -> list[str]:
    """Say how many of the transitions that were made the flow made, at which rates, and by which margin."""
    if not count or slowest is None:
        return ["no transition"] if not made else []
    cross = f"{count} transitions cross their surfaces" if count > 1 else "1 transition crosses its surface"
    each = f"{cross} at a rate of at least {float(slowest):.4g}"
    return [each + (f", {times(least)} what the error could undo" if least is not None else "")]


def _margin(run: RunView, place: Place, k: int, arc: Arc | None, made: Transition) -> Number | None:
    """How often the error fits into what keeps the crossing; None where nothing shows it."""
    if run.errors is None:
        return None
    shift = run.surface_error(place, k, run.row_before(made))
    rate, bend = place.rate(k), run.arithmetic.zero
    if arc is not None:
        before = run.dense_output(arc, arc.last - 1)((run.arithmetic.zero + 1) / 2)
        bend = abs(rate - before.rate(k)) / (place.t - before.t) if place.t > before.t else bend
    depth = rate * rate / (2 * bend) if bend > 0 else run.arithmetic.zero + float("inf")
    depth = min(depth, _height(run, place, k, SAFE * shift))
    return depth / shift if shift > 0 else run.arithmetic.zero + float("inf")


def _height(run: RunView, place: Place, k: int, enough: Number) -> Number:
    """How high a surface rises after a crossing until it turns back at a kink of an input; infinite above enough."""
    timeline, height, rate = run.problem.timeline, run.arithmetic.zero, place.rate(k)
    while timeline.goes_on(segment := timeline.at(place.t)):
        late = segment.end - place.t
        height = height + rate * late
        if height >= enough:
            break
        place = _ahead(run, place, late, segment.end)
        rate = place.rate(k)
        if not rate > 0:
            return height
    return height + float("inf")


def _findings(
    run: RunView, place: Place, k: int, rate: Number, margin: Number | None, made: Transition
) -> list[Finding]:
    where = f"{made.edge} at t = {show(made.time)}"
    if not any(place.kernel.gradients[k](place.t, *place.x)):
        return [Finding("flat", "unknown", f"the surface of {where} has no slope there")]
    if not rate > place.rate_roundoff(k):
        return [Finding("tangency", "left", f"the flow is tangent to the surface of {where}")]
    found: list[Finding] = []
    if margin is not None and margin < SAFE:
        undone = f"at a rate of {float(rate):.3g}, would be undone by {times(margin)} the error"
        found.append(Finding("tangency", "unknown", f"the crossing of {where}, {undone}"))
    row = run.row_before(made)
    if run.errors is None or not place.has_condition(k):
        return found
    if run.conditions(place, k, row) != {True} and not _turns_true(run, place, k, row):
        found.append(Finding("condition", "unknown", f"whether the condition of {where} holds is within the error"))
    return found


def _turns_true(run: RunView, place: Place, k: int, row: int) -> bool:
    """Whether comparisons of one event are reached together, beyond all of which its condition holds: it fires once."""
    edges, error = place.mode.edges, run.safe_error(place, row)
    event, late, ahead = edges[k].of_event, run.safe_time_error(place, k, row), 0 * place.t
    if not event:
        return False
    for j, edge in enumerate(edges):
        shift = SAFE * run.surface_error(place, j, row) + place.roundoff_bound(j)
        if edge.of_event != event or edge.name != edges[k].name or abs(place.value(j)) > shift:
            continue
        rate = place.rates_within(j, error, late)
        if not rate.low > 0:
            return False
        ahead = max(ahead, BEYOND * shift / float(rate.low))
    return _ahead(run, place, ahead, place.t + ahead).conditions(k, error, late) == {True}


def _ahead(run: RunView, place: Place, late: Number, t: Number) -> Place:
    """The place so much later, at t, along a straight line."""
    flow = place.kernel.flow(place.t, *place.x)
    return run.place(place.mode.name, t, tuple(x + late * f for x, f in zip(place.x, flow, strict=True)))


def sliding_spans(run: RunView) -> Iterator[tuple[tuple[str, ...], Number, Number]]:
    """Give the modes between which the run slid, and from when to when."""
    modes = {mode.name: mode.slides for mode in run.problem.program.modes if mode.slides}
    spans: list[tuple[str, Number, Number]] = []
    for arc in run.flows if modes else ():
        if arc.mode in modes:
            start, end = run.times[arc.first], run.times[arc.last]
            if spans and spans[-1][::2] == (arc.mode, start):  # a jump or a kink of an input ended the arc before
                start = spans.pop()[1]
            spans.append((arc.mode, start, end))
    yield from ((modes[mode], start, end) for mode, start, end in spans)


def accumulations(run: RunView) -> Iterator[str]:
    """Say where transitions first crowd together, and where they are last seen to."""
    relaxation, made = run.problem.settings.relaxation, run.transitions
    if len(made) <= FREE:
        return
    flights = [b.time - (a.resumed if a.resumed is not None else a.time) for a, b in pairwise(made)]
    flown = [run.arithmetic.zero, *accumulate(flights)]
    crowded = [k for k in range(FREE, len(made)) if flown[k] - flown[k - FREE] <= relaxation]
    if crowded:
        first = made[crowded[0] - FREE]
        yield (
            f"more than {FREE} transitions within the relaxation of flow from t = {show(first.time)} on "
            f"({first.edge}): a Zeno point, rest or sliding, which the theorem does not cover"
        )


def lost_in_strips(run: RunView) -> Iterator[str]:
    """Say which transition was first lost while another one waited in a strip."""
    conditional = {mode.name for mode in run.problem.program.modes if any(edge.conditional for edge in mode.edges)}
    for made in run.transitions if conditional else ():
        if made.resumed is not None and made.resumed > made.time and made.target in conditional:
            for name in _lost(run, made):
                lost = f"{name} was lost at t = {show(made.time)}: its surface has an `if` and moved on"
                yield f"{lost} while {made.edge} waited in a strip"
                return


def _lost(run: RunView, made: Transition) -> list[str]:
    """Edges whose surfaces moved past the state in the strip of a transition, with their `if` true after it."""
    if made.after is None:
        return []
    x = tuple(made.after.values())
    before, place = run.place(made.target, made.time, x), run.place(made.target, made.resumed, x)
    found: list[str] = []
    try:
        then, now = before.kernel.surfaces(before.t, *x), place.kernel.surfaces(place.t, *x)
        for k, edge in enumerate(place.mode.edges):
            passed = edge.conditional and now[k] > place.roundoff_bound(k) >= then[k]
            if passed and place.kernel.conditions[k](place.t, *x)[0]:
                found.append(edge.name)
    except DOMAIN_ERRORS:
        pass
    return found
