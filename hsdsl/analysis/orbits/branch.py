"""A branch of orbits over a parameter, as it is reported."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import groupby
from typing import Any

import numpy as np

from hsdsl.analysis.orbits.continuation import Bifurcation, Point
from hsdsl.analysis.orbits.orbit import Orbit
from hsdsl.analysis.report.json_form import plain
from hsdsl.analysis.report.words import number
from hsdsl.base.names import called, checks_methods
from hsdsl.engine.execution import Array


@checks_methods
@dataclass(frozen=True, eq=False)
class Branch:
    """Periodic orbits over a parameter.

    Attributes
    ----------
    section, parameter : str
    states : tuple of str
        The names of the states of points, right after the section's transition.
    points : tuple of Point
        In the order of the branch: ``parameter``, ``state``, ``phase``, ``period``, ``multipliers``, ``unstable``.
    bifurcations : tuple of Bifurcation
        ``kind`` (fold, branch point, flip, torus or grazing), ``parameter``, ``state``.
    stable : list of (float, float)
        The ranges of the parameter of its stable pieces, in the order of the branch.
    ends : tuple of str
        Why the branch ends on either side.
    first : Orbit
        The orbit that it was followed from.
    """

    section: str
    parameter: str
    states: tuple[str, ...]
    points: tuple[Point, ...]
    bifurcations: tuple[Bifurcation, ...]
    ends: tuple[str, ...]
    first: Orbit = field(repr=False)

    def as_json(self) -> dict[str, Any]:
        """The object of `orbit --continue --json`."""
        points = [
            {
                "parameter": p.parameter,
                "state": dict(zip(self.states, p.state.tolist(), strict=True)),
                "period": p.period,
                "multipliers": [{"real": m.real, "imaginary": m.imag} for m in map(complex, p.multipliers)],
                "unstable": p.unstable,
            }
            for p in self.points
        ]
        found = [
            {"kind": b.kind, "parameter": b.parameter, "state": dict(zip(self.states, b.state.tolist(), strict=True))}
            for b in self.bifurcations
        ]
        return plain(
            {
                "section": self.section,
                "parameter": self.parameter,
                "points": points,
                "bifurcations": found,
                "stable": self.stable,
                "ends": self.ends,
            }
        )

    @property
    def knots(self) -> list[tuple[float, Array, bool | None]]:
        """The points and, between them, the bifurcations: the parameter, the state, and whether the orbit is stable.

        A bifurcation ends what is stable on one side of it, so it is neither.
        """
        found: list[tuple[float, Array, bool | None]] = []
        for b in self.bifurcations:
            if b.after < 0:
                found.append((b.parameter, b.state, None))
        for k, p in enumerate(self.points):
            found.append((p.parameter, p.state, p.unstable == 0))
            found += [(b.parameter, b.state, None) for b in self.bifurcations if b.after == k]
        return found

    @property
    def stable(self) -> list[tuple[float, float]]:
        """The ranges of the parameter of the pieces that are stable, in the order of the branch."""
        found: list[tuple[float, float]] = []
        knots = self.knots
        for stable, part in groupby(range(len(knots)), key=lambda k: knots[k][2]):
            if stable:
                piece = list(part)
                ends = range(max(piece[0] - 1, 0), min(piece[-1] + 2, len(knots)))
                values = [knots[k][0] for k in ends if knots[k][2] is not False]
                found.append((min(values), max(values)))
        return found

    @property
    def summary(self) -> str:
        """The branch as lines of text."""
        return "\n".join(self._lines())

    def _lines(self) -> Iterator[str]:
        run = self.first.execution
        yield f"{called(run.title, run.model)}: {len(self.points)} orbits through {self.section} over {self.parameter}"
        for way, why in zip((self.points[0], self.points[-1]), self.ends, strict=True):
            yield f"  to {self.parameter} = {number(way.parameter, 10)}: {why}"
        for found in self.bifurcations:
            yield f"  {found.kind} at {self.parameter} = {number(found.parameter, 12)}"
        for low, high in self.stable:
            yield f"  stable from {self.parameter} = {number(low, 10)} to {number(high, 10)}"

    def plot(self, path: str | os.PathLike[str]) -> None:
        """Draw the state that varies most over the parameter to a .png or .svg file, with its bifurcations."""
        from hsdsl.analysis.plot.analyses import plot_branch
        from hsdsl.analysis.plot.panel import label
        from hsdsl.engine.simulate.verdict.run_view import RunView

        states = np.array([p.state for p in self.points])
        drift = [k for k, name in enumerate(self.states) if name in self.first.drift]
        lap = RunView(self.first.sensitivity.setting.plain, self.first.execution)
        sizes = [lap.sizes.get(name, 0.0) for name in self.states]  # a state may be round-off at the section alone
        spread = np.ptp(states, axis=0) / np.maximum(sizes, np.max(np.abs(states), axis=0) + 1e-300)
        spread[drift] = -1
        k = int(np.argmax(spread))
        units = self.first.units
        marks = [(b.kind, b.parameter, float(b.state[k])) for b in self.bifurcations]
        plot_branch(
            path,
            label(self.parameter, units),
            f"{label(self.states[k], units)} after the section",
            [(value, float(state[k]), stable) for value, state, stable in self.knots],
            marks,
            f"{called(self.first.execution.title, self.first.execution.model)}: orbits through {self.section}",
        )
