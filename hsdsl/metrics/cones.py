"""One second-order cone problem, to a certified gap: a feasible path above, a feasible dual below.

The solver (Clarabel) proposes; what is returned is computed from its proposal here. The problem is solved around its
last answer, in units of its value, until the gap is small or stops shrinking.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any, cast

import numpy as np

from hsdsl.metrics.chain import Problem
from hsdsl.metrics.geometry import Array
from hsdsl.metrics.line import interval_of, minimise_on_line

GAP = 1e-10  # relative
ROUNDS = 3


def solve(problem: Problem) -> tuple[float, float, Array]:
    """Minimise a problem.

    Returns
    -------
    lower, upper : float
        Between which the minimum lies, up to round-off.
    s : (N,) array
        Where ``upper`` is attained.
    """
    if not problem.matrices:
        return 0.0, 0.0, np.zeros(problem.size)
    if problem.size == 0:
        value = problem.length(np.zeros(0))
        return value, value, np.zeros(0)
    if problem.size == 1:
        low, high = interval_of(problem.normals, problem.levels)
        matrices = [m[:, 0] for m in problem.matrices]
        lower, upper, s = minimise_on_line(matrices, [o[None, :] for o in problem.offsets], low, high)
        return float(lower[0]), float(upper[0]), s
    return _refined(problem)


def _refined(problem: Problem) -> tuple[float, float, Array]:
    stacked, offsets = np.vstack(problem.matrices), np.concatenate(problem.offsets)
    center = cast(Array, np.linalg.lstsq(stacked, -offsets, rcond=None)[0])
    unit = max(problem.length(center), 1e-300)
    lower, upper, best = 0.0, np.inf, center
    for _ in range(ROUNDS):
        found = _around(problem, center, unit)
        if found is None:
            break
        below, s = found
        s = _inside(problem, s)
        value = problem.length(s)
        lower = max(lower, below)
        if value < upper:
            upper, best = value, s
        scale = 1e-15 * (float(np.abs(offsets).max(initial=0)) + upper)
        if upper - lower <= max(GAP * upper, scale):
            break
        center, unit = best, max(upper, scale)
    return min(lower, upper), upper, best


def _around(problem: Problem, center: Array, unit: float) -> tuple[float, Array] | None:
    """Solve for ``s = center + unit * sigma``; returns a lower bound and a proposal."""
    clarabel: Any = import_module("clarabel")  # heavy, so not before it is needed
    sparse: Any = import_module("scipy.sparse")

    size, legs = problem.size, len(problem.matrices)
    offsets = [(m @ center + o) / unit for m, o in zip(problem.matrices, problem.offsets, strict=True)]
    levels = (problem.levels - problem.normals @ center) / unit
    rows, right, cones = [np.hstack([problem.normals, np.zeros((len(levels), legs))])], [levels], list[Any]()
    if len(levels):
        cones.append(clarabel.NonnegativeConeT(len(levels)))
    for i, (matrix, offset) in enumerate(zip(problem.matrices, offsets, strict=True)):
        block = np.zeros((1 + len(offset), size + legs))
        block[0, size + i] = -1.0
        block[1:, :size] = -matrix
        rows.append(block)
        right += [np.zeros(1), offset]
        cones.append(clarabel.SecondOrderConeT(1 + len(offset)))
    cost = np.concatenate([np.zeros(size), np.ones(legs)])
    matrix = sparse.csc_matrix(np.vstack(rows))
    solver: Any = clarabel.DefaultSolver(
        sparse.csc_matrix((size + legs, size + legs)), cost, matrix, np.concatenate(right), cones, _settings(clarabel)
    )
    answer: Any = solver.solve()
    primal: Array = np.array(answer.x, dtype=float)
    dual: Array = np.array(answer.z, dtype=float)
    if not (np.all(np.isfinite(primal)) and np.all(np.isfinite(dual))):
        return None
    below = _dual_value(problem, offsets, levels, dual)
    return unit * below, center + unit * primal[:size]


def _settings(clarabel: Any) -> Any:
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.tol_gap_abs = settings.tol_gap_rel = 1e-12
    settings.tol_feas = 1e-12
    settings.max_iter = 60
    return settings


def _dual_value(problem: Problem, offsets: list[Array], levels: Array, dual: Array) -> float:
    """The value of the feasible dual nearest to a proposal: unit vectors y and weights w >= 0 with M'y + C'w = 0.

    Its value is ``sum y o - w d``. What rounding leaves of the equation is charged with the unknowns' largest size.
    """
    weights = np.maximum(dual[: len(levels)], 0.0)
    vectors, at = list[Array](), len(levels)
    for offset in offsets:
        vectors.append(-dual[at + 1 : at + 1 + len(offset)])
        at += 1 + len(offset)
    stacked = np.vstack(problem.matrices)
    flat = np.concatenate(vectors)
    for _ in range(2):
        residual = stacked.T @ flat + problem.normals.T @ weights
        flat = flat - np.linalg.lstsq(stacked.T, residual, rcond=None)[0]
    ends = np.cumsum([len(o) for o in offsets])
    longest = max(float(np.linalg.norm(part)) for part in np.split(flat, ends[:-1]))
    shrink = 1.0 / max(1.0, longest)
    residual = stacked.T @ flat + problem.normals.T @ weights
    value = float(flat @ np.concatenate(offsets) - weights @ levels)
    return max(0.0, shrink * (value - 10.0 * float(np.linalg.norm(residual))))


def _inside(problem: Problem, s: Array) -> Array:
    """Move a proposal that is outside by rounding back inside."""
    for _ in range(20):
        beyond = problem.normals @ s - problem.levels
        worst = int(np.argmax(beyond)) if len(beyond) else -1
        if worst < 0 or beyond[worst] <= 0:
            break
        normal = problem.normals[worst]
        s = s - normal * (beyond[worst] / float(normal @ normal))
    return s
