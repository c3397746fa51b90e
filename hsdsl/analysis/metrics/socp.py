"""Shortest paths through gate sequences as second-order cone problems: a feasible path above, a feasible dual below.

The solver (Clarabel) proposes; bounds are computed from its proposals here. A problem is solved around its last answer,
in units of its value, until the gap is small or stops shrinking.
"""

from __future__ import annotations

from collections.abc import Generator
from contextlib import contextmanager
from functools import cache
from importlib import import_module
from typing import Any

import numpy as np

from hsdsl.analysis.metrics.gate_sequence import ConeShape
from hsdsl.analysis.metrics.geometry import Array
from hsdsl.analysis.metrics.line import on_line
from hsdsl.analysis.metrics.rounding import brought_inside, charge, lengths, norm, proved_above, proved_below

GAP = 1e-10  # relative
SOLVED, ROUGHLY = 1e-12, 1e-8  # the solver's tolerance, and the one of a single round
ROUNDS = 3


@contextmanager
def one_thread() -> Generator[None]:
    """Keep BLAS and LAPACK on the calling thread: for twenty unknowns others cost more than they bring."""
    with _controller().limit(limits=1, user_api="blas"):
        yield


@cache
def _controller() -> Any:
    import_module("scipy.optimize")  # its own copy of the library has to be loaded to be found
    return import_module("threadpoolctl").ThreadpoolController()


def solve(shape: ConeShape, offsets: Array, numbers: Array, rounds: int = ROUNDS) -> tuple[Array, Array, Array]:
    """Minimise B problems of one shape, with offsets (B, n) and numbers of sizes (B,), in at most so many rounds.

    Returns lower and upper ends (B,), see :mod:`hsdsl.analysis.metrics.rounding`, and where the upper ones are attained, (B, N).
    """
    if not shape.matrices:
        return np.zeros(len(numbers)), np.zeros(len(numbers)), np.zeros((len(numbers), shape.size))
    if shape.size < 2:
        return on_line(shape, offsets, numbers)
    best = -offsets @ shape.back.T
    unit = np.maximum(np.maximum(lengths(shape, offsets, best), charge(shape, numbers, norm(best))), 1e-300)
    lower, upper, todo = np.zeros(len(numbers)), np.full(len(numbers), np.inf), np.arange(len(numbers))
    for _ in range(rounds):
        some = offsets[todo]
        s, vectors, weights = _proposals(shape, some, best[todo], unit[todo], SOLVED if rounds > 1 else ROUGHLY)
        s, inside = brought_inside(shape, s)
        value = proved_above(shape, some, numbers[todo], s, inside)
        below = proved_below(shape, some, numbers[todo], s, vectors, weights)
        lower[todo] = np.maximum(lower[todo], below)
        better = value < upper[todo]
        best[todo[better]], upper[todo[better]] = s[better], value[better]
        rounding = 2 * charge(shape, numbers[todo], norm(best[todo]))
        unit[todo] = np.maximum(upper[todo], rounding)
        todo = todo[upper[todo] - lower[todo] > np.maximum(GAP * upper[todo], rounding)]
        if not todo.size:
            break
    return lower, upper, best


def _proposals(
    shape: ConeShape, offsets: Array, centers: Array, units: Array, tolerance: float
) -> tuple[Array, Array, Array]:
    """Solve each problem for ``s = center + unit * sigma``: proposed unknowns, the legs' vectors, and weights."""
    clarabel: Any = import_module("clarabel")  # heavy, so not before it is needed
    if shape.cone is None:
        shape.cone = _cone(shape, clarabel)
    cost, matrix, objective, cones = shape.cone
    # Each leg is a cone of its bound and its vector, after the inequalities.
    rows = len(shape.levels)
    bounds = rows + np.array([part.start + k for k, part in enumerate(shape.parts)])
    right = np.zeros((len(centers), rows + len(bounds) + len(shape.stacked)))
    vectors = np.delete(np.arange(right.shape[1]), bounds)[rows:]
    right[:, :rows] = shape.levels - centers @ shape.normals.T
    right[:, vectors] = centers @ shape.stacked.T + offsets
    right /= units[:, None]
    s, dual, solver = centers.copy(), np.zeros_like(right), None
    for k in np.flatnonzero(np.all(np.isfinite(right), axis=1)).tolist():
        if solver is None:
            solver = clarabel.DefaultSolver(cost, objective, matrix, right[k], cones, _settings(clarabel, tolerance))
        else:
            solver.update(b=right[k])
        answer: Any = solver.solve()
        s[k], dual[k] = centers[k] + units[k] * np.asarray(answer.x)[: shape.size], answer.z
    lost = ~(np.all(np.isfinite(s), axis=1) & np.all(np.isfinite(dual), axis=1))
    s[lost], dual[lost] = centers[lost], 0.0
    return s, -dual[:, vectors], dual[:, :rows]


def _cone(shape: ConeShape, clarabel: Any) -> tuple[Any, Any, Array, list[Any]]:
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
    settings.presolve_enable = False  # else a solver takes no other offsets
    return settings
