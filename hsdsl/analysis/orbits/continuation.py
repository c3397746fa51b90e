"""Continuation of periodic orbits in a parameter by arc length, with bifurcations.

With u the point, the phase and the parameter, each relative to its size, an orbit solves G(u) = 0, one equation fewer
than unknowns. From an orbit a step goes along the tangent, and Newton's method with the derivatives of the return map
comes back to the branch across it (H. B. Keller, Numerical solution of bifurcation and nonlinear eigenvalue problems,
1977). So a branch is followed around a fold.

============ =======================================================================================================
fold         the parameter turns back: a multiplier passes 1
branch point a multiplier passes 1 and the parameter goes on: another branch crosses, as of orbits without a symmetry
flip         a multiplier passes -1: an orbit of twice the period begins or ends
torus        a pair of complex multipliers passes the unit circle
grazing      a transition of the orbit begins or ends, or its rate becomes zero; the branch ends where it is not smooth
============ =======================================================================================================
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from itertools import groupby
from typing import Any, NamedTuple

import numpy as np
from numpy.polynomial import Polynomial
from scipy.optimize import brentq  # pyright: ignore[reportMissingTypeStubs, reportUnknownVariableType]

from hsdsl.analysis.orbits.mathematics import Level
from hsdsl.analysis.orbits.orbit import LEAST_MARGIN, Orbit, multipliers_of
from hsdsl.analysis.orbits.section import CLOSED, Closed, NoReturn, Return, gap
from hsdsl.analysis.report.json_form import named, plain
from hsdsl.analysis.report.words import number
from hsdsl.base.names import called, checks_methods
from hsdsl.engine.execution import Array
from hsdsl.engine.simulate.verdict.run_view import RunView

Passage = Callable[[Array, float, float], tuple[Return, float | None, float]]
MOST_POINTS, MOST_CORRECTIONS = 400, 8
FIRST, LEAST, LARGEST = 0.02, 1e-7, 0.05  # steps relative to the sizes of states and to the range of the parameter
LEVEL_STEP = 1e-5  # of the parameter's range: over it a level is differentiated
CLOSE = 1e-6  # of the sizes of states and of the parameter's range: solutions that are no further apart are one
PRECISE = 1e-12
NODES = 8  # of a step, where it is interpolated
CIRCLE = "the branch is closed"


class Solution(NamedTuple):
    """An orbit of the branch: its unknowns, the last passage, and the tangent of the branch."""

    unknowns: Array
    passage: Return
    tangent: Array


@dataclass(frozen=True)
class Point:
    """An orbit of a branch: its parameter, state, period, multipliers, and the number of multipliers outside the unit
    circle.
    """

    parameter: float
    state: Array
    phase: float
    period: float
    multipliers: Array

    @property
    def unstable(self) -> int:
        """How many multipliers are above one in size."""
        return int(np.sum(np.abs(self.multipliers) > 1 + LEAST_MARGIN))


@dataclass(frozen=True)
class Bifurcation:
    """A point of a branch at which orbits change: its kind (the table above), the parameter, and the state.

    It is between the point with the index ``after`` and the next point of the branch.
    """

    kind: str
    parameter: float
    state: Array
    after: int = 0


class Follower:
    """The branch through an orbit; ``passage`` makes the return map at a point, a phase and a parameter.

    It gives the passage, the time that an orbit of a forced system takes, and the derivative of that. ``level`` is that
    of a quantity which the orbits keep, by the parameter.
    """

    def __init__(
        self,
        passage: Passage,
        first: Closed,
        value: float,
        range_: tuple[float, float],
        level: Callable[[float], Level] | None = None,
    ) -> None:
        self.passage, self.first_orbit, self.range, self.level = passage, first, range_, level
        n = len(first.point)
        _, self.multiple, _ = passage(first.point, first.phase, value)
        self.forced = self.multiple is not None
        self.symmetry, self.count = first.symmetry, n + self.forced
        self.kept = [*self.symmetry.kept(self.count), n + 1]
        self.scale = np.concatenate([first.sizes, [self.multiple or 1.0], [abs(range_[1] - range_[0])]])
        self.start = np.concatenate([first.point, [first.phase, value]])

    def equations(self, unknowns: Array) -> tuple[Array, Array, Return]:
        """What an orbit lacks and its derivatives, relative to the sizes, and the passage."""
        n = len(unknowns) - 2
        passage, multiple, slope = self.passage(unknowns[:n], float(unknowns[n]), float(unknowns[n + 1]))
        matrix = passage.slopes.copy()
        matrix[:n, :n] -= np.eye(n)
        if self.forced:
            matrix[n, n + 1] -= slope
        kept, scale = self.kept, self.scale[self.kept]
        missing = self._shown(gap(passage, unknowns[:n], multiple)) / scale[:-1]
        rows = self._shown(matrix)[:, kept] * scale / scale[:-1, None]
        if self.level is not None:
            off, row = self._off_level(self.level, unknowns)
            missing, rows = np.append(missing, off), np.vstack([rows, row[kept]])
        return missing, rows, passage

    def _off_level(self, level: Callable[[float], Level], unknowns: Array) -> tuple[float, Array]:
        """How far unknowns are off the level, and its slopes by them, of length one, relative to the sizes."""
        point, at, step = unknowns[:-2], float(unknowns[-1]), LEVEL_STEP * float(self.scale[-1])
        here, slopes = level(at).at(point)
        behind, ahead = (level(at + way * step).at(point)[0] for way in (-1, 1))
        row = np.concatenate([slopes, [0.0, (ahead - behind) / (2 * step)]]) * self.scale
        length = float(np.linalg.norm(row)) or 1.0
        return (here - level(at).value) / length, row / length

    def _shown(self, rows: Array) -> Array:
        """Rows of states and time but for shifts."""
        return self.symmetry.without_shifts(rows[: self.count])

    def solution(self, unknowns: Array, along: Array) -> Solution:
        """Correct unknowns across a direction, and find the tangent that leads on in it.

        Raises NoReturn: there is no orbit near.
        """
        aim = unknowns.copy()
        for _ in range(MOST_CORRECTIONS):
            missing, matrix, passage = self.equations(unknowns)
            off = ((unknowns - aim) / self.scale)[self.kept]
            rows = np.vstack([matrix, along])
            step = -np.linalg.lstsq(rows, np.append(missing, along @ off), rcond=PRECISE)[0]
            if float(np.max(np.abs(missing), initial=0.0)) < CLOSED / 10:
                break
            unknowns = unknowns.copy()
            unknowns[self.kept] += step * self.scale[self.kept]
            if float(np.max(np.abs(step))) > 1:
                raise NoReturn("the correction goes far away")
        else:
            raise NoReturn("the orbit does not close")
        tangent = np.linalg.svd(matrix)[2][-1]
        return Solution(unknowns, passage, tangent if tangent @ along >= 0 else -tangent)

    def first(self, way: float) -> Solution:
        """The first solution, with the tangent along which the parameter grows or falls."""
        along = np.zeros(len(self.kept))
        along[-1] = way
        return self.solution(self.start, along)

    def step(self, here: Solution, length: float) -> Solution:
        """The solution a step further."""
        ahead = here.unknowns.copy()
        ahead[self.kept] += length * here.tangent * self.scale[self.kept]
        return self.solution(ahead, here.tangent)

    def reach(self, here: Solution, value: float) -> float:
        """The length of a step along the tangent to where the parameter has a value."""
        rate = float(here.tangent[-1] * self.scale[-1])
        return (value - float(here.unknowns[-1])) / rate if rate else np.inf

    def at(self, here: Solution, length: float, value: float) -> Solution:
        """The solution where the parameter has a value, a step further."""
        ahead, along = here.unknowns.copy(), np.zeros(len(self.kept))
        ahead[self.kept] += length * here.tangent * self.scale[self.kept]
        ahead[-1], along[-1] = value, np.sign(here.tangent[-1])
        return self.solution(ahead, along)

    def comes_back(self, first: Solution, here: Solution, ahead: Solution) -> bool:
        """Whether a step passes the first solution, whose phase is known up to periods: a branch may be a circle."""
        missing, step = ((each.unknowns - here.unknowns) / self.scale for each in (first, ahead))
        missing[-2] -= round(missing[-2])
        if not 0 < missing @ step <= step @ step or np.linalg.norm(missing) > np.linalg.norm(step):
            return False
        try:
            found = self.step(here, float(here.tangent @ missing[self.kept]))
        except NoReturn:
            return False
        apart = (found.unknowns - here.unknowns) / self.scale - missing
        return bool(np.max(np.abs(apart[self.kept])) < CLOSE)

    def point(self, here: Solution) -> Point:
        """What is reported of a solution."""
        *_, phase, value = here.unknowns.tolist()
        return Point(value, here.unknowns[:-2], phase, here.passage.time, self.multipliers(here))

    def multipliers(self, here: Solution) -> Array:
        """The multipliers of a solution, the largest first."""
        found = self.first_orbit
        if self.level is not None:
            found = found._replace(point=here.unknowns[:-2], level=self.level(float(here.unknowns[-1])))
        return multipliers_of(found, here.passage.slopes, self.forced)

    def tests(self, here: Solution) -> dict[str, float]:
        """Numbers that change their sign at bifurcations."""
        found = self.multipliers(here)
        pairs = [m for m in found.tolist() if m.imag > 0]
        return {
            "fold": float(here.tangent[-1]),
            "branch point": float(here.tangent[-1] * np.prod(found - 1).real),
            "flip": float(np.prod(found + 1).real),
            "torus": float(np.prod([abs(m) - 1 for m in pairs])) if pairs else 1.0,
        }


def branch(follower: Follower, way: float) -> tuple[list[Point], list[Bifurcation], str]:
    """Follow a branch in one way until the parameter leaves its range: its points, bifurcations, and why it ends."""
    low, high = sorted(follower.range)
    first = here = previous = follower.first(way)
    points, found, length = [follower.point(here)], list[Bifurcation](), FIRST
    while len(points) < MOST_POINTS:
        end = high if here.tangent[-1] > 0 else low
        reach = follower.reach(here, end)
        try:
            ahead = follower.step(here, length) if length < reach else None
            last = ahead is None or not low <= ahead.unknowns[-1] <= high
            ahead = follower.at(here, reach, end) if ahead is None or last else ahead
            same = sequence(ahead) == sequence(here)
        except NoReturn as problem:
            ahead, same, last, why = None, False, False, str(problem)
        else:
            why = "the orbit makes other transitions from there on"
        if ahead is None or not same or float(here.tangent @ ahead.tangent) < 0.9:  # something may be missed
            length = min(length, reach) / 2
            if length >= LEAST:
                continue
            if ahead is None or not same:
                found.append(replace(_grazing(previous, here), after=len(points) - 1))
                return points, found, why
        assert ahead is not None
        passed = _between(follower, here, ahead, min(length, reach))
        if len(passed) > 1 and length > LEAST:  # each has a step of its own, so the orbits on both its sides are known
            length = min(length, reach) / 2
            continue
        found += [replace(each, after=len(points) - 1) for each in passed]
        previous, here, length = here, ahead, min(LARGEST, 1.3 * length)
        points.append(follower.point(here))
        if last:
            return points, [b for b in found if low <= b.parameter <= high], "the parameter is at the end of its range"
        if follower.comes_back(first, previous, here):
            points[-1] = points[0]
            return points, found, CIRCLE
    return points, found, f"{MOST_POINTS} orbits were found"


def sequence(here: Solution) -> list[str]:
    """The transitions of a period."""
    return [made.edge for made in here.passage.execution.transitions[: here.passage.index + 1]]


def _between(follower: Follower, here: Solution, ahead: Solution, length: float) -> list[Bifurcation]:
    """The bifurcations between two solutions, located along the step."""
    before, after, found = follower.tests(here), follower.tests(ahead), list[Bifurcation]()
    for kind in before:
        if before[kind] * after[kind] >= 0:
            continue
        multipliers: list[Any] = [follower.multipliers(each) for each in (here, ahead)]
        if kind == "branch point" and any(np.any(np.abs(each - 1) < LEAST_MARGIN) for each in multipliers):
            continue  # a multiplier is 1 but for its error, as on families of orbits
        if kind == "torus" and len({int(np.sum(each.imag > 0)) for each in multipliers}) > 1:
            continue  # a pair became real on the way

        def value(s: float, kind: str = kind) -> float:
            return follower.tests(follower.step(here, s))[kind]

        try:
            if kind == "branch point":
                there = _interpolated(follower, here, length, kind)
            else:
                solve: Any = brentq  # pyright: ignore[reportUnknownVariableType]
                there = follower.step(here, solve(value, 0.0, length, xtol=PRECISE * length, rtol=1e-12)).unknowns
        except (NoReturn, ValueError):
            there = ahead.unknowns
        found.append(Bifurcation(kind, float(there[-1]), there[:-2]))
    return found


def _interpolated(follower: Follower, here: Solution, length: float, kind: str) -> Array:
    """The unknowns where a test is zero, from solutions around it: at it the equations have no single one."""
    nodes = length * (1 - np.cos(np.pi * (np.arange(NODES) + 0.5) / NODES)) / 2
    solutions = [follower.step(here, s) for s in nodes.tolist()]
    rows = np.array([[*each.unknowns, follower.tests(each)[kind]] for each in solutions])
    *unknowns, value = (Polynomial.fit(nodes, column, NODES - 1, domain=[0, length]) for column in rows.T)
    solve: Any = brentq  # pyright: ignore[reportUnknownVariableType]
    zero = solve(value, 0.0, length)
    return np.array([each(zero) for each in unknowns])


def _grazing(previous: Solution, here: Solution) -> Bifurcation:
    """Where the branch stops being smooth: where a rate becomes zero, or as near as it was followed."""
    before, last = _rates(previous), _rates(here)
    there = here.unknowns
    if len(before) == len(last) and len(last):
        shares = [b / a if a else 1.0 for a, b in zip(before, last, strict=True)]
        k = int(np.argmin(np.abs(shares)))
        if abs(shares[k]) < 1 - CLOSE:
            there = here.unknowns + shares[k] / (1 - shares[k]) * (here.unknowns - previous.unknowns)
    return Bifurcation("grazing", float(there[-1]), there[:-2])


def _rates(here: Solution) -> list[float]:
    """The rates at which the transitions of a period cross their guards."""
    found = here.passage.sensitivity
    run = RunView(found.setting.augmented, found.execution)
    made = run.transitions[: len(sequence(here))]
    return [float(place.rate(k)) for place, k in map(run.before, made)]


@checks_methods
@dataclass(frozen=True, eq=False)
class Branch:
    """Periodic orbits over a parameter.

    Attributes
    ----------
    section, parameter : str
    states : tuple of str
        The names of the states of points, which are those right after the section's transition.
    points : tuple of Point
        The points in the order of the branch: ``parameter``, ``state``, ``phase``, ``period``, ``multipliers``,
        ``unstable``.
    bifurcations : tuple of Bifurcation
        ``kind`` (fold, branch point, flip, torus or grazing), ``parameter``, ``state``.
    stable : list of (float, float)
        The parameter ranges of the stable pieces, in the order of the branch.
    ends : tuple of str
        The reasons of both ends of the branch.
    first : Orbit
        The orbit at which the branch was started.
    """

    section: str
    parameter: str
    states: tuple[str, ...]
    points: tuple[Point, ...]
    bifurcations: tuple[Bifurcation, ...]
    ends: tuple[str, ...]
    first: Orbit = field(repr=False)

    def as_json(self) -> dict[str, Any]:
        """Return the object of `orbit --continue --json`."""

        def placed(at: Point | Bifurcation, names: str) -> dict[str, Any]:
            return named(at, names) | {"state": dict(zip(self.states, at.state.tolist(), strict=True))}

        points = [
            placed(p, "parameter state period")
            | {"multipliers": [{"real": m.real, "imaginary": m.imag} for m in map(complex, p.multipliers)]}
            | {"unstable": p.unstable}
            for p in self.points
        ]
        found = {"points": points, "bifurcations": [placed(b, "kind parameter state") for b in self.bifurcations]}
        return plain(named(self, "section parameter") | found | named(self, "stable ends"))

    @property
    def knots(self) -> list[tuple[float, Array, bool | None]]:
        """The points and, between them, the bifurcations: the parameter, the state, and whether the orbit is stable.

        A bifurcation ends a stable piece on one side, so it is neither stable nor unstable.
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
        """The parameter ranges of the stable pieces, in the order of the branch."""
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
        """Draw the state that varies most over the parameter, with its bifurcations, to a .png or .svg file."""
        from hsdsl.analysis.plot.analyses import plot_branch
        from hsdsl.analysis.plot.style import label
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
