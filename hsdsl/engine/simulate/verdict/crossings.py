"""Is each transition transversal, and could an error have made its condition another?

Where a surface rises at the rate a and bends by b, an error that moves it by d leaves it crossed while d is below
a**2 / (2 abs(b)): that depth is the margin. Where it turns back at a kink of an input, its height there is one as well.
"""

from __future__ import annotations

from hsdsl.base.numbers.arithmetic import DOMAIN_ERRORS, Number
from hsdsl.engine.execution import Arc, Transition
from hsdsl.engine.simulate.stops import show
from hsdsl.engine.simulate.verdict.agreement import SAFE
from hsdsl.engine.simulate.verdict.finding import Finding, times
from hsdsl.engine.simulate.verdict.near_surface import has_condition
from hsdsl.engine.simulate.verdict.place import Place
from hsdsl.engine.simulate.verdict.run_view import RunView
from hsdsl.engine.simulate.verdict.screen import CROSSING_UNDECIDED

BEYOND = 4  # errors behind a surface, so that no error takes a state back to it


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
            found.append(
                Finding("no value", "unknown", f"{transition.edge} has no rate at t = {show(transition.time)}")
            )
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
    each = f"{count} transition{'s' * (count > 1)}, the surfaces rising at a rate of at least {float(slowest):.4g}"
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
    """How high a surface rises behind a crossing until it turns back at a kink of an input; infinite above enough."""
    timeline, height, rate = run.problem.timeline, run.arithmetic.zero, place.rate(k)
    while timeline.goes_on(segment := timeline.at(place.t)):
        late = segment.end - place.t
        height = height + rate * late
        if height >= enough:
            break
        slope = place.kernel.flow(place.t, *place.x)
        x = tuple(a + late * f for a, f in zip(place.x, slope, strict=True))
        place = run.place(place.mode.name, segment.end, x)
        rate = place.rate(k)
        if not rate > 0:
            return height
    return height + float("inf")


def _findings(
    run: RunView, place: Place, k: int, rate: Number, margin: Number | None, made: Transition
) -> list[Finding]:
    found: list[Finding] = []
    where = f"{made.edge} at t = {show(made.time)}"
    if not any(place.kernel.gradients[k](place.t, *place.x)):
        return [Finding("flat", "unknown", f"the surface of {where} has no slope there")]
    if not rate > place.rate_roundoff(k):
        return [Finding("tangency", "left", f"the flow is tangent to the surface of {where}")]
    if margin is not None and margin < SAFE:
        found.append(
            Finding(
                "tangency",
                "unknown",
                f"the crossing of {where}, at a rate of {float(rate):.3g}, would be undone by {times(margin)} "
                "the error",
            )
        )
    if run.errors is None:
        return found
    row = run.row_before(made)
    holds = {True}
    if has_condition(place, k):
        holds = place.conditions(k, run.safe_error(place, row), run.safe_time_error(place, k, row))
    if holds != {True} and not _turns_true(run, place, k, row):
        found.append(Finding("condition", "unknown", f"whether the condition of {where} holds is within the error"))
    return found


def _turns_true(run: RunView, place: Place, k: int, row: int) -> bool:
    """Whether comparisons of one event are reached together, behind all of which its condition holds: it fires once."""
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
    flow = place.kernel.flow(place.t, *place.x)
    behind = run.place(
        place.mode.name, place.t + ahead, tuple(x + ahead * f for x, f in zip(place.x, flow, strict=True))
    )
    return behind.conditions(k, error, late) == {True}
