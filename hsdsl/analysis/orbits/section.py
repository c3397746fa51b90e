"""The return map of a section, from right after a transition to right after a later one of its edge; its fixed points.

Periodic orbits are fixed points of the map but for *shifts*: directions in which states may shift and nothing changes,
as the place of a runner and of its foot together do. From a start that is shifted along such a direction everything is
shifted by constants: the derivatives of the states along it stay the same on each arc and come back as they began, and
no transition moves in time.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from hsdsl.analysis.orbits.mathematics import Level
from hsdsl.analysis.sensitivity.result import Sensitivity
from hsdsl.analysis.sensitivity.targets import derivative_name, own, shift_name
from hsdsl.base.numbers.roundoff import ROUNDOFF_UNITS
from hsdsl.engine.execution import Array, Execution

Differentiate = Callable[[Mapping[str, float], float, float, int, Sequence[str]], Sensitivity]
ROUNDOFF = ROUNDOFF_UNITS * float(np.finfo(float).eps)
LONGER = 4  # a run that does not return is made so many times longer,
MOST_LONGER = 4  # as often as this


def without_noise(point: Array, sizes: Array) -> Array:
    """A point with zeros where its states are round-off of their sizes."""
    return np.where(np.abs(point) <= ROUNDOFF * sizes, 0.0, point)


class NoReturn(Exception):
    """A run from the section does not come back to it; the message says what it does."""


@dataclass(frozen=True)
class Return:
    """One passage of the map.

    With n states, ``point`` (n,) is where it leads and ``slopes`` (n + 1, n + 2) its derivatives: rows are the states
    and the time it takes, columns the states, the phase of the start, and the parameter that is followed (else 0).
    ``index`` is that of the transition of the run that ends it.
    """

    point: Array
    time: float
    slopes: Array
    sensitivity: Sensitivity
    index: int

    @property
    def execution(self) -> Execution:
        """The run."""
        return self.sensitivity.execution


@dataclass(frozen=True)
class Section:
    """A section and its map.

    ``run`` makes a run from a state, a phase, until a time, for so many transitions, by names of derivatives.

    ``edge`` is its transition, ``mode`` and ``states`` those it leads to, ``laps`` how many transitions of it close an
    orbit. ``phase`` is the name of the parameter of the phase, None where the system does not depend on time.
    ``numbers`` has those of the modes of parts, which an orbit comes back to. A state at round-off of its size, from
    ``sizes``, is zero: on a guard through zero, not beyond it. A run makes ``most`` transitions at first.
    """

    edge: str
    mode: str
    states: tuple[str, ...]
    laps: int
    phase: str | None
    run: Differentiate
    numbers: Mapping[str, int]
    sizes: Array
    most: int

    def follow(
        self, point: Array, phase: float, horizon: float, parameter: str | None = None, longer: int = MOST_LONGER
    ) -> Return:
        """Make the map at a point, by a run to the horizon, or one that is made ``longer`` as often as this.

        Raises NoReturn: the run does not come back.
        """
        names = [f"initial.{x}" for x in self.states]
        wrt = [*names, *([self.phase] if self.phase else []), *([parameter] if parameter else [])]
        there = without_noise(point, self.sizes)
        start, most = dict(zip(self.states, there.tolist(), strict=True)), self.most
        found = self.run(start, phase, horizon, most, wrt)
        for tried in range(1 + longer):
            passed = [made.index for made in found.execution.transitions if made.edge == self.edge]
            if len(passed) >= self.laps:
                index = passed[self.laps - 1]
                made = found.execution.transitions[index]
                assert made.after is not None
                if any(int(made.after[part]) != number for part, number in self.numbers.items()):
                    raise NoReturn(f"a run from there comes back to {self.edge} in other modes of parts: try more laps")
                point = np.array([made.after[x] for x in self.states], float)
                slopes = self.slopes(found.as_made(), index, wrt, parameter)
                if not np.isfinite(slopes).all():
                    raise NoReturn(
                        f"no derivative exists there: {found.breaks[0][1] if found.breaks else 'it is not finite'}"
                    )
                return Return(point, float(made.time), slopes, found, index)
            reason = found.execution.stop.reason
            if reason not in ("until", "transition_limit") or tried == longer:
                break
            horizon, most = (horizon * LONGER, most) if reason == "until" else (horizon, most * LONGER)
            found = self.run(start, phase, horizon, most, wrt)
        stop = found.execution.stop
        if found.breaks:
            raise NoReturn(found.breaks[0][1])
        raise NoReturn(f"a run from there does not come back to {self.edge}: it stops ({stop.reason}): {stop.message}")

    def slopes(self, found: Sensitivity, index: int, wrt: Sequence[str], parameter: str | None) -> Array:
        """The derivatives of a passage that ends with a transition."""
        moves, n = found.transition(index), len(self.states)
        slopes = np.zeros((n + 1, n + 2))
        columns = [*range(n), *([n] if self.phase else []), *([n + 1] if parameter else [])]
        for column, by in zip(columns, wrt, strict=True):
            slopes[:n, column] = [moves.after[x][by] for x in self.states]
            slopes[n, column] = moves.time[by]
        return slopes


SYMMETRY = 1e-9  # relative to the sizes of states: what changes by less does not


@dataclass(frozen=True)
class Symmetry:
    """The directions of a section's states, one a row; each has 1 for a state of its own, where the others have 0."""

    directions: Array

    @property
    def leading(self) -> list[int]:
        """The state of each direction's own, its first."""
        return [int(np.flatnonzero(way)[0]) for way in self.directions]

    @property
    def drifting(self) -> list[int]:
        """All states that a shift moves."""
        return np.flatnonzero(np.any(self.directions != 0, axis=0)).tolist()

    def kept(self, count: int) -> list[int]:
        """The states, phases and parameters that no direction uses alone."""
        return [k for k in range(count) if k not in self.leading]

    def without_shifts(self, rows: Array) -> Array:
        """What is kept of rows, one a state, after a shift has brought each direction's own state back."""
        kept, n = self.kept(len(rows)), self.directions.shape[1]
        shifts = np.zeros((len(self.leading), len(rows)))
        shifts[:, :n] = self.directions
        return rows[kept] - shifts[:, kept].T @ rows[self.leading]


