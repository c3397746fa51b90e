"""A branch of orbits over a parameter, as it is reported."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from hsdsl.names import called
from hsdsl.orbits.continuation import Bifurcation, Point
from hsdsl.orbits.orbit import Orbit
from hsdsl.report.json_form import plain
from hsdsl.report.words import number


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
        ``kind`` (fold, flip, torus or grazing), ``parameter``, ``state``.
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
                "ends": self.ends,
            }
        )

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
        stable = [p.parameter for p in self.points if not p.unstable]
        if stable:
            yield f"  stable for some {self.parameter} from {number(min(stable))} to {number(max(stable))}"

    def plot(self, path: str | os.PathLike[str]) -> None:
        """Draw the state that varies most over the parameter to a .png or .svg file, with its bifurcations."""
        from hsdsl.plot.analyses import plot_branch

        states = np.array([p.state for p in self.points])
        drift = [k for k, name in enumerate(self.states) if name in self.first.drift]
        spread = np.ptp(states, axis=0) / np.maximum(np.max(np.abs(states), axis=0), 1e-300)
        spread[drift] = -1
        k = int(np.argmax(spread))
        marks = [(b.kind, b.parameter, float(b.state[k])) for b in self.bifurcations]
        plot_branch(
            path,
            self.parameter,
            self.states[k],
            [(p.parameter, float(p.state[k]), p.unstable == 0) for p in self.points],
            marks,
            f"{called(self.first.execution.title, self.first.execution.model)}: orbits through {self.section}",
        )
