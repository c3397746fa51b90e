"""Surfaces that are almost reached: between rows, where an arc ends for another reason, and at the end of the run."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from itertools import pairwise

from hsdsl.arithmetic import DOMAIN_ERRORS, Number
from hsdsl.execution import Arc
from hsdsl.simulate.interpolation import BETWEEN
from hsdsl.simulate.stops import show
from hsdsl.simulate.verdict.choices import commute
from hsdsl.simulate.verdict.finding import Finding, times
from hsdsl.simulate.verdict.looking import Looking
from hsdsl.simulate.verdict.place import Place

MOST_ROWS = 1_000_000
FEW = 256  # rows of an arc: between those of a longer one a surface is taken to turn at most once
ROUNDS = 12  # of closing in on a turning point
TWICE = 2  # as long as it takes to reach a surface: reached together
STANDING = 1e-12  # relative to the sizes in a surface: a state that starts on it

Miss = tuple[Number, str, Number]  # how often the error fits in, the surface, the time


def misses(run: Looking) -> tuple[list[Finding], list[str]]:
    """Look at every surface along every arc."""
    if run.allowed is None:
        return [], []
    if len(run.times) > MOST_ROWS:
        sentence = f"near misses were not looked for in {len(run.times)} rows (at most {MOST_ROWS})"
        return [Finding("misses", "unknown", sentence)], []
    found: list[Finding] = []
    nearest: Miss | None = None
    for arc in run.flows:
        try:
            for finding, miss in _along(run, arc):
                if finding:
                    found.append(finding)
                if miss and (nearest is None or miss[0] < nearest[0]):
                    nearest = miss
        except DOMAIN_ERRORS:
            sentence = f"a surface of {arc.mode} has no value close to t = {show(run.times[arc.last])}"
            found.append(Finding("no value", "unknown", sentence))
    found += _at_the_end(run)
    if nearest is None:
        return found, []
    margin, name, t = nearest
    return found, [f"the nearest miss is of {name} at t = {show(t)}, by {times(margin)} the error"]


def _along(run: Looking, arc: Arc) -> Iterator[tuple[Finding | None, Miss | None]]:
    """Give what is found along one arc: findings, and how near surfaces came that turned back."""
    crossed = _crossed(run, arc)
    last_arc = arc is run.flows[-1] and crossed is None
    first, last = run.at_row(arc, arc.first), run.at_row(arc, arc.last)
    ends = list(run.surfaces_along(arc))
    if passed := _passed_over(run, arc, crossed, ends):
        yield passed, None
    for k, values in enumerate(zip(*ends, strict=True)):
        for i in _where_it_may_turn(values):
            row = arc.first + i
            if (k == crossed and row + 1 == arc.last) or values[i] > 0:
                continue
            rates = run.at_row(arc, row).rate(k), run.at_row(arc, row + 1).rate(k)
            if rates[0] > 0 >= rates[1]:
                yield _turned(run, arc, row, k, rates)
        for i in _where_it_rises(values) if _has_condition(first, k) else ():
            if not (k == crossed and arc.first + i + 1 == arc.last):
                yield _transparent(run, arc, arc.first + i, k, (values[i], values[i + 1])), None
        if not last_arc and k != crossed and values[-1] <= 0 < last.rate(k):
            yield _other(run, arc, last, k, crossed), None
        if values[0] <= 0 and first.rate(k) < 0:
            yield _start(run, arc, first, k), None


def _passed_over(run: Looking, arc: Arc, crossed: int | None, ends: Sequence[Sequence[Number]]) -> Finding | None:
    """A visit beyond a surface inside a step, seen at three points of each step, in long arcs at one.

    The relaxed scheme looks at the ends of steps, the located one at so many pieces of a surface and no more.
    """
    relaxation = run.run.settings.relaxation
    for i in range(len(ends) - 1):
        look, last = run.between(arc, arc.first + i), arc.first + i + 1 == arc.last
        for part in BETWEEN if len(ends) <= FEW else (BETWEEN[i % len(BETWEEN)],):
            place = look(run.arithmetic.constant(part))
            for k, value in enumerate(place.kernel.surfaces(place.t, *place.x)):
                if value <= 0 or ends[i][k] > 0 or ends[i + 1][k] > 0 or (last and k == crossed):
                    continue
                slopes = place.kernel.gradients[k](place.t, *place.x)
                level = TWICE * relaxation * sum((abs(g) for g in slopes), value * 0) + place.noise(k)
                if value > level and not _has_condition(place, k):
                    sentence = (
                        f"inside a step, at t = {show(place.t)}, the run is beyond the surface of {place.name(k)}"
                    )
                    return Finding("passed over", "unknown", f"{sentence}: transitions were passed over")
    return None


def _where_it_may_turn(values: Sequence[Number]) -> Iterator[int]:
    """Give the steps in which a surface may have a largest value: all of few, of many those at a peak of the rows."""
    last = len(values) - 2
    for i in range(last + 1):
        rises = i == 0 or values[i] >= values[i - 1]
        if len(values) <= FEW or (rises and (i == last or values[i + 1] >= values[i + 2])):
            yield i


def _where_it_rises(values: Sequence[Number]) -> Iterator[int]:
    """Give the steps in which a surface rises through zero."""
    return (i for i, (low, high) in enumerate(pairwise(values)) if low <= 0 < high)


def _crossed(run: Looking, arc: Arc) -> int | None:
    """The surface whose transition ends an arc."""
    if arc.jump >= len(run.transitions):
        return None
    made = run.transitions[arc.jump]
    if made.time > run.times[arc.last] + run.tie(made.time):
        return None  # the arc ends at a sample of an input
    return [edge.name for edge in run.at_row(arc, arc.last).mode.edges].index(made.edge)


def _turned(
    run: Looking, arc: Arc, row: int, k: int, rates: tuple[Number, Number]
) -> tuple[Finding | None, Miss | None]:
    """A surface that rises and falls again within a step."""
    place = _closed_in(run.between(arc, row), lambda place: -place.rate(k), (-rates[0], -rates[1]))
    return _judged(run, place, k, row + 1, "turns back close to")


def _closed_in(look: Callable[[Number], Place], of: Callable[[Place], Number], ends: tuple[Number, Number]) -> Place:
    """Close in on where a rising function of the place is zero (regula falsi, Illinois)."""
    (low, high), a = ends, ends[0] * 0
    b = a + 1
    place = look(b)
    for _ in range(ROUNDS):
        if not low < high:
            break
        s = a - low * (b - a) / (high - low)
        place = look(s)
        f = of(place)
        if f <= 0:
            a, low, high = s, f, high / 2
        else:
            b, high, low = s, f, low / 2
    return place


def _has_condition(place: Place, k: int) -> bool:
    return k < len(place.mode.edges) and place.mode.edges[k].conditional


def _judged(run: Looking, place: Place, k: int, row: int, how: str) -> tuple[Finding | None, Miss | None]:
    shift, error = run.shift(place, k, row), run.error(place, row)
    if shift is None or error is None:
        return None, None
    below = -place.value(k)
    if below <= place.noise(k) and below >= 0 and not shift > 0:
        return None, None
    if _has_condition(place, k) and place.conditions(k, error) == {False}:
        return None, None
    if below < 0 and not _has_condition(place, k):
        below = -below  # beyond, within what the run counts as the surface
    margin = below / shift if shift > 0 else run.arithmetic.zero + float("inf")
    name = place.name(k)
    miss: Miss = (margin, name, place.t)
    if margin >= run.safe:
        return None, miss
    sentence = f"the run {how} the surface of {name} at t = {show(place.t)}, {times(margin)} the error away"
    return Finding("miss", "unknown", sentence), miss


def _transparent(run: Looking, arc: Arc, row: int, k: int, ends: tuple[Number, Number]) -> Finding | None:
    """A surface passed where its condition does not hold: does it all around?"""
    place = _closed_in(run.between(arc, row), lambda place: place.value(k), ends)
    error = run.error(place, row + 1)
    if error is None or place.conditions(k, error) == {False}:
        return None
    where = f"{place.name(k)} at t = {show(place.t)}"
    return Finding("condition", "unknown", f"whether the condition of {where} holds is within the error")


def _other(run: Looking, arc: Arc, place: Place, k: int, crossed: int | None) -> Finding | None:
    """A surface about to be reached where another one is crossed: their order may be an error's doing."""
    finding, _ = _judged(run, place, k, arc.last, "is about to reach")
    if finding is None or crossed is None or k >= len(place.mode.edges):
        return None
    if commute(run, place, (crossed, k), TWICE * -place.value(k) / place.rate(k)):
        return None
    sentence = f"the order of {place.name(crossed)} and {place.name(k)} at t = {show(place.t)} is within the error"
    return Finding("order", "unknown", f"{sentence}, and it matters")


