"""An execution: the result of a run, as frozen columnar data in hybrid time (t, j).

An execution is a sequence of arcs. In a *flow* arc the state follows the mode's vector field; in a *strip*
arc it is constant on the relaxed guard (Burden et al. 2013, Def. 14), and ``depth`` rises from 0 to the relaxation.
At a jump the state has two values: the last row of one arc and the first row of the next, both at the same
time. ``jump`` (the j of hybrid time) counts the transitions so far; a strip has the mode and the j before its
transition. A jump of an input also ends an arc (j and mode stay). An arc of one row has no duration: it is between
transitions at one instant, or at the entry to a final mode.

The columns, with N rows, A arcs, W states in the largest mode and K outputs:

============== ============== ===============================================================================
times          (N,)           time of the row, never decreasing
values         (N, W)         states in the order of the arc's ``states``, NaN beyond them
outputs        (N, K)         outputs, NaN if the mode does not define the output
depth          (N,)           0 in flow arcs; otherwise the depth in the strip
coefficients   (N, P, W)      the piece from row k to row k+1 of one flow arc is
                              x_k + sum_{m=1..P} c_m s^m, s in [0, 1]; unused in an arc's last row and in
                              strips. P = 0: the piece is the straight line between the rows
arcs           A x Arc        first and last row (inclusive), mode, states, kind, jump
============== ============== ===============================================================================

Numbers are float64, or objects (mpmath) for a run at higher precision.
"""

from hsdsl.engine.execution.ensemble import Ensemble, Failure, TransitionTable
from hsdsl.engine.execution.records import (
    COMPLETE,
    HYBRID_TIME,
    INCOMPLETE,
    LEFT,
    REASONS,
    Arc,
    Array,
    Kind,
    Point,
    RunWarning,
    Samples,
    Stop,
    Transition,
    Verdict,
)
from hsdsl.engine.execution.run import Evaluated, Execution, OutputFunction, Sampler, Side

__all__ = [
    "COMPLETE", "HYBRID_TIME", "INCOMPLETE", "LEFT", "REASONS", "Arc", "Array", "Ensemble", "Evaluated", "Execution",
    "Failure", "Kind", "OutputFunction", "Point", "RunWarning", "Sampler", "Samples", "Side", "Stop", "Transition",
    "TransitionTable", "Verdict",
]  # fmt: skip
