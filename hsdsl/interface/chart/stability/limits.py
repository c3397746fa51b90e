"""Known limits of linear stability: the largest step at which a method damps what a linear flow damps.

A Runge-Kutta method multiplies the solution of x' = lambda x by R(h lambda) in a step, with its stability function
R(z) = 1 + z b (1 - z A)^-1 1 (Hairer and Wanner 1996, Def. IV.2.1), a polynomial for an explicit method. It is stable
at h where |R(h lambda)| <= 1 for every eigenvalue lambda of the flow that does not grow.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction
from typing import Any

import numpy as np

from hsdsl.base.errors import UsageError
from hsdsl.engine.execution import Array
from hsdsl.engine.integrators import METHODS, ButcherTableau
from hsdsl.interface.model import Model

STEPS = 400  # on a logarithmic scale, before the interval of the limit is halved
HALVINGS = 40
ROUNDING = 1e-12  # of |R|, and of an eigenvalue's real part beside its size


def stability_polynomial(method: ButcherTableau) -> list[Fraction]:
    """The coefficients of R, that of 1 first: b A^(k-1) 1 for z^k."""
    n, coefficients = len(method.b), [Fraction(1)]
    stages = [Fraction(1)] * n
    for _ in range(n):
        coefficients.append(sum((Fraction(w) * s for w, s in zip(method.b, stages, strict=True)), Fraction(0)))
        rows = method.a[:n]
        stages = [sum((Fraction(a) * s for a, s in zip(row, stages, strict=False)), Fraction(0)) for row in rows]
    return coefficients


def grows_on_the_axis(coefficients: Sequence[Fraction]) -> bool:
    """Whether |R(iy)| > 1 for all small y: the lowest coefficient of |R(iy)|^2 - 1 is positive."""
    coefficients = [*coefficients, *[Fraction(0)] * len(coefficients)]
    real = [c * (-1) ** (k // 2) if k % 2 == 0 else Fraction(0) for k, c in enumerate(coefficients)]
    imaginary = [c * (-1) ** (k // 2) if k % 2 else Fraction(0) for k, c in enumerate(coefficients)]
    squares = [
        sum((part[k] * part[n - k] for part in (real, imaginary) for k in range(n + 1)), Fraction(0))
        for n in range(1, len(coefficients))
    ]
    return next((c > 0 for c in squares if c), False)


def eigenvalues(model: Model, arguments: Mapping[str, Any]) -> Array | None:
    """Eigenvalues of the flows of all modes; None where one of them is not linear in the states.

    A flow is linear where its derivatives are the same at three random states and times.
    """
    try:
        ready = model.pipeline.prepare({**arguments, "engine": "python"})
    except UsageError:
        return None
    until, random, found = float(ready.settings.until), np.random.default_rng(0), list[Array]()
    for k, mode in enumerate(model.program.modes):
        if not mode.states or mode.final:
            continue
        n, matrices = len(mode.states), list[Array]()
        for t in (0.0, 0.37 * until, 0.81 * until):
            jacobian = ready.kernel.jacobian(k, ready.timeline.at(t).data)
            try:
                matrices.append(np.array(jacobian(t, *random.normal(size=n).tolist()), float).reshape(n, n))
            except (ArithmeticError, ValueError):
                return None
        if any(not np.array_equal(matrices[0], other) for other in matrices[1:]):
            return None
        found.append(np.linalg.eigvals(matrices[0]))
    return np.concatenate(found) if found else None


def largest_step(method: str, values: Array, low: float, high: float) -> float | None:
    """The largest stable step within [low, high].

    None where there is no limit in there, where no step is stable, or where the method is no table.
    """
    table = METHODS.get(method)
    size, growth = np.abs(values), np.real(values)
    decaying = values[(growth <= ROUNDING * size) & (size > 0)]
    if not isinstance(table, ButcherTableau) or not len(decaying):
        return None
    coefficients = stability_polynomial(table)
    swings = np.abs(np.real(decaying)) <= ROUNDING * np.abs(decaying)
    if np.any(swings) and grows_on_the_axis(coefficients):
        return None
    powers = [float(c) for c in reversed(coefficients)]

    def stable(h: float) -> bool:
        return bool(np.all(np.abs(np.polyval(powers, h * decaying)) <= 1 + ROUNDING))

    steps = np.geomspace(low, high, STEPS)
    first = next((i for i, h in enumerate(steps) if not stable(float(h))), None)
    if not first:  # none is unstable, or all are
        return None
    a, b = float(steps[first - 1]), float(steps[first])
    for _ in range(HALVINGS):
        middle = (a * b) ** 0.5
        a, b = (middle, b) if stable(middle) else (a, middle)
    return a
