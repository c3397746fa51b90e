"""The return map of a section: from the state right after a transition to that after a later one of the same edge."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from hsdsl.analysis.sensitivity.result import Sensitivity
from hsdsl.engine.execution import Array, Execution
from hsdsl.engine.simulate.surfaces import ROUNDOFF_UNITS

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
                return self._return(found, passed[self.laps - 1], wrt, parameter)
            reason = found.execution.stop.reason
            if reason not in ("until", "transition_limit") or tried == longer:
                break
            horizon, most = (horizon * LONGER, most) if reason == "until" else (horizon, most * LONGER)
            found = self.run(start, phase, horizon, most, wrt)
        stop = found.execution.stop
        if found.breaks:
            raise NoReturn(found.breaks[0][1])
        raise NoReturn(f"a run from there does not come back to {self.edge}: it stops ({stop.reason}): {stop.message}")

    def _return(self, found: Sensitivity, index: int, wrt: Sequence[str], parameter: str | None) -> Return:
        made = found.execution.transitions[index]
        assert made.after is not None
        if any(int(made.after[part]) != number for part, number in self.numbers.items()):
            raise NoReturn(f"a run from there comes back to {self.edge} in other modes of parts: try more laps")
        point = np.array([made.after[x] for x in self.states], float)
        slopes = self.slopes(found.as_made(), index, wrt, parameter)
        if not np.isfinite(slopes).all():
            raise NoReturn(f"no derivative exists there: {found.breaks[0][1] if found.breaks else 'it is not finite'}")
        return Return(point, float(made.time), slopes, found, index)

    def slopes(self, found: Sensitivity, index: int, wrt: Sequence[str], parameter: str | None) -> Array:
        """The derivatives of a passage that ends with a transition."""
        moves, n = found.transition(index), len(self.states)
        slopes = np.zeros((n + 1, n + 2))
        columns = [*range(n), *([n] if self.phase else []), *([n + 1] if parameter else [])]
        for column, by in zip(columns, wrt, strict=True):
            slopes[:n, column] = [moves.after[x][by] for x in self.states]
            slopes[n, column] = moves.time[by]
        return slopes
