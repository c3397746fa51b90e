"""Newton's method for fixed points of a return map: periodic orbits."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hsdsl.analysis.orbits.section import NoReturn, Return, Section
from hsdsl.analysis.orbits.symmetry import Symmetry, symmetry
from hsdsl.engine.execution import Array

MOST_STEPS, MOST_HALVINGS = 40, 12
MOST_IDLE = 8  # steps in which the gap does not become half as large
SMALLEST = 1e-10  # singular values below this share of the largest one are directions in which orbits form families
CLOSED = 1e-9  # of the sizes of states: a residual below this is round-off or the error of a run
ROUNDOFF = float(np.finfo(float).eps)
COARSER = 1e-10  # a tolerance for runs that show how good others are, which keep 1e-13 where none is given


@dataclass(frozen=True)
class Closed:
    """A fixed point: where, at which phase, the last passage, and how far from closing it is relative to the sizes.

    It closes but for shifts along its ``symmetry``. ``sizes`` are the scales of the states.
    """

    point: Array
    phase: float
    passage: Return
    residual: float
    symmetry: Symmetry
    sizes: Array


class NotClosed(Exception):
    """Newton's method did not come to a fixed point; the message says where it ended."""


def closed(
    section: Section, coarse: Section, point: Array, phase: float, horizon: float, multiple: float | None
) -> Closed:
    """Solve for a fixed point from a guess.

    Parameters
    ----------
    coarse : Section
        The same section with runs at the tolerance :data:`COARSER`.
    horizon : float
        The end of the first run; it is made longer where that is not enough.
    multiple : float or None
        The time that an orbit of a forced system takes.

    Raises NotClosed: it did not converge.
    """
    try:
        passage, other = (each.follow(point, phase, horizon) for each in (section, coarse))
    except NoReturn as error:
        raise NotClosed(str(error)) from None
    sizes = _sizes(passage, point, other)
    best = _looked_at(point, phase, passage, sizes, multiple)
    here, mark, idle = best, best.residual, 0
    for _ in range(MOST_STEPS):
        if here.residual <= ROUNDOFF:
            return here
        try:
            here = _damped(section, here, newton_step(here, multiple), multiple)
        except NotClosed:
            if best.residual < CLOSED:
                return best
            raise
        if here.residual >= best.residual and best.residual < CLOSED:
            return best
        best = here if here.residual < best.residual else best
        mark, idle = (best.residual, 0) if best.residual < mark / 2 else (mark, idle + 1)
        if idle == MOST_IDLE:
            break
    if best.residual < CLOSED:
        return best
    raise NotClosed(f"Newton's method comes no closer: the orbit does not close, by {best.residual:.2g} of the sizes")


def _looked_at(point: Array, phase: float, passage: Return, sizes: Array, multiple: float | None) -> Closed:
    found, scale = symmetry(passage, sizes), np.append(sizes, multiple or 1.0)
    missing = np.abs(found.without_shifts(gap(passage, point, multiple))) / scale[found.kept(len(scale))]
    return Closed(point, phase, passage, float(np.max(missing)), found, sizes)


def _sizes(passage: Return, point: Array, coarse: Return) -> Array:
    """The scales of the states of a section: their largest sizes on a passage, or what its error is relative to.

    A state that is zero but for round-off, as the pitch of a symmetric body, has no size of its own.
    """
    sizes = passage.execution.sizes(end=passage.time)
    names = (by.removeprefix("initial.") for by in passage.sensitivity.wrt[: len(point)])
    on_the_way: Array = np.array([sizes.get(name, 0.0) for name in names])
    allowed = [each.sensitivity.setting.augmented.settings.tolerance for each in (passage, coarse)]
    off = np.abs(passage.point - coarse.point) / max(float(each) for each in allowed if each is not None)
    found = np.maximum.reduce([np.abs(point), np.abs(passage.point), off, on_the_way])
    return np.where(found > 0, found, 1.0)


def gap(passage: Return, point: Array, multiple: float | None) -> Array:
    """What an orbit lacks: states, and for a forced system the time."""
    late = 0.0 if multiple is None else passage.time - multiple
    return np.append(passage.point - point, late)


def newton_step(here: Closed, multiple: float | None) -> Array:
    """The step of states and phase towards a fixed point: of least length where orbits form a family."""
    n, of = len(here.point), here.symmetry
    count = n + (multiple is not None)
    kept = of.kept(count)
    matrix = here.passage.slopes[:, : n + 1] - np.eye(n + 1)
    if multiple is not None:
        matrix[n, n] += 1  # the time itself must be the multiple, not as much as the phase
    scale = np.append(here.sizes, multiple or 1.0)
    scaled = of.without_shifts(matrix[:count])[:, kept] * scale[kept] / scale[kept][:, None]
    missing = of.without_shifts(gap(here.passage, here.point, multiple)[:count]) / scale[kept]
    step = np.zeros(n + 1)
    step[kept] = -np.linalg.lstsq(scaled, missing, rcond=SMALLEST)[0] * scale[kept]
    return step


def _damped(section: Section, here: Closed, step: Array, multiple: float | None) -> Closed:
    """Take a step, halved until the run comes back and the gap does not grow much; a whole one from a closed orbit."""
    problem = "the gap grows"
    for halvings in range(MOST_HALVINGS if here.residual >= CLOSED else 1):
        share = 0.5**halvings
        point, phase = here.point + share * step[:-1], here.phase + share * float(step[-1])
        try:
            passage = section.follow(point, phase, 1.5 * here.passage.time, longer=1)
        except NoReturn as error:
            problem = str(error)
            continue
        there = _looked_at(point, phase, passage, here.sizes, multiple)
        if there.residual < 2 * here.residual or here.residual < CLOSED:
            return there
    raise NotClosed(f"Newton's method is stuck where the orbit does not close, by {here.residual:.2g}: {problem}")
