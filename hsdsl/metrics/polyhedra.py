"""Polyhedra in the few coordinates a guard has: made from inequalities, found empty or not, measured."""

from __future__ import annotations

from importlib import import_module
from typing import Any

import numpy as np

from hsdsl.metrics.formulas import Formula
from hsdsl.metrics.geometry import Array, Domain, Gate

SLACK = 1e-12  # relative: what counts as zero among coefficients made by rounding


def pieces_of(
    edge: str,
    source: tuple[int, Domain],
    target: tuple[int, Domain],
    surface: tuple[Array, float],
    inequalities: tuple[Array, Array],
    reset: tuple[Array, Array],
    curved: tuple[Formula, ...],
) -> list[Gate]:
    """A guard as gates: one, or none where it is empty.

    Parameters
    ----------
    edge : str
        Its name.
    source, target : (int, Domain)
        Where it leaves and leads.
    surface : (n,) normal and level
        ``normal @ x = level`` on the guard.
    inequalities : (m, n) normals and (m,) levels
        What holds on it besides.
    reset : (k, n) matrix and (k,) vector
        Its affine reset.
    curved : tuple of callable
        Conditions that are not affine.
    """
    normal, level = surface
    size = float(np.linalg.norm(normal))
    if size == 0:
        return []
    base = normal * (level / size**2)
    frame = _orthogonal(normal / size)
    matrix, offset = reset
    image_base, image_frame = matrix @ base + offset, matrix @ frame
    image = target[1]
    rows = [
        _reduced(inequalities[0] @ frame, inequalities[1] - inequalities[0] @ base, np.abs(inequalities[1])),
        _reduced(image.normals @ image_frame, image.levels - image.normals @ image_base, np.abs(image.levels)),
    ]
    if any(row is None for row in rows):
        return []
    normals = np.vstack([row[0] for row in rows if row is not None])
    levels = np.concatenate([row[1] for row in rows if row is not None])
    nothing = np.zeros(len(base) - 1)
    if len(levels) and largest(nothing, normals, levels) is None:
        return []
    return [Gate(edge, source[0], target[0], base, frame, image_base, image_frame, normals, levels, curved)]


def _orthogonal(unit: Array) -> Array:
    """An orthonormal basis of what is orthogonal to a unit vector; coordinate axes where those are."""
    n = len(unit)
    axis = int(np.argmax(np.abs(unit)))
    if abs(unit[axis]) == 1.0:
        return np.delete(np.eye(n), axis, axis=1)
    mirror = unit.copy()
    mirror[axis] += np.copysign(1.0, unit[axis])
    reflection = np.eye(n) - 2 * np.outer(mirror, mirror) / (mirror @ mirror)
    return np.delete(reflection, axis, axis=1)


def _reduced(normals: Array, levels: Array, sizes: Array) -> tuple[Array, Array] | None:
    """Unit normals; without inequalities that hold of themselves; None where one never holds."""
    keep: list[int] = []
    lengths = np.linalg.norm(normals, axis=1)
    for i, length in enumerate(lengths.tolist()):
        if length > SLACK:
            keep.append(i)
        elif levels[i] < -1e-9 * (1 + sizes[i]):
            return None
    return normals[keep] / lengths[keep, None], levels[keep] / lengths[keep]


def largest(cost: Array, normals: Array, levels: Array) -> float | None:
    """The maximum of ``cost @ s`` where ``normals @ s <= levels``; inf where unbounded, None where that is empty."""
    linprog: Any = import_module("scipy.optimize").linprog

    if len(cost) == 0:
        return 0.0 if np.all(levels >= -SLACK) else None
    if len(levels) == 0:
        return 0.0 if not np.any(cost) else np.inf
    slack = levels + 1e-9 * (1 + np.abs(levels)) * (not np.any(cost))
    found: Any = linprog(-cost, A_ub=normals, b_ub=slack, bounds=(None, None), method="highs")
    if found.status == 0:
        return -float(found.fun)
    return None if found.status == 2 else np.inf