def symmetry(passage: Return, sizes: Array) -> Symmetry:
    """The symmetry of a passage, by its derivatives; ``sizes`` are those of the section's states."""
    rows = np.vstack(list(_changes(passage, sizes)))
    rows /= np.maximum(1.0, np.max(np.abs(rows), axis=1, keepdims=True, initial=0.0))
    ways = np.linalg.svd(rows, full_matrices=False)[2]
    free = _reduced(ways[np.max(np.abs(rows @ ways.T), axis=0, initial=0.0) < SYMMETRY])
    return Symmetry(free * sizes / sizes[Symmetry(free).leading][:, None])


def _changes(passage: Return, sizes: Array) -> Iterator[Array]:
    """What a shift of each of the section's states changes, relative to sizes: rows that are zero along a symmetry."""
    n, run, table = len(sizes), passage.execution, passage.execution.arc_table
    lasts = passage.time or 1.0
    by = passage.sensitivity.wrt[:n]
    known = dict(zip((label.removeprefix("initial.") for label in by), sizes.tolist(), strict=True))
    yield (passage.slopes[:n, :n] - np.eye(n)) * sizes / sizes[:, None]
    yield passage.slopes[n:, :n] * sizes / lasts
    arc = np.repeat(np.arange(len(table.first)), np.diff(table.first, append=len(run.times)))
    for number, states in enumerate(table.layouts):
        rows = np.flatnonzero((run.times <= passage.time) & (table.layout[arc] == number))
        if len(rows):
            values = run.values[rows].astype(float)
            moved = values - run.values[table.first[arc[rows]]].astype(float)
            yield _columns(values, states, [shift_name(label) for label in by]) * sizes / lasts
            for x in own(states):
                size = known.get(x) or float(np.max(np.abs(values[:, states.index(x)]))) or 1.0
                yield _columns(moved, states, [derivative_name(x, label) for label in by]) * sizes / size


def _columns(values: Array, states: tuple[str, ...], names: list[str]) -> Array:
    """The columns of states with these names; one that the augmented system leaves out is zero."""
    found = np.zeros((len(values), len(names)))
    for k, name in enumerate(names):
        if name in states:
            found[:, k] = values[:, states.index(name)]
    return found


