"""Orbital stability, tested by nearby runs: do their distances in the quotient metric fall with the radius?

An execution is orbitally stable if the executions of nearby initial points and inputs come arbitrarily close in the
quotient metric of curves (Burden et al. 2013, Section III). Runs can only sample this property: the verdict is about a
few radii and a few directions.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from hsdsl.analysis.report.json_form import named, plain
from hsdsl.analysis.report.words import number
from hsdsl.base.names import checks_methods
from hsdsl.engine.execution import Array

FALLS, STAYS = 0.4, 0.1  # exponents of the radius: from the one on distances fall, up to the other they stay


class Nearby(NamedTuple):
    """A nearby run: the shift of each name at a radius, its distance as an interval, and its transitions."""

    radius: float
    shift: dict[str, float]
    lower: float
    upper: float
    transitions: tuple[str, ...]


@checks_methods
@dataclass(frozen=True, eq=False)
class OrbitalStability:
    """The orbital stability of an execution, as sampled by nearby runs.

    Attributes
    ----------
    verdict : {"stable", "not stable", "undecided"}
        Whether the sampled distances fall with the radius: ``stable`` if their upper ends do, ``not stable`` if their
        lower ends do not.
    sentence : str
        The verdict in words.
    exponent : float
        The power of the radius with which the largest distance falls: 1 for a smooth execution, 1/2 at grazing.
    runs : tuple of Nearby
    """

    wrt: tuple[str, ...]
    verdict: str
    sentence: str
    exponent: float
    runs: tuple[Nearby, ...]
    title: str = field(repr=False)

    def as_json(self) -> dict[str, Any]:
        """Return the object of `sensitivity --stability --json`."""
        found = named(self, "wrt verdict") | {"sampled": True} | named(self, "sentence exponent")
        return plain(found | {"runs": [run._asdict() for run in self.runs]})

    def plot(self, path: str | os.PathLike[str]) -> None:
        """Draw distances over radii to a .png or .svg file, with a colour for each sequence of transitions."""
        from hsdsl.analysis.plot.analyses import plot_nearby

        points = [(run.radius, run.upper, run.transitions) for run in self.runs]
        plot_nearby(path, points, f"{self.title}: {self.verdict} (sampled)")


def directions(count: int, samples: int, seed: int) -> Array:
    """Unit directions: both ways along every axis, as far as they are enough, then random ones."""
    axes = np.concatenate([np.eye(count), -np.eye(count)])
    rest = np.random.default_rng(seed).standard_normal((max(0, samples - len(axes)), count))
    random = rest / np.linalg.norm(rest, axis=1, keepdims=True)
    return np.concatenate([axes, random])


def sampled(
    wrt: Sequence[str],
    scales: Array,
    radii: Sequence[float],
    ways: Array,
    look: Callable[[Mapping[str, float]], tuple[float, float, tuple[str, ...]]],
    title: str,
) -> OrbitalStability:
    """Look at runs at all radii in all directions; ``look`` gives the distance of a shift and its transitions."""
    runs: list[Nearby] = []
    for radius in radii:
        for way in ways:
            shift = dict(zip(wrt, (radius * scales * way).tolist(), strict=True))
            runs.append(Nearby(radius, shift, *look(shift)))
    at = [[run for run in runs if run.radius == radius] for radius in radii]
    least, largest = ([max(getattr(run, end) for run in each) for each in at] for end in ("lower", "upper"))
    exponent = _exponent(radii, largest)
    verdict = "stable" if exponent >= FALLS else "not stable" if _exponent(radii, least) <= STAYS else "undecided"
    sentence = _sentence(verdict, radii, least, largest, exponent)
    return OrbitalStability(tuple(wrt), verdict, sentence, exponent, tuple(runs), title)


def _exponent(radii: Sequence[float], largest: Sequence[float]) -> float:
    """The power of the radius between the last two radii, since the limit counts."""
    if largest[-1] == 0:
        return float("inf")
    if not np.isfinite(largest[-1]):
        return 0.0
    if not np.isfinite(largest[-2]):
        return float("inf")
    return float(np.log(largest[-2] / largest[-1]) / np.log(radii[-2] / radii[-1]))


def _sentence(
    verdict: str, radii: Sequence[float], least: Sequence[float], largest: Sequence[float], exponent: float
) -> str:
    def seen(distances: Sequence[float]) -> str:
        return ", ".join(f"{number(d, 3)} at {number(r, 1)}" for r, d in zip(radii, distances, strict=True))

    found = f"the largest distances are {seen(largest)} of the scales"
    if verdict == "stable":
        return f"orbitally stable, as far as was sampled: {found}, falling with the power {exponent:.2g} of the radius"
    if verdict == "not stable":
        return f"not orbitally stable: {found}, and do not fall"
    return f"undecided: {found}, and at least {seen(least)}"
