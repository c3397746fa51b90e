"""Scenes with transversal crossings and their exact solutions, shared by the convergence tests.

Compared are states that do not jump (all of them, or the position of what bounces), so the largest difference over
time is an error in the quotient metric, up to a constant, and no window round a transition need be left out.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from exact.forced import flights, forced
from exact.switched import nonlinear, oscillator

import hsdsl

HERE = Path(__file__).parent


@dataclass(frozen=True)
class Scene:
    """A model, its exact states at float times, when it ends and first crosses, and its number of transitions."""

    name: str
    exact: Callable[[Any], dict[str, Any]]
    until: float
    first_crossing: float
    transitions: int

    @cached_property
    def model(self) -> Any:
        """The model, loaded once."""
        return hsdsl.load(HERE / "scenes" / f"{self.name}.yaml")

    def run(self, **settings: Any) -> Any:
        """Run to the end; every run must make all transitions."""
        run = self.model.simulate(until=self.until, **({"scheme": "relaxed"} | settings))
        assert len(run.transitions) == self.transitions
        return run

    def error_at_samples(self, run: Any) -> float:
        """Largest error at the times the integrator stepped to."""
        return self._error(run, run.times)

    def error_between(self, run: Any) -> float:
        """Largest error at times that have nothing to do with the steps."""
        return self._error(run, np.linspace(0, self.until, 1201)[1:-1])

    def _error(self, run: Any, times: Any) -> float:
        sampled, expected = run.sample(times), self.exact(times)
        return max(float(np.max(np.abs(sampled[name] - column))) for name, column in expected.items())


SCENES = {
    scene.name: scene
    for scene in (
        Scene("switched", oscillator, 3.0, float(np.pi / 6), 2),
        Scene("nonlinear", nonlinear, 3.0, float(np.log(2)), 2),
        Scene("forced", forced, 1.6, float(flights()[1][0]), 2),
    )
}


def slope(sizes: Any, errors: Any) -> float:
    """Exponent p of errors ~ sizes**p, by least squares."""
    return float(np.polyfit(np.log(sizes), np.log(errors), 1)[0])
