"""A periodic orbit: where it crosses its section, its period, its multipliers, and whether it is stable."""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from hsdsl.analysis.orbits.shooting import Closed
from hsdsl.analysis.sensitivity.result import Sensitivity
from hsdsl.base.names import called, checks_methods
from hsdsl.engine.execution import Array, Execution

LEAST_MARGIN = 1e-8  # multipliers are not known better than this


@checks_methods
@dataclass(frozen=True, eq=False)
class Orbit:
    """A periodic orbit of a hybrid system.

    Attributes
    ----------
    section : str
        The transition that it is cut at; ``laps`` of them close it.
    mode, state : str, dict
        The mode and the state right after that transition.
    phase : float or None
        The time of the state within the period of the forcing; None for a system that does not depend on time.
    period : float
        How long it takes.
    multipliers : array, complex
        Floquet multipliers, the largest first: of an autonomous system without the 1 along the orbit, and without those
        of drifting states.
    drift : dict
        How far states go in a period that nothing depends on, such as the place of a runner.
    residual : float
        How far it is from closing, relative to the sizes of the states.
    verdict : {"stable", "unstable", "undecided"}
        By the multipliers; ``reasons`` say more.
    sides : dict
        Where transitions are simultaneous and their order matters: the multipliers for each edge that goes first.
    """

    section: str
    laps: int
    mode: str
    state: dict[str, float]
    phase: float | None
    period: float
    multipliers: Array
    drift: dict[str, float]
    residual: float
    verdict: str
    reasons: tuple[str, ...]
    sides: dict[str, Array]
    overrides: dict[str, Any]
    closed: Closed = field(repr=False)

    @property
    def execution(self) -> Execution:
        """The run over one period, with derivatives as further states."""
        return self.sensitivity.execution

    def as_json(self) -> dict[str, Any]:
        """The object of `orbit --json`."""
        from hsdsl.analysis.orbits.summary import as_json

        return as_json(self)

    @property
    def summary(self) -> str:
        """The orbit as lines of text."""
        from hsdsl.analysis.orbits.summary import summary

        return summary(self)

    def plot(self, path: str | os.PathLike[str]) -> None:
        """Draw the orbit and its multipliers to a .png or .svg file."""
        from hsdsl.analysis.orbits.summary import shown
        from hsdsl.analysis.plot.orbit import plot_orbit

        states = [x for x in self.state if x not in self.drift]
        name = called(self.execution.title, self.execution.model)
        title = f"{name}: {self.verdict}, multipliers {shown(self.multipliers)}"
        plot_orbit(path, self.execution, states, self.multipliers, self.period, title, self.units)

    @property
    def units(self) -> dict[str, str]:
        """The units of the model, by name."""
        return self.sensitivity.setting.plain.program.units

    @property
    def sensitivity(self) -> Sensitivity:
        """The derivatives over one period."""
        return self.closed.passage.sensitivity


def multipliers_of(found: Closed, slopes: Array, forced: bool) -> Array:
    """The eigenvalues of a return map, the largest first, without the zero along the flow and those of shifts.

    The map does not depend on where along the flow it begins: that direction has the eigenvalue zero.
    """
    matrix, of = return_matrix(slopes, forced), found.symmetry
    count = len(found.point) + forced
    values = np.linalg.eigvals(of.without_shifts(matrix[:count])[:, of.kept(count)])
    order = np.argsort(-np.abs(values), kind="stable")
    return values[order][:-1]


def return_matrix(slopes: Array, forced: bool) -> Array:
    """The derivatives of where a lap leads, states and phase, by where it begins."""
    n = len(slopes) - 1
    matrix = slopes[:, : n + 1].copy()
    if forced:
        matrix[n, n] += 1  # the phase moves with the time
    return matrix


def returning(found: Closed, forced: bool) -> dict[str, dict[str, float]]:
    """The directions in which executions nearby are apart after a lap, by what moves them a lap before.

    Off a surface that a lap ends on none is, and where a lap ends in one point there is none.
    """
    wrt, sizes = found.passage.sensitivity.wrt, np.append(found.sizes, found.passage.time)[: len(found.point) + forced]
    matrix = return_matrix(found.passage.slopes, forced)[: len(wrt), : len(wrt)] * sizes
    matrix[np.abs(matrix) <= LEAST_MARGIN * sizes[:, None]] = 0
    return {
        by: dict(zip(wrt, column, strict=True))
        for by, column in zip(wrt, matrix.T.tolist(), strict=True)
        if any(column)
    }


def judged(multipliers: Array, error: float) -> tuple[str, str]:
    """The verdict of multipliers that are known to an error, and why."""
    if not len(multipliers):
        return "stable", "the section has one point"
    largest, margin = float(np.abs(multipliers[0])), max(LEAST_MARGIN, 10 * error)
    size = largest if largest >= LEAST_MARGIN else 0
    known = f"the largest multiplier has the size {size:.10g}, known to {margin:.1g}"
    if largest < 1 - margin:
        return "stable", known
    return ("unstable" if largest > 1 + margin else "undecided"), known
