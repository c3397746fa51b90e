"""Where arcs begin: does a reset land on, or within the error of, a surface that it need not land on?

A reset may put every state of its guard onto a surface, as a touchdown puts a foot onto its lift-off guard: states
moved by the error along the guard land on it too. Where they do not, an error decides on which side the run goes on.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import isfinite

from hsdsl.base.numbers.arithmetic import DOMAIN_ERRORS, Number
from hsdsl.base.numbers.enclosures import Range
from hsdsl.engine.execution import Arc, Transition
from hsdsl.engine.integrators.stepper import State
from hsdsl.engine.simulate.stops import show
from hsdsl.engine.simulate.verdict.agreement import SAFE
from hsdsl.engine.simulate.verdict.finding import Finding, times
from hsdsl.engine.simulate.verdict.input_jumps import indifferent, jumps_near
from hsdsl.engine.simulate.verdict.nearby import landed, landed_nearby, remembered_alike
from hsdsl.engine.simulate.verdict.place import ALONG, Place
from hsdsl.engine.simulate.verdict.run_view import RunView
from hsdsl.engine.simulate.verdict.screen import RESET_UNDECIDED
from hsdsl.engine.simulate.verdict.tangent import leaves_along

UNITS = 64  # of round-off, and less, are no jump
WIDER = 8  # boxes so many times as wide: what jumps is no wider over them


def landings(run: RunView) -> tuple[list[Finding], list[str]]:
    """Findings about the state that every arc of flow begins with, and about every reset."""
    if run.errors is None:
        return [], []
    found: list[Finding] = []
    for arc in run.undecided_flows("landing"):
        place = run.at_row(arc, arc.first)
        made = run.transitions[arc.jump - 1] if arc.jump else None
        for k in range(len(place.mode.edges) + len(place.mode.walls)):
            try:
                if not (run.followed and leaves_along(run, arc, k)):
                    found += _on(run, arc, place, k, made)
            except DOMAIN_ERRORS:
                continue  # `misses` says so along the arc
    for made in run.undecided_transitions(RESET_UNDECIDED):
        try:
            found += _continuous(run, made)
        except DOMAIN_ERRORS:
            continue
    return found, []


def _on(run: RunView, arc: Arc, place: Place, k: int, made: Transition | None) -> Iterator[Finding]:
    value, noise = place.value(k), place.roundoff_bound(k)
    where = f"the surface of {place.name(k)} at t = {show(place.t)}"
    conditional = k < len(place.mode.edges) and place.mode.edges[k].conditional
    if arc.first == 0:
        if abs(value) <= noise and not _decided_on(run, place, k, _soon(run, place, arc.first), run.tie(place.t)):
            how = "which has an `if`" if conditional else "to which the flow is tangent"
            yield Finding("start", "unknown", f"the run starts on {where}, {how}")
        return
    assert run.errors is not None
    shift, late = run.surface_error(place, k, arc.first), SAFE * run.errors.time_error_at(place.t)
    if made is None or _tied(run, made) or abs(value) > SAFE * shift + noise:
        return
    if place.rate(k) > place.rate_roundoff(k) and not conditional:
        return  # it is crossed at once, on either side of it
    error = run.safe_error(place, arc.first)
    if conditional and place.conditions(k, error, late) == {False}:
        return
    if conditional and place.rates_within(k, error, late).high <= 0:
        return  # nothing fires, on either side of it
    if not shift > 0 and _decided_on(run, place, k, error, late):
        return
    if _keeps(run, made, k, value):
        return
    on = abs(value) <= noise or not shift > 0
    away = f"on {where}" if on else f"{times(abs(value) / shift)} the error away from {where}"
    yield Finding("landing", "unknown", f"the reset of {made.edge} lands {away}")


def _decided_on(run: RunView, place: Place, k: int, error: State, late: Number) -> bool:
    """Whether it is sure what a state does that is known to be on surface k: fire, leave inwards, or stay."""
    conditional = k < len(place.mode.edges) and place.mode.edges[k].conditional
    holds = place.conditions(k, error, float(late)) if conditional else {True}
    rate = place.rates_within(k, error, float(late))
    if holds == {False} or rate.high < 0 or rate.low == rate.high == 0:
        return True
    return (rate.low > 0 and holds == {True}) or (conditional and rate.high <= 0)


def _soon(run: RunView, place: Place, row: int) -> State:
    """How far the state may be from a place within the tie tolerance, with its error and round-off."""
    slope, tie = place.kernel.flow(place.t, *place.x), run.tie(place.t)
    moved = zip(run.safe_error(place, row), place.x, slope, strict=True)
    return tuple(e + run.arithmetic.unit * abs(x) + abs(f) * tie for e, x, f in moved)


def _tied(run: RunView, made: Transition) -> bool:
    """Whether a transition follows, with no flow between, one that others were tied with: `choices` decides these."""
    return any(before.alternatives for before in run.cascade(made)[:-1])


def _keeps(run: RunView, made: Transition, k: int, value: Number) -> bool:
    """Whether states near the one before a transition, moved along its guard, land where surface k has its value.

    Of transitions without flow between them the first one's guard counts.
    """
    chain = run.cascade(made)
    before, edge = run.before(chain[0])
    if len(chain) == 1 and k == edge and made.target == made.source and _untouched(before, edge):
        return True
    here = landed(run, chain, before.x)
    for after in (near := landed_nearby(run, chain, run.safe_error(before, run.row_before(chain[0])))):
        slopes = after.kernel.gradients[k](after.t, *after.x)[1:]
        change = sum((abs(g * (a - b)) for g, a, b in zip(slopes, after.x, here.x, strict=True)), run.arithmetic.zero)
        if abs(after.value(k) - value) > ALONG * change + run.roundoff(after, k, run.row_before(made)):
            return False
    return bool(near)


def _untouched(place: Place, edge: int) -> bool:
    """Whether an affine surface depends on no state that its own reset changes."""
    slopes = place.kernel.gradients[edge](place.t, *place.x)[1:]
    rows = zip(place.mode.states, place.mode.edges[edge].reset_texts, slopes, strict=True)
    return place.mode.affine and all(text == name for name, text, slope in rows if slope)


def _continuous(run: RunView, made: Transition) -> Iterator[Finding]:
    """Whether the reset of a transition, and the inputs, are continuous around it."""
    assert run.errors is not None
    place, k = run.before(made)
    where = f"{made.edge} at t = {show(made.time)}"
    late = SAFE * run.errors.time_error_at(made.time)
    if any(not indifferent(run, place, k, sides, made) for sides in jumps_near(run, made.time, late)):
        yield Finding("input", "unknown", f"an input or function of time jumps within the error of the time of {where}")
    yield from smooth_reset(run, made)


def smooth_reset(run: RunView, made: Transition) -> Iterator[Finding]:
    """Whether the reset of a transition is continuous around it."""
    assert run.errors is not None
    place, k = run.before(made)
    if made.after is None or not place.mode.curved[k]:
        return
    late = SAFE * run.errors.time_error_at(made.time)
    error = run.safe_error(place, run.row_before(made))
    narrow, wide = (_spread(run, place, k, [n * e for e in error], n * late) for n in (1, WIDER))
    noise = _noise(run, place, k)
    least = [
        max(UNITS * float(run.arithmetic.unit) * abs(float(v)), n)
        for v, n in zip(made.after.values(), noise, strict=True)
    ]
    names = zip(made.after, narrow, least, wide, strict=True)
    jump = [name for name, a, b, c in names if not isfinite(a) or (a > b and c < a * WIDER / 2)]
    chain = run.cascade(made)
    first = run.safe_error(run.before(chain[0])[0], run.row_before(chain[0]))
    if jump and not remembered_alike(run, chain, jump, first):
        where = f"{made.edge} at t = {show(made.time)}"
        yield Finding("reset", "unknown", f"the reset of {where} jumps within the error")


def _noise(run: RunView, place: Place, k: int) -> list[float]:
    """What the enclosure of each result of a reset is wide at a point; 0 where it jumps within round-off of that."""
    wide, units = _spread(run, place, k, [0.0] * len(place.x), 0.0), UNITS * run.arithmetic.unit
    sizes = place.kernel.spreads[k](place.t, *place.x, *map(abs, place.x))
    moved = place.moved_by(tuple(units * abs(x) for x in place.x))
    results = zip(*(place.kernel.resets[k](place.t, *x) for x in moved), strict=True)
    apart = [max(r) - min(r) <= 4 * units * abs(size) for r, size in zip(results, sizes, strict=True)]
    return [2 * w if little else 0.0 for w, little in zip(wide, apart, strict=True)]


def _spread(run: RunView, place: Place, k: int, error: list[float], late: float) -> list[float]:
    """How far apart the results of a reset may be over a box around a place."""
    data = [Range(float(v), float(v)) for v in run.problem.timeline.at(place.t).data]
    kernel = run.problem.kernel.enclosing.bind(run.index(place.mode.name), data)
    box = [Range(float(a) - e, float(a) + e) for a, e in zip(place.x, error, strict=True)]
    results = kernel.resets[k](Range(float(place.t) - late, float(place.t) + late), *box)
    return [float(r.high - r.low) if isinstance(r, Range) else 0.0 for r in results]