def _start(run: Looking, arc: Arc, place: Place, k: int) -> Finding | None:
    """A surface that an arc starts close to, moving away; one that it starts on exactly is left for good."""
    gradient = place.kernel.gradients[k](place.t, *place.x)
    size = place.kernel.magnitudes(place.t, *place.x)[k]
    size = size + sum((abs(g) * (1 + abs(a)) for g, a in zip(gradient[1:], place.x, strict=True)), size * 0)
    if arc.first == 0 or abs(place.value(k)) <= STANDING * size:
        return None
    return _judged(run, place, k, arc.first, "starts close to")[0]


def _at_the_end(run: Looking) -> Iterator[Finding]:
    """Surfaces that would be reached just behind the end, and a transition just before it."""
    if run.stop.reason != "until" or not run.flows:
        return
    arc, until = run.flows[-1], run.times[-1]
    place = run.at_row(arc, arc.last)
    if run.times[arc.last] == until:
        for k in range(len(place.mode.edges)):
            try:
                if place.rate(k) > 0 and _judged(run, place, k, arc.last, "ends at")[0]:
                    yield Finding("end", "unknown", _undecided(place.name(k)))
            except DOMAIN_ERRORS:
                continue
    if run.transitions:
        made = run.transitions[-1]
        place = run.place(made.source, made.time, tuple(made.before.values()))
        k = [edge.name for edge in place.mode.edges].index(made.edge)
        try:
            shift, rate = run.shift(place, k, run.row_at(made.time)), place.rate(k)
        except DOMAIN_ERRORS:  # `crossings` has said so
            return
        if shift is not None and (until - made.time) * rate < run.safe * shift:
            yield Finding("end", "unknown", _undecided(made.edge))


def _undecided(name: str) -> str:
    return f"a transition of {name} within the error of the end is undecided: the end is too close to it"
