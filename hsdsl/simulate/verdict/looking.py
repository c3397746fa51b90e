"""A recorded run with its modes' routines bound again, so that it can be looked at anywhere."""

from __future__ import annotations

import re
from bisect import bisect_right
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import accumulate

from hsdsl.arithmetic import DOMAIN_ERRORS, Arithmetic, Number
from hsdsl.execution import Arc, Execution, Stop, Transition
from hsdsl.integrators.stepper import Polynomial, State
from hsdsl.kernel import ModeKernel, Vector
from hsdsl.program import ModeProgram
from hsdsl.simulate.run import Run
from hsdsl.simulate.surfaces import TIE, Surfaces, at
from hsdsl.simulate.verdict.allowed import Allowed, Measured
from hsdsl.simulate.verdict.place import Place

JUMPS = re.compile(r"\b(?:sign|floor)\(")


@dataclass(frozen=True)
class Looking:
    """What a run recorded.

    Attributes
    ----------
    measured : mapping or None
        The error of each state, where it is known better than from the run's settings.
    """

    run: Run
    execution: Execution
    measured: Mapping[str, Number] | None = None

    @property
    def transitions(self) -> Sequence[Transition]:
        """The run's transitions."""
        return self.execution.transitions

    @property
    def stop(self) -> Stop:
        """How it ended."""
        return self.execution.stop

    @property
    def arithmetic(self) -> Arithmetic:
        """The run's number type."""
        return self.run.arithmetic

    @cached_property
    def times(self) -> list[Number]:
        """Times of all rows."""
        return self.execution.times.tolist()

    @cached_property
    def flows(self) -> list[Arc]:
        """Arcs of flow that take time."""
        arcs = self.execution.arcs
        return [arc for arc in arcs if arc.kind == "flow" and self.times[arc.last] > self.times[arc.first]]

    @cached_property
    def allowed(self) -> Allowed | Measured | None:
        """The error the run allows itself or was measured to have; None where nothing tells."""
        if self.measured is not None:
            return Measured(self.measured)
        tolerance = self.run.settings.tolerance
        if tolerance is None:
            return None
        waits = [t.resumed - t.time if t.resumed is not None else 0 for t in self.transitions]
        return Allowed(tolerance, tuple(t.time for t in self.transitions), tuple(accumulate(waits)))

    @property
    def safe(self) -> int:
        """Margins below so many errors are named."""
        return self.allowed.safe if self.allowed else 1

    def jumping_flows(self) -> list[str]:
        """Modes visited whose flow is not continuous."""
        visited = {arc.mode for arc in self.flows}
        return [m.name for m in self.run.program.modes if m.name in visited and _jumps(m)]

    @cached_property
    def _indices(self) -> dict[str, int]:
        return {mode.name: k for k, mode in enumerate(self.run.program.modes)}

    @cached_property
    def _bound(self) -> dict[tuple[int, Number], ModeKernel]:
        return {}

    def place(self, mode: str | int, t: Number, x: State) -> Place:
        """Look at a state of a mode."""
        index = self._indices[mode] if isinstance(mode, str) else mode
        segment = self.run.timeline.at(t)
        key = index, segment.start
        if key not in self._bound:
            self._bound[key] = self.run.kernel.bind(index, segment.data)
        program, kernel = self.run.program.modes[index], self._bound[key]
        scale = tuple(abs(a) for a in x)
        return Place(program, kernel, Surfaces(kernel, program.edges, scale, self.arithmetic), t, x)

    def state(self, arc: Arc, row: int) -> State:
        """The state at a row."""
        return tuple(self.execution.values[row][: len(arc.states)].tolist())

    def surfaces_along(self, arc: Arc) -> Iterator[Vector]:
        """The values of the surfaces at an arc's rows."""
        values: list[list[Number]] = self.execution.values[arc.first : arc.last + 1, : len(arc.states)].tolist()
        bound = self.at_row(arc, arc.first)
        end = self.run.timeline.at(bound.t).end
        for t, x in zip(self.times[arc.first : arc.last + 1], values, strict=True):
            surfaces = bound.kernel.surfaces if t <= end else self.place(arc.mode, t, tuple(x)).kernel.surfaces
            yield surfaces(t, *x)

    def at_row(self, arc: Arc, row: int) -> Place:
        """Look at a row."""
        return self.place(arc.mode, self.times[row], self.state(arc, row))

    def between(self, arc: Arc, row: int) -> Callable[[Number], Place]:
        """Look at shares of the step from a row to the next."""
        t, h = self.times[row], self.times[row + 1] - self.times[row]
        x, d = self.state(arc, row), len(arc.states)
        piece: Polynomial = tuple(tuple(c[:d]) for c in self.execution.coefficients[row].tolist())
        if not piece:
            piece = (tuple(b - a for a, b in zip(x, self.state(arc, row + 1), strict=True)),)
        return lambda s: self.place(arc.mode, t + s * h, at(x, piece, s))

    def error(self, place: Place, row: int) -> State | None:
        """How wrong a state may be that is reached at a row; None where nothing tells."""
        if self.allowed is None:
            return None
        try:
            slope = place.kernel.flow(place.t, *place.x)
        except DOMAIN_ERRORS:
            return None
        return self.allowed.error(row, place, slope)

    def shift(self, place: Place, k: int, row: int) -> Number | None:
        """How much the error may move surface k; None where nothing tells."""
        error = self.error(place, row)
        if error is None:
            return None
        gradient = place.kernel.gradients[k](place.t, *place.x)
        return sum((abs(g) * e for g, e in zip(gradient[1:], error, strict=True)), self.arithmetic.zero)

    def row_at(self, t: Number) -> int:
        """How many rows there are up to a time."""
        return max(0, bisect_right(self.times, t) - 1)

    def tie(self, t: Number) -> Number:
        """Times closer than this are the same instant."""
        return TIE * max(1, abs(t))


def _jumps(mode: ModeProgram) -> bool:
    flow = mode.routines.source.partition("def flow(")[2].partition("    def ")[0]  # of time alone it has none
    return JUMPS.search(flow) is not None