def _reduced(rows: Array) -> Array:
    """Rows in echelon form: each with 1 in a column of its own."""
    rows, done = rows.copy(), 0
    for column in range(rows.shape[1]):
        if done == len(rows):
            break
        best = done + int(np.argmax(np.abs(rows[done:, column])))
        if abs(rows[best, column]) < SYMMETRY:
            continue
        rows[[done, best]] = rows[[best, done]]
        rows[done] /= rows[done, column]
        others = np.arange(len(rows)) != done
        rows[others] -= np.outer(rows[others, column], rows[done])
        done += 1
    return np.where(np.abs(rows) < SYMMETRY, 0.0, rows)[:done]


MOST_STEPS, MOST_HALVINGS = 40, 12
MOST_IDLE = 8  # steps in which the gap does not become half as large
SMALLEST = 1e-10  # singular values below this share of the largest one are directions in which orbits form families
CLOSED = 1e-9  # of the sizes of states: a residual below this is round-off or the error of a run
EPSILON = float(np.finfo(float).eps)
COARSER = 1e-10  # a tolerance for runs that show how good others are, which keep 1e-13 where none is given


class Closed(NamedTuple):
    """A fixed point: where, at which phase, the last passage, and how far from closing it is relative to the sizes.

    It closes but for shifts along its ``symmetry``. ``sizes`` are the scales of the states.
    """

    point: Array
    phase: float
    passage: Return
    residual: float
    symmetry: Symmetry
    sizes: Array
    level: Level | None = None

    def off_level(self) -> tuple[Array, float]:
        """The slopes of a quantity that is kept, by states, and how far the point is off its level."""
        assert self.level is not None
        return self.level.row(self.point, self.sizes)


class NotClosed(Exception):
    """Newton's method did not come to a fixed point; the message says where it ended."""


def closed(
    section: Section,
    coarse: Section,
    point: Array,
    phase: float,
    horizon: float,
    multiple: float | None,
    level: Level | None = None,
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
    level : Level, optional
        A quantity that has its value at the guess in the orbit.

    Raises NotClosed: it did not converge.
    """
    try:
        passage, other = (each.follow(point, phase, horizon) for each in (section, coarse))
    except NoReturn as error:
        raise NotClosed(str(error)) from None
    sizes = _sizes(passage, point, other)
    best = _looked_at(point, phase, passage, sizes, multiple, level)
    here, mark, idle = best, best.residual, 0
    for _ in range(MOST_STEPS):
        if here.residual <= EPSILON:
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
    raise NotClosed(f"Newton's method stops improving, and {_open(section, best, multiple)}")


def _looked_at(
    point: Array, phase: float, passage: Return, sizes: Array, multiple: float | None, level: Level | None
) -> Closed:
    found, scale = symmetry(passage, sizes), np.append(sizes, multiple or 1.0)
    missing = np.abs(found.without_shifts(gap(passage, point, multiple))) / scale[found.kept(len(scale))]
    here = Closed(point, phase, passage, float(np.max(missing)), found, sizes, level)
    return here if level is None else here._replace(residual=max(here.residual, abs(here.off_level()[1])))


def _open(section: Section, here: Closed, multiple: float | None) -> str:
    """Which state of an orbit does not return to its value, and by how much; it may be the time of the forcing."""
    of, scale = here.symmetry, np.append(here.sizes, multiple or 1.0)
    kept = of.kept(len(scale))
    missing = np.abs(of.without_shifts(gap(here.passage, here.point, multiple))) / scale[kept]
    if here.level is not None and abs(here.off_level()[1]) > np.max(missing):
        return f"'{here.level.text}' is {here.level.at(here.point)[0]:.10g} instead of {here.level.value:.10g}"
    k = kept[int(np.argmax(missing))]
    if k == len(here.point):
        return f"the orbit takes {here.passage.time:.10g} instead of the period {multiple:.10g} of the forcing"
    ends = f"it starts at {here.point[k]:.10g} and comes back at {here.passage.point[k]:.10g}"
    return f"'{section.states[k]}' does not return to its value: {ends}"


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
    if here.level is not None:
        row, off = here.off_level()
        scaled = np.vstack([scaled, np.append(row, np.zeros(count - n))[kept]])
        missing = np.append(missing, off)
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
        there = _looked_at(point, phase, passage, here.sizes, multiple, here.level)
        if there.residual < 2 * here.residual or here.residual < CLOSED:
            return there
    raise NotClosed(f"Newton's method is stuck ({problem}), and {_open(section, here, multiple)}")
