"""Scenes of the theorems: a model, its exact execution, and its exact relaxed executions, to be compared in rho.

All but the last cross finitely many guards, transversally, before ``until``: the hypotheses of Corollary 28.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

from exact.dimensions import dimensions
from exact.relaxed import delayed, relaxed_oscillator
from references.impact_oscillator import exact_example_1, exact_example_2

import hsdsl
from hsdsl.analysis.exact.references import reference
from hsdsl.interface.model.distances import distance_of_runs as distance

ROOT = Path(__file__).parents[2]
HERE = Path(__file__).parent / "scenes"


@dataclass(frozen=True)
class Scene:
    """A model, how far it is followed, and how its executions are made.

    Attributes
    ----------
    exact : callable
        model -> its exact execution.
    relaxed : callable
        (model, exact execution, eps, until) -> the exact relaxed execution, as h -> 0.
    coarsest : dict
        By order of the method, the largest of four steps, each half of the last.
    """

    path: Path
    until: float
    transitions: int
    exact: Callable[[Any], Any]
    relaxed: Callable[[Any, Any, float, float], Any]
    coarsest: dict[int, float] = field(default_factory=dict)

    @cached_property
    def model(self) -> Any:
        """The model, loaded once."""
        return hsdsl.load(self.path)

    @cached_property
    def truth(self) -> Any:
        """The exact execution, solved once."""
        return self.exact(self.model)

    def limit(self, eps: float) -> Any:
        """The exact relaxed execution."""
        return self.relaxed(self.model, self.truth, eps, self.until)

    def run(self, **settings: Any) -> Any:
        """A run of the relaxed scheme; it must make all transitions."""
        run = self.model.simulate(until=self.until, **({"scheme": "relaxed"} | settings))
        assert len(run.transitions) == self.transitions
        return run

    def rho(self, run: Any, other: Any) -> float:
        """The middle of the interval for rho, which must be narrow."""
        found = distance(run, other, model=self.model)
        assert found.upper - found.lower <= 0.02 * found.upper + 1e-11, found
        return found.middle


def shift(model: Any, truth: Any, eps: float, until: float) -> Any:
    """The relaxed execution where time does not matter."""
    return delayed(truth, eps)


def waits(motion: Any) -> Callable[..., Any]:
    """The relaxed execution of an oscillator."""
    return lambda model, truth, eps, until: relaxed_oscillator(motion(), eps, until, model)


def known(name: str, until: float, transitions: int, relaxed: Any = shift, **coarsest: float) -> Scene:
    """A scene from the folder of models."""
    steps = {int(order[1:]): step for order, step in coarsest.items()}
    return Scene(ROOT / "models" / f"{name}.yaml", until, transitions, reference, relaxed, steps)


OSCILLATOR, OTHER = "oscillator-with-stop-1", "oscillator-with-stop-2"
SCENES = {
    "thermostat": known("thermostat", 10, 2, o1=0.4, o2=0.4, o4=0.8),
    "oscillator 1, 2 impacts": known(OSCILLATOR, 3, 2, waits(exact_example_1), o1=1e-3, o2=4e-3, o4=1.6e-2),
    "one state to three": Scene(HERE / "dimensions.yaml", 3, 3, dimensions, shift, {1: 2e-2, 2: 4e-2, 4: 8e-2}),
}
LONG = {
    "pendulum": known("constrained-pendulum", 4, 4, o1=5e-3, o2=1e-2, o4=2e-2),
    "oscillator 1, 4 impacts": known(OSCILLATOR, 8.5, 4, waits(exact_example_1), o1=2e-4, o2=2e-3, o4=1.6e-2),
}
BEFORE_ZENO = {"oscillator 2, 3 impacts": known(OTHER, 5, 3, waits(exact_example_2))}
