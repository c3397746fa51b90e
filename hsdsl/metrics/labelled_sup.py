"""Distances on the space of trajectories, for comparison: they see the mode, and stay away from zero at a jump.

All of them take the states of a hybrid system with the discrete metric on modes (Tavernini 1987; Gokhman 2008):

    D((i, x), (j, y)) = |x - y| + [i != j],

states compared by name, one that a mode lacks counting as 0 there: D is a metric also where modes have different
states. A strip's point (z, tau) counts as z in its mode.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hsdsl.execution import Execution
from hsdsl.metrics.bernstein import largest_norm, length
from hsdsl.metrics.budget import Budget
from hsdsl.metrics.curves import GAP, CurveDistance, curve_distance, merged, no_distance, rounding_of
from hsdsl.metrics.merge import Side
from hsdsl.metrics.rounding import UNIT
from hsdsl.metrics.supremum import supremum
from hsdsl.metrics.trace import Array

EVALUATIONS = 50_000


@dataclass(frozen=True)
class Labelled:
    """The distance D of states with modes."""

    def over(self, a: Side, b: Side) -> Array:
        """Bound by the difference of the two polynomials."""
        return largest_norm(a.powers - b.powers) + (a.mode != b.mode) + a.doubt + b.doubt

    def at(self, a: Side, b: Side, end: int, times: Array, enough: float = 0.0) -> tuple[Array, Array]:
        """Return D, less or more than rounding."""
        difference = a.at_end(end) - b.at_end(end)
        states = np.sqrt(np.sum(difference**2, axis=1))
        apart = states + (a.mode != b.mode)
        doubt = a.doubt + b.doubt + (difference.shape[1] + 4) * UNIT * states
        return np.maximum(0.0, apart - doubt), apart + doubt

    def motion(self, side: Side) -> Array:
        """Bound the way by the length of the control polygon."""
        return length(side.powers) + side.stray


def sup_norm(a: Execution, b: Execution, gap: float = GAP) -> CurveDistance:
    """Return the supremum over the common time span of D between two runs at the same time, to a relative gap."""
    cells = merged(a, b)
    if cells.same:
        return no_distance(cells, "sup")
    budget = Budget()
    found = supremum(cells, Labelled(), gap, rounding_of(cells.a, cells.b), EVALUATIONS, budget)
    return curve_distance(found, cells, a, b, "sup", gap, budget)
