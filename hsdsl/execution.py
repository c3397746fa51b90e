"""An execution: what a run produced, as frozen columnar data in hybrid time (t, j).

An execution is a sequence of arcs. In a *flow* arc the state follows the mode's vector field; in a *strip* arc it
waits on the relaxed guard (Burden et al. 2013, Def. 14) while ``depth`` runs from 0 to the relaxation. At a jump the
state has two values: the last row of one arc and the first row of the next, both at the same time. ``jump`` (the j of
hybrid time) counts the transitions made so far; a strip belongs to the mode and the j before its transition. A jump of
an input also ends an arc (j and mode go on).

The columns, with N rows, A arcs, W states in the largest mode and K outputs:

============== ============== =================================================================================
times          (N,)           time of the row, never decreasing
values         (N, W)         states in the order of the arc's ``states``, NaN beyond them
outputs        (N, K)         outputs, NaN where the mode lacks a state the output needs
depth          (N,)           0 in flow arcs; how deep in the strip otherwise
coefficients   (N, P, W)      the piece from row k to row k+1 of one arc is
                              x_k + sum_{m=1..P} c_m s^m, s in [0, 1]; unused in an arc's last row.
                              P = 0: the piece is the straight line between the rows
arcs           A x Arc        first and last row (inclusive), mode, states, kind, jump
============== ============== =================================================================================

Numbers are float64, or objects (mpmath) for a run at higher precision.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[Any]


@dataclass(frozen=True)
class Arc:
    """Rows ``first..last`` (inclusive) of an execution, in one mode, with one jump counter."""

    mode: str
    states: tuple[str, ...]
    kind: Literal["flow", "strip"]
    jump: int
    first: int
    last: int


@dataclass(frozen=True)
class Transition:
    """One transition.

    ``time`` is when the guard was reached and ``resumed`` when flow went on (None when the run ended in the strip, and
    then ``after`` is None too). ``alternatives`` are the edges that were reached within the tie tolerance and passed
    over. ``entry`` says that it fired at once because the state entered its mode beyond the surface.
    """

    index: int
    time: Any
    resumed: Any | None
    edge: str
    source: str
    target: str
    before: dict[str, Any]
    after: dict[str, Any] | None
    alternatives: tuple[str, ...]
    entry: bool = False


@dataclass(frozen=True)
class Stop:
    """Why and when a run ended: ``reason`` is one word of :data:`REASONS`, ``message`` a sentence for a person."""

    reason: str
    time: Any
    message: str

    @property
    def complete(self) -> bool:
        """Whether the run got to where it was going (exit code 0)."""
        return self.reason in ("until", "final")


REASONS = (
    "until",
    "final",
    "left_domain",
    "zeno",
    "transition_limit",
    "not_finite",
    "step_underflow",
    "interrupted",
)


@dataclass(frozen=True)
class Verdict:
    """What can be said about the theorem's hypotheses for this run: ``holds``, ``left`` or ``unknown``."""

    theorem: Literal["holds", "left", "unknown"]
    reasons: tuple[str, ...]


@dataclass(frozen=True)
class Point:
    """The value of an execution at one time. ``state`` and ``outputs`` are by name; indexing finds either."""

    time: Any
    mode: str
    jump: int
    kind: Literal["flow", "strip"]
    state: dict[str, Any]
    outputs: dict[str, Any]

    def __getitem__(self, name: str) -> Any:
        return self.state[name] if name in self.state else self.outputs[name]


@dataclass(frozen=True)
class Execution:
    """A run's result; see the module's docstring for the arrays."""

    model: str
    digest: str
    engine: str
    scheme: str
    method: str
    settings: dict[str, Any]
    stop: Stop
    transitions: tuple[Transition, ...]
    final: Point
    verdict: Verdict
    output_names: tuple[str, ...]
    times: Array
    values: Array
    outputs: Array
    depth: Array
    coefficients: Array
    arcs: tuple[Arc, ...]
    seconds: dict[str, float]
    digits: int | None = None  # decimal digits of the numbers, None for float64

    def __post_init__(self) -> None:
        n = len(self.times)
        if not (len(self.values) == len(self.outputs) == len(self.depth) == len(self.coefficients) == n):
            raise ValueError("columns differ in length")
        if self.stop.reason not in REASONS:
            raise ValueError(f"unknown stop reason {self.stop.reason}")
        if not self.arcs or self.arcs[0].first != 0 or self.arcs[-1].last != n - 1:
            raise ValueError("arcs must cover the rows")
        if any(b.first != a.last + 1 for a, b in zip(self.arcs, self.arcs[1:], strict=False)):
            raise ValueError("arcs must follow each other")
        if n > 1 and bool(np.any(self.times[1:] < self.times[:-1])):
            raise ValueError("time must not run backwards")
