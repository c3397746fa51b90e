"""A periodic orbit: its state at the section, its period, its multipliers and its stability."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from hsdsl.analysis.orbits.mathematics import within
from hsdsl.analysis.orbits.section import Closed
from hsdsl.analysis.report.json_form import named, plain
from hsdsl.analysis.report.words import condensed, number, values
from hsdsl.analysis.sensitivity.result import Sensitivity
from hsdsl.base.names import called, checks_methods, seen
from hsdsl.engine.execution import Array, Execution

LEAST_MARGIN = 1e-8  # multipliers are not known better than this


@checks_methods
@dataclass(frozen=True, eq=False)
class Orbit:
    """A periodic orbit of a hybrid system.

    Attributes
    ----------
    section : str
        The transition that is the section; the orbit closes after ``laps`` of them.
    mode, state : str, dict
        The mode and the state right after that transition.
    phase : float or None
        The time of the state within the period of the forcing; None for a system that does not depend on time.
    period : float
        The duration of one period.
    multipliers : array, complex
        The Floquet multipliers, the largest first, without those of drifting states and, for an autonomous system,
        without the 1 along the orbit.
    drift : dict
        The change in a period of states on which nothing depends, such as the position of a runner.
    residual : float
        The gap between start and end, relative to the sizes of the states.
    verdict : {"stable", "unstable", "undecided"}
        The stability by the multipliers; ``reasons`` has details.
    sides : dict
        The multipliers for each edge that goes first, if transitions are simultaneous and their order matters.
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
    def kept(self) -> dict[str, float]:
        """The quantity that the orbit's family keeps, with its value here; stability is that within its level set."""
        level = self.closed.level
        return {} if level is None else {level.text: level.value}

    @property
    def execution(self) -> Execution:
        """The run over one period, with the derivatives as further states."""
        return self.sensitivity.execution

    def as_json(self) -> dict[str, Any]:
        """Return the object of `orbit --json`; a complex number is its real and its imaginary part."""
        result = named(self, "section laps mode state phase period drift residual verdict reasons")
        result |= {"state": seen(self.state), "multipliers": _pairs(self.multipliers)}
        result |= {"kept": self.kept} if self.kept else {}
        if self.sides:
            result["sides"] = {edge: _pairs(found) for edge, found in self.sides.items()}
        return plain(result)

    @property
    def summary(self) -> str:
        """The orbit as lines of text."""
        return "\n".join(f"{label:12}{text}" for label, text in self._facts())

    def _facts(self) -> Iterator[tuple[str, str]]:
        run = self.execution
        closing = "" if self.laps == 1 else f", closed by {self.laps} of them"
        yield "orbit", f"{called(run.title, run.model)}: right after {self.section}{closing}"
        yield "period", number(self.period, 12)
        if self.phase is not None:
            yield "phase", f"t = {number(self.phase, 12)} within the period of the forcing"
        yield "state", f"mode {self.mode}, {values(seen(self.state))}"
        if self.drift:
            yield "drift", f"{values(self.drift)} in a period; nothing depends on it"
        for text, level in self.kept.items():
            yield "kept", f"{text} = {number(level, 12)}: orbits of other levels are near, and have a multiplier of 1"
        yield "multipliers", shown(self.multipliers) + (" within this level" if self.kept else "")
        for edge, found in self.sides.items():
            yield "", f"{shown(found)} where {edge} goes first"
        yield "verdict", f"{self.verdict}: {'; '.join(condensed(self.reasons))}"

    def plot(self, path: str | os.PathLike[str]) -> None:
        """Draw the orbit and its multipliers to a .png or .svg file."""
        from hsdsl.analysis.plot.analyses import plot_orbit
        from hsdsl.analysis.plot.curves import View, curves, lap

        states = [x for x in self.state if x not in self.drift]
        title = f"{called(self.execution.title, self.execution.model)}: {self.verdict} orbit"
        unit = self.units.get("t", "")
        facts = f"period {number(self.period, 7)} {unit}".rstrip()
        facts += f", multipliers {shown(self.multipliers, 4)}" if len(self.multipliers) else ""
        drawn = lap(curves(self.execution), float(self.period))
        plot_orbit(path, drawn, states, self.multipliers, View(title=title, units=self.units), self.section, facts)

    @property
    def units(self) -> dict[str, str]:
        """The units of the model, by name."""
        return self.sensitivity.setting.plain.program.units

    @property
    def sensitivity(self) -> Sensitivity:
        """The derivatives over one period."""
        return self.closed.passage.sensitivity


def multipliers_of(found: Closed, slopes: Array, forced: bool) -> Array:
    """Return the eigenvalues of a return map, the largest first, without the zero along the flow and those of shifts.

    Where a quantity is kept they are those within its level.
    The map does not depend on where along the flow it begins: that direction has the eigenvalue zero.
    """
    matrix, of = return_matrix(slopes, forced), found.symmetry
    count = len(found.point) + forced
    reduced, kept = of.without_shifts(matrix[:count])[:, of.kept(count)], of.kept(count)
    if found.level is not None:
        scale = np.append(found.sizes, found.passage.time)[kept]
        row = np.append(found.off_level()[0], np.zeros(count - len(found.point)))[kept]
        reduced = within(row, reduced * scale / scale[:, None], found.level.text)
    values = np.linalg.eigvals(reduced)
    order = np.argsort(-np.abs(values), kind="stable")
    return values[order][:-1]


def return_matrix(slopes: Array, forced: bool) -> Array:
    """Return the derivatives of the state and phase at the end of a lap with respect to those at its beginning."""
    n = len(slopes) - 1
    matrix = slopes[:, : n + 1].copy()
    if forced:
        matrix[n, n] += 1  # the phase moves with the time
    return matrix


def returning(found: Closed, forced: bool) -> dict[str, dict[str, float]]:
    """Return the directions of nearby executions after a lap, for each direction a lap before.

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
    """Return the verdict of multipliers that are known up to an error, with its reasons."""
    if not len(multipliers):
        return "stable", "the section has one point"
    largest, margin = float(np.abs(multipliers[0])), max(LEAST_MARGIN, 10 * error)
    size = largest if largest >= LEAST_MARGIN else 0
    known = f"the largest multiplier has the size {size:.10g}, known to {margin:.1g}"
    if largest < 1 - margin:
        return "stable", known
    return ("unstable" if largest > 1 + margin else "undecided"), known


def _pairs(found: Array) -> list[dict[str, float]]:
    return [{"real": float(m.real), "imaginary": float(m.imag), "size": float(np.abs(m))} for m in found]


def shown(found: Array, digits: int = 12) -> str:
    """Multipliers, a pair of conjugate ones as one; what is not known from zero is zero."""
    parts: list[str] = []
    for m in np.where(np.abs(found) < LEAST_MARGIN, 0.0, found):
        real, imaginary, size = (number(float(part), digits) for part in (m.real, m.imag, np.abs(m)))
        if m.imag >= 0:
            parts.append(f"{real} +- {imaginary}i (size {size})" if m.imag else real)
    return ", ".join(parts) or "none"
