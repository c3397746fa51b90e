# pyright: basic
"""One state of a mode at two times: a question about both."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import sympy as sp

from hsdsl.lint.analysis.dynamics import Clause, Dynamics
from hsdsl.lint.analysis.question import UNKNOWN, Answer, Constraint
from hsdsl.lower.straight import replaced
from hsdsl.system import TIME, Mode


def twice(
    dynamics: Dynamics, mode: Mode, alternatives: Sequence[Clause], once: Constraint, again: Constraint
) -> tuple[Answer, Mapping[Any, float]]:
    """Look for a state where one constraint holds at one time and another one at another, and an alternative at both.

    Returns the state with the first time and inputs, and the time and the inputs of the second.
    """
    copies, ranges = dynamics.remembered(("twice", mode.name), lambda: _copies(dynamics, mode))
    for clause in alternatives:
        later = tuple(c.along(replaced(c.expr, copies, {})) for c in (*clause, again))
        answer = dynamics.decider.decide(tuple(dict.fromkeys((*clause, once, *later))), ranges)
        if answer.somewhere:
            return answer, {name: answer.point[copy] for name, copy in copies.items()}
    return UNKNOWN, {}


def _copies(dynamics: Dynamics, mode: Mode) -> tuple[dict[Any, Any], dict[Any, Any]]:
    copies = {s: sp.Dummy(s.name, real=True) for s in (*sorted(dynamics.inputs, key=str), TIME)}
    ranges = dynamics.ranges(mode)
    return copies, {**ranges, **{copy: ranges[s] for s, copy in copies.items()}}
