"""The last flights of a run, and whether they shrink: of an edge that leads back, or of edges that take turns (M11)."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

from hsdsl.base.numbers.arithmetic import Number
from hsdsl.engine.execution import Transition
from hsdsl.engine.simulate.diagnostics import FREE

LEAST_FLIGHTS = 3


def contraction(made: Sequence[Transition], of_flow: bool = False) -> tuple[Number, Number] | None:
    """The same of the last few flights, of rounds or of the last edge."""
    return shrinking(round_flights(made) or last_flights(made, of_flow))


def shrinking(flights: Sequence[Number]) -> tuple[Number, Number] | None:
    """Return the last flight and the largest ratio of some in a row, if they shrink; else None."""
    if not flights or not min(flights) > 0:
        return None
    ratio = max(b / a for a, b in pairwise(flights))
    return (flights[-1], ratio) if ratio < 1 else None


def period(made: Sequence[Transition]) -> int:
    """After how many transitions those of the last few rounds repeat; 0 where they do not, on entry or in strips."""
    for n in range(1, (FREE - 1) // LEAST_FLIGHTS + 1):
        last = made[-LEAST_FLIGHTS * n - 1 :]
        if len(last) <= LEAST_FLIGHTS * n:
            return 0
        if all(a.edge == b.edge and a.source == b.source for a, b in zip(last, last[n:], strict=False)):
            return 0 if any(one.entry or one.resumed != one.time for one in last) else n
    return 0


def round_flights(made: Sequence[Transition]) -> list[Number]:
    """How long the last few rounds of edges that take turns lasted, in order; none where fewer than two do."""
    n = period(made)
    times = [one.time for one in made[-LEAST_FLIGHTS * n - 1 :: n]] if n > 1 else []
    return [b - a for a, b in pairwise(times)]


def last_flights(made: Sequence[Transition], of_flow: bool = False) -> list[Number]:
    """The last few flights between transitions of the last edge, in order; none where they are not as many.

    That is the last one that was reached: what it set off is no edge of a tail. Other edges that lead back to the same
    mode may fire meanwhile, also as entries; :data:`FREE` transitions are looked at. Where they are ``of_flow`` time in
    strips does not count.
    """
    times: list[Number] = []
    waited = made[-1].time * 0
    last = next((one for one in reversed(made[-FREE:]) if not one.entry), made[-1])
    for one in reversed(made[-FREE:]):
        if one.source != last.source or one.source != one.target or (one.entry and one.edge == last.edge):
            break
        if of_flow and times and one.resumed is not None:
            waited = waited + (one.resumed - one.time)
        if one.edge == last.edge:
            times.append(one.time + waited)
        if len(times) > LEAST_FLIGHTS:
            break
    return [a - b for a, b in pairwise(times)][::-1] if len(times) > LEAST_FLIGHTS else []


def flown(made: Sequence[Transition], t: Number) -> Number:
    """The time of flow since the first of some transitions, without that in strips."""
    found = t - made[0].time
    for one in made:
        found = found - (one.resumed - one.time if one.resumed is not None else 0)
    return found
