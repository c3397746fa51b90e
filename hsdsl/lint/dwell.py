# pyright: basic
"""How long a run is likely to stay in a mode, and how often it is likely to leave one: first estimates, for notes."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import reduce
from itertools import islice, pairwise
from typing import Any

import sympy as sp

from hsdsl.expression import numeric
from hsdsl.lint.numbers import Number, evaluate
from hsdsl.lint.subject import Subject
from hsdsl.schema import ReferenceDocument
from hsdsl.source import Scalar
from hsdsl.system import Edge

MOST_EDGES = 50  # whose landings are looked at: an estimate needs no more
_LARGEST = 200  # operations of a surface, a rate or a reset that is looked at
_TIE = 1e-9


@dataclass(frozen=True)
class Pace:
    """Times between transitions.

    Attributes
    ----------
    shortest : number
        The shortest time between two transitions that are not simultaneous.
    count : number
        How many transitions a run of the file is likely to make.
    known : bool
        Whether a `reference` says so, and not an estimate.
    """

    shortest: Number
    count: Number
    known: bool


def pace(subject: Subject) -> Pace | None:
    """Times between transitions, from the reference where there is one, else from distances and speeds.

    The estimate is made where each reset lands, with the values of the start for what the guard leaves open: the
    distance to each surface of the next mode, divided by the speed of the flow towards it there.
    """
    until = subject.setting("until")
    if not numeric.finite(until) or until <= 0:
        return None
    from_references = [found for item in subject.document.reference if (found := _of_reference(subject, item, until))]
    if from_references:
        return min(from_references, key=lambda found: found.shortest)
    edges = (part.edge for mode in subject.modes if mode.mode.name in subject.reachable for part in mode.edges)
    stays = [stay for edge in islice(edges, MOST_EDGES) if (stay := _stay(subject, edge)) is not None]
    if not stays:
        return None
    return Pace(min(stays), until * len(stays) / sum(stays), False)


def _of_reference(subject: Subject, reference: ReferenceDocument, until: Number) -> Pace | None:
    events = [event if isinstance(event, Scalar) else event.time for event in reference.transitions]
    times = [time for time in map(subject.read, events) if numeric.finite(time)]
    gaps = [after - before for before, after in pairwise(times) if after - before > _TIE * max(until, abs(after))]
    return Pace(min(gaps), max(1, until / times[-1]) * len(times), True) if gaps else None


def _stay(subject: Subject, edge: Edge) -> Number | None:
    """The likely time in the target of an edge, until the first of its own edges."""
    return min(_times(subject, edge), default=None)


def _times(subject: Subject, edge: Edge) -> Iterator[Number]:
    dynamics = subject.dynamics
    point = _landing(subject, edge)
    target = dynamics.modes[edge.target]
    for after in target.edges:
        residual = dynamics.residual(after.surface)
        rate = dynamics.rate(target, residual)
        if rate is None or _large(residual) or _large(rate):
            continue
        distance, speed = (evaluate(dynamics.carried(e, edge), point) for e in (residual, rate))
        if numeric.finite(distance) and numeric.finite(speed) and distance < 0 < speed:
            yield -distance * numeric.inverse(speed)


def _landing(subject: Subject, edge: Edge) -> dict[Any, Number]:
    """A point on the surface of an edge: where the run starts, but for one state that the surface determines."""
    point = {s: v for s, v in subject.start.items() if numeric.finite(v)}
    residual = subject.dynamics.residual(edge.surface)
    if not _large(residual):
        for state in sorted(residual.free_symbols, key=lambda s: s.name):
            slope = residual.diff(state)
            if slope.is_number and slope != 0:
                here = evaluate(residual, {**point, state: numeric.of_rational(sp.S.Zero)})
                point[state] = -here * numeric.inverse(evaluate(slope, {}))
                return point
    return point


def _large(expr: Any) -> bool:
    return reduce(lambda count, _: count + 1, islice(sp.preorder_traversal(expr), _LARGEST + 1), 0) > _LARGEST
