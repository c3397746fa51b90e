"""Settings of the same run made finer: the difference of the two runs estimates the error of the first.

The tolerance falls to a tenth, so the finer run is wrong by about a tenth of what the run is. Steps that the tolerance
does not bound become shorter in the same way: the run's longest step, and with `located` the first one of each arc of
flow, which a transition or a sample of an input may have cut. A fixed step becomes two fifths of
itself; a method of order 1 needs a fifth, or the difference would be no larger than the error of the finer run. It is
no half: steps that the relaxed scheme halves would be those of the finer run, and both wrong in the same way. The
relaxed scheme's strips shrink to a tenth: the delay of a transition is known only up to a factor. Below round-off the
other run is coarser instead, and the difference is that much larger than the error. What both runs would round alike
moves the finer one (`moving`).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hsdsl.base.numbers.arithmetic import Arithmetic, Number
from hsdsl.engine.execution import Execution
from hsdsl.engine.simulate.settings import Settings

FINER = 10
LEAST_UNITS = 32  # of round-off: a tolerance that a finer run may still have


def longest_steps(execution: Execution) -> list[Number]:
    """The longest step of each arc of flow."""
    table = execution.arc_table
    steps = np.append(np.diff(execution.times), 0)
    return np.maximum.reduceat(steps, table.first)[table.kind == "flow"].tolist() if len(table.first) else []


def finer_settings(settings: Settings, execution: Execution, arithmetic: Arithmetic) -> Settings:
    """Return the settings of the run to compare an execution with."""
    finer = replace(settings, moves=True)
    if settings.scheme != "located":
        finer = replace(finer, relaxation=settings.relaxation / FINER)
    if settings.step is not None:
        first = settings.method is not None and settings.method.order == 1
        return replace(finer, step=settings.step * (1 if first else 2) / 5)
    assert settings.tolerance is not None
    smaller = settings.tolerance / FINER
    tolerance = smaller if smaller >= LEAST_UNITS * arithmetic.unit else settings.tolerance * FINER
    method = settings.method
    assert method is not None
    share = float(FINER) ** (-1 / method.order)
    bounds = [share * step for step in longest_steps(execution)]
    finer = replace(finer, longest_step=max(bounds, default=0) or None)
    if settings.scheme == "located":
        finer = replace(finer, first_steps=bounds)
    return replace(finer, tolerance=tolerance, method=method.for_tolerance(tolerance, arithmetic))
