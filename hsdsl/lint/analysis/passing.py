# pyright: basic
"""Surfaces that can be passed without a transition, because no `if` holds there."""

from __future__ import annotations

from hsdsl.lint.analysis.dynamics import Clause, Dynamics
from hsdsl.lint.analysis.question import UNKNOWN, Answer, at_most_zero, zero
from hsdsl.system import Edge


def passes_by(dynamics: Dynamics, edge: Edge) -> Answer:
    """Whether there is a point of an edge's surface where the flow goes out and no edge of that surface fires."""
    mode = dynamics.modes[edge.source]
    residual = dynamics.residual(edge.surface)
    rate = dynamics.rate(mode, residual)
    base = (zero(residual), *dynamics.domain(mode, without=edge), *(() if rate is None else (at_most_zero(-rate),)))
    alternatives: list[Clause] = [base]
    for other in mode.edges:
        if dynamics.residual(other.surface) == residual:
            refused = dynamics.condition(other, holds=False)
            if refused is None:
                return UNKNOWN
            alternatives = [(*before, *clause) for before in alternatives for clause in refused]
    return dynamics.ask_any(mode, alternatives)
