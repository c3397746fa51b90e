# pyright: basic
"""Points of surfaces that the flow passes: where a transition fires, and where none does, because no `if` holds."""

from __future__ import annotations

from collections.abc import Sequence

from hsdsl.lint.analysis.dynamics import Clause, Dynamics
from hsdsl.lint.analysis.mode_point import ModePoint, Unsure
from hsdsl.lint.analysis.proof import strict
from hsdsl.lint.analysis.question import UNKNOWN, Answer, Constraint, positive, zero
from hsdsl.system import Edge


def fires(dynamics: Dynamics, edge: Edge, *more: Constraint) -> Answer:
    """A point of an edge's guard with more constraints, through which the flow goes; inside all else if possible."""
    return _passed(dynamics, edge, dynamics.condition(edge), more)


def passes_by(dynamics: Dynamics, edge: Edge) -> Answer:
    """A point of an edge's surface that the flow goes through where no edge of that surface has an `if` that holds."""
    residual = dynamics.residual(edge.surface)
    alternatives: list[Clause] = [()]
    for other in dynamics.modes[edge.source].edges:
        if dynamics.residual(other.surface) == residual:
            refused = dynamics.condition(other, holds=False)
            if refused is None:
                return UNKNOWN
            alternatives = [(*before, *clause) for before in alternatives for clause in refused]
    return _passed(dynamics, edge, alternatives, ())


def _passed(
    dynamics: Dynamics, edge: Edge, conditions: Sequence[Clause] | None, more: tuple[Constraint, ...]
) -> Answer:
    mode, residual = dynamics.modes[edge.source], dynamics.residual(edge.surface)
    rate = dynamics.rate(mode, residual)
    domain = dynamics.domain(mode, without=edge)
    if rate is None or conditions is None:
        return UNKNOWN
    out = () if rate.is_zero else (positive(rate),)
    for inside in (strict(domain), domain):
        for speed in dict.fromkeys((out, ())):
            clauses = [(zero(residual), *inside, *speed, *clause) for clause in conditions]
            answer = dynamics.ask_any(mode, clauses, *more)
            if answer.somewhere and _goes_out(ModePoint(dynamics, mode, answer.point), edge):
                return answer
    return UNKNOWN


def _goes_out(here: ModePoint, edge: Edge) -> bool:
    """Whether the flow goes out of the surface of an edge, and into all else that the point lies on."""
    domain = here.dynamics.domain(here.mode, without=edge)
    try:
        inside = all(here.sign(c.expr) < 0 or here.first(c.expr)[1] < 0 for c in domain)
        return inside and here.first(here.dynamics.residual(edge.surface))[1] > 0
    except Unsure:
        return False
