"""One second-order cone problem, to a certified gap: a feasible path above, a feasible dual below.

The solver (Clarabel) proposes; what is returned is computed from its proposal here. The problem is solved around its
last answer, in units of its value, until the gap is small or stops shrinking.
"""

from __future__ import annotations

from functools import cache
from importlib import import_module
from typing import Any

import numpy as np

from hsdsl.metrics.gate_sequence import Problem, Shape
from hsdsl.metrics.geometry import Array
from hsdsl.metrics.line import on_line
from hsdsl.metrics.rounding import brought_inside, charge, norm, proved_above, proved_below

GAP = 1e-10  # relative
SOLVED, ROUGHLY = 1e-12, 1e-8  # what the solver is asked for, and where one round has to do
ROUNDS = 3


def solve(problem: Problem, rounds: int = ROUNDS) -> tuple[float, float, Array]:
    """Minimise a problem, in at most so many rounds.

    Returns
    -------
    lower, upper : float
        Between which the minimum lies; see :mod:`hsdsl.metrics.rounding`.
    s : (N,) array
        Where ``upper`` is attained.
    """
    shape = problem.shape
    if not shape.matrices:
        return 0.0, 0.0, np.zeros(shape.size)
    numbers = np.array([problem.numbers])
    if shape.size < 2:
        lower, upper, s = on_line(shape, [o[None, :] for o in problem.offsets], numbers)
        return float(lower[0]), float(upper[0]), s[0]
    return _refined(problem, numbers, rounds)


def _refined(problem: Problem, numbers: Array, rounds: int) -> tuple[float, float, Array]:
    shape, offsets = problem.shape, [o[None, :] for o in problem.offsets]
    center: Array = -shape.back @ np.concatenate(problem.offsets)
    unit = max(problem.length(center), float(charge(shape, numbers, norm(center[None]))[0]), 1e-300)
    lower, upper, best = 0.0, np.inf, center
    for _ in range(rounds):
        found = _around(problem, center, unit, SOLVED if rounds > 1 else ROUGHLY)
        if found is None:
            break
        proposal, vectors, weights = (x[None] for x in found)
        s, inside = brought_inside(shape, proposal)
        value = float(proved_above(shape, offsets, numbers, s, inside)[0])
        lower = max(lower, float(proved_below(shape, offsets, numbers, s, vectors, weights)[0]))
        if value < upper:
            upper, best = value, s[0]
        rounding = 2 * float(charge(shape, numbers, norm(best[None]))[0])
        if upper - lower <= max(GAP * upper, rounding):
            break
        center, unit = best, max(upper, rounding) if upper < np.inf else unit
    return lower, upper, best


def _around(problem: Problem, center: Array, unit: float, tolerance: float) -> tuple[Array, Array, Array] | None:
    """Solve for ``s = center + unit * sigma``; returns proposals: unknowns, the legs' vectors, and weights."""
    clarabel: Any = import_module("clarabel")  # heavy, so not before it is needed
    shape = problem.shape
    if shape.cone is None:
        shape.cone = _cone(shape, clarabel)
    cost, matrix, objective, cones = shape.cone
    right = [(shape.levels - shape.normals @ center) / unit]
    for m, o in zip(shape.matrices, problem.offsets, strict=True):
        right += [np.zeros(1), (m @ center + o) / unit]
    right = np.concatenate(right)
    if not np.all(np.isfinite(right)):
        return None
    answer: Any = clarabel.DefaultSolver(cost, objective, matrix, right, cones, _settings(clarabel, tolerance)).solve()
    primal: Array = np.array(answer.x, dtype=float)
    dual: Array = np.array(answer.z, dtype=float)
    if not (np.all(np.isfinite(primal)) and np.all(np.isfinite(dual))):
        return None
    vectors, at = list[Array](), len(shape.levels)
    for offset in problem.offsets:
        vectors.append(-dual[at + 1 : at + 1 + len(offset)])
        at += 1 + len(offset)
    return center + unit * primal[: shape.size], np.concatenate(vectors), dual[: len(shape.levels)]


def _cone(shape: Shape, clarabel: Any) -> tuple[Any, Any, Array, list[Any]]:
    """What the solver takes that offsets do not change: a bound for each leg is one more unknown."""
    sparse: Any = import_module("scipy.sparse")
    size, legs = shape.size, len(shape.matrices)
    rows, cones = [np.hstack([shape.normals, np.zeros((len(shape.levels), legs))])], list[Any]()
    if len(shape.levels):
        cones.append(clarabel.NonnegativeConeT(len(shape.levels)))
    for i, matrix in enumerate(shape.matrices):
        block = np.zeros((1 + len(matrix), size + legs))
        block[0, size + i] = -1.0
        block[1:, :size] = -matrix
        rows.append(block)
        cones.append(clarabel.SecondOrderConeT(1 + len(matrix)))
    objective = np.concatenate([np.zeros(size), np.ones(legs)])
    dense = np.vstack(rows).T
    columns, places = dense.nonzero()
    ends = np.searchsorted(columns, np.arange(size + legs + 1))
    matrix = sparse.csc_matrix((dense[columns, places], places, ends), shape=dense.shape[::-1])
    return sparse.csc_matrix((size + legs, size + legs)), matrix, objective, cones


@cache
def _settings(clarabel: Any, tolerance: float) -> Any:
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = tolerance
    settings.max_iter = 60
    return settings
