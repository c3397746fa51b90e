"""Arcs that leave a surface tangentially, as where sliding or motion along a guard ends.

The theorem has no such landing. Derivatives exist all the same where executions from nearby leave the surface too: they
reach it with the value zero and the rate zero, as states of a motion along it do that its end releases.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise

from hsdsl.base.numbers.arithmetic import DOMAIN_ERRORS, Number
from hsdsl.engine.execution import Arc, Transition
from hsdsl.engine.integrators.stepper import State
from hsdsl.engine.simulate.verdict.place import ALONG, GUARD_ROUNDS, Place
from hsdsl.engine.simulate.verdict.run_view import RunView


def leaves_along(run: RunView, arc: Arc, k: int) -> bool:
    """Whether an arc and all from nearby begin on surface k of their mode, at the rate zero, and then fall below it."""
    if not arc.jump or run.errors is None:
        return False
    made, place = run.transitions[arc.jump - 1], run.at_row(arc, arc.first)
    try:
        if abs(place.value(k)) > place.roundoff_bound(k) or not _falls(run, arc, k):
            return False
        before, edge = run.before(made)
        error = run.safe_error(before, run.row_before(made))
        near = [_landed(run, made, x) for x in before.moved_by(error)]
        value, rate = (ALONG * max(abs(each(at)) for at in near) for each in (_value(k), _rate(k)))
        for x in before.along_guard(edge, error):
            if _kept(run, made, k):
                x = _onto(run, made, k, x)
            at = _landed(run, made, x)
            if abs(at.value(k)) > value + at.roundoff_bound(k) or abs(at.rate(k)) > rate + at.rate_roundoff(k):
                return False
        return True
    except DOMAIN_ERRORS:
        return False


def _value(k: int) -> Callable[[Place], Number]:
    return lambda place: place.value(k)


def _rate(k: int) -> Callable[[Place], Number]:
    return lambda place: place.rate(k)


def _falls(run: RunView, arc: Arc, k: int) -> bool:
    """Whether the surface falls on the first step of an arc, ever faster at first."""
    along = run.dense_output(arc, arc.first)
    shares = [run.arithmetic.zero + 2.0**-i for i in range(20, 2, -1)]
    rates = [along(share).rate(k) for share in shares]
    return all(b < a < 0 for a, b in pairwise(rates))


def _kept(run: RunView, made: Transition, k: int) -> bool:
    """Whether a transition leaves a mode that, from nearby too, is entered on surface k of its target, and keeps it."""
    _, edge = run.before(made)
    arc = next(arc for arc in reversed(run.flows) if arc.jump <= made.index)
    if not arc.jump or run.crossed.get(arc.last) != edge or not _keeps(run, made, k):
        return False
    earlier = run.transitions[arc.jump - 1]
    entered, by = run.before(earlier)
    for x in entered.along_guard(by, run.safe_error(entered, run.row_before(earlier))):
        seen = _seen(run, made, earlier.time, _landed(run, earlier, x).x)
        if seen is None or abs(seen.value(k)) > seen.roundoff_bound(k):
            return False
    return True


def _keeps(run: RunView, made: Transition, k: int) -> bool:
    """Whether the flow of the mode that a transition leaves keeps surface k of its target, around it too."""
    before, _ = run.before(made)
    for x in before.moved_by(tuple(map(abs, before.x))):
        seen = _seen(run, made, made.time, x)
        if seen is None:
            return False
        flow = dict(zip(before.mode.states, before.kernel.flow(made.time, *x), strict=True))
        gradient = seen.kernel.gradients[k](made.time, *seen.x)
        terms = [gradient[0], *(g * flow[name] for g, name in zip(gradient[1:], seen.mode.states, strict=True))]
        if abs(sum(terms)) > ALONG * ALONG * max(abs(term) for term in terms):
            return False
    return True


def _onto(run: RunView, made: Transition, k: int, x: State) -> State:
    """A state of the mode that a transition leaves, taken to surface k of its target and, along that, to its guard."""
    before, edge = run.before(made)
    for _ in range(GUARD_ROUNDS):
        seen = _seen(run, made, made.time, x)
        assert seen is not None
        named = dict(zip(seen.mode.states, seen.kernel.gradients[k](made.time, *seen.x)[1:], strict=True))
        one = [named.get(name, 0) for name in before.mode.states]
        x = _moved(x, one, seen.value(k))
        other = before.kernel.gradients[edge](made.time, *x)[1:]
        x = _moved(x, _moved(other, one, _dot(other, one)), before.kernel.surfaces(made.time, *x)[edge])
    return x


def _moved(x: Sequence[Number], along: Sequence[Number], value: Number) -> State:
    """A point moved along a direction, by what takes something linear with this slope from a value to zero."""
    size = _dot(along, along)
    return tuple(a - value * g / size for a, g in zip(x, along, strict=True)) if size > 0 else tuple(x)


def _dot(one: Sequence[Number], other: Sequence[Number]) -> Number:
    return sum(a * b for a, b in zip(one, other, strict=True))


def _seen(run: RunView, made: Transition, t: Number, x: State) -> Place | None:
    """A state of the mode that a transition leaves, as one of its target, by name; None where that has others."""
    named = dict(zip(run.problem.program.modes[run.index(made.source)].states, x, strict=True))
    names = run.problem.program.modes[run.index(made.target)].states
    return run.place(made.target, t, tuple(named[name] for name in names)) if named.keys() >= set(names) else None


def _landed(run: RunView, made: Transition, x: State) -> Place:
    return run.place(made.target, made.time, run.landed(made, run.tails_before(made).copy(), x))
