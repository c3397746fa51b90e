"""A scene: a model with its numbers, its exact execution, and when errors are taken; and results of tools there."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from math import inf
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from hsdsl.analysis.exact import precise, reference, start_of
from hsdsl.base.errors import UsageError
from hsdsl.base.names import did_you_mean
from hsdsl.engine.execution import Array, Execution
from hsdsl.engine.simulate.recorder import Progress
from hsdsl.interface.model import Model

DIGITS = 8  # of a refined reference: each takes longer than the one before


@dataclass(frozen=True)
class Scene:
    """A model at given numbers, and its exact execution at sample times.

    ``countable`` is the fewest and the most transitions of a right result: those near the end may be missed, and past a
    Zeno point any number counts.
    """

    name: str
    model: Model
    initial: Mapping[str, Any]
    exact: Execution
    states: tuple[str, ...]
    grid: Array  # equally spaced times from 0 to the exact execution's end, or as far as a run is to go
    clear: Array  # whether a sample is so far from every exact jump that a slightly late jump changes nothing
    exact_values: Array  # the exact execution at the samples, as in `Result`
    exact_modes: Array
    countable: tuple[float, float]
    parameters: Mapping[str, Any] = field(default_factory=dict[str, Any])  # those that differ from the model's own

    @staticmethod
    def of(
        model: Model,
        *,
        block: int = 0,
        states: Sequence[str] = (),
        samples: int = 2000,
        clearance: float | None = None,
        digits: int = DIGITS,
        exact: Execution | None = None,
        until: float | str | None = None,
        watch: Callable[[Progress], None] | None = None,
    ) -> Scene:
        """Make the scene of a model with `hsdsl.exact.reference`, or `hsdsl.exact.precise` where there is none.

        Parameters
        ----------
        block : int
            Index in the model's ``reference:`` section (other initial values).
        states : sequence of str
            The states whose error is taken; all unless given.
        samples : int
            The number of sample times.
        clearance : float, optional
            Samples nearer than this to an exact jump are left out of the error; 1e-4, or 1e-4 of a run shorter than 1.
        digits : int
            Of a refined reference, 4 to 14; errors below its last digit mean nothing.
        exact : Execution, optional
            Replaces the reference.
        until : float or str, optional
            The end of runs, where it is not the exact execution's own; a given one may end before. The reference of an
            earlier end is refined.
        watch : callable, optional
            Called once with how far each run of a refined reference is, as in ``Model.simulate``.

        Raises UsageError: an unknown state, fewer than two samples, none clear of jumps, or no reference.
        """
        if samples < 2:
            raise UsageError(f"a chart takes at least 2 samples, not {samples}")
        initial: Mapping[str, str] = {}
        if exact is None:
            exact = _known(model, block) if until is None else None
            initial = start_of(model, block)
            exact = exact or precise(model, digits, until=until, initial=initial, watch=watch)
            until = None
        for name in states:
            if name not in exact.states:
                raise UsageError(f"the model has no state '{name}'", did_you_mean(name, exact.states))
        chosen = tuple(states) or exact.states
        start, end = (float(t) for t in exact.time_span)
        end = end if until is None else float(until)
        grid = np.linspace(start, end, samples)
        jumps = np.array([tr.time for tr in exact.transitions], dtype=float)
        near = np.abs(grid[:, None] - jumps[None, :]).min(axis=1) if len(jumps) else np.full(samples, np.inf)
        clearance = 1e-4 * min(1.0, end) if clearance is None else clearance
        clear = (near > clearance) & (grid <= end - clearance)
        if not clear.any():
            raise UsageError(f"no sample is farther than {clearance:g} from a jump and the end", "lower --clearance")
        values, modes = sampled(exact, grid, chosen)
        certain = int(np.count_nonzero(jumps <= end - clearance))
        countable = (0, inf) if exact.verdict.theorem == "left" else (certain, len(jumps))
        name = Path(model.program.path).stem + (f"-{block}" if block else "")
        return Scene(name, model, initial, exact, chosen, grid, clear, values, modes(), countable)

    def result(self, execution: Execution) -> Result:
        """An execution by hsdsl as the result of a tool."""
        values, modes = sampled(execution, self.grid, self.states)
        problem = None if execution.stop.complete else execution.stop.message
        return Result(values, modes, lambda: execution.made, problem, execution)


def sampled(execution: Execution, grid: Array, states: Sequence[str]) -> tuple[Array, Callable[[], Array]]:
    """Return values of shape (samples, states), NaN beyond the end, and what gives the modes, empty there."""
    known = [name for name in states if name in execution.states]
    whole = execution.stop.time >= grid.item(-1)
    count = len(grid) if whole else int(np.searchsorted(grid, float(execution.time_span[1]), side="right"))
    inside = slice(0, count)
    at = execution.sample(grid[inside], columns=known)
    values = at.state_columns
    if not whole or len(known) < len(states) or values.dtype.kind != "f":
        values = np.full((len(grid), len(states)), np.nan)
        for i, name in enumerate(known):
            values[inside, states.index(name)] = at.state_columns[:, i]

    def modes() -> Array:
        names = np.full(len(grid), "", dtype=object)
        names[inside] = at.mode
        return names

    return values, modes


def _known(model: Model, block: int) -> Execution | None:
    try:
        return reference(model, block)
    except UsageError:
        if block:
            raise
        return None


class Refused(Exception):
    """A tool cannot run a model; the text gives the reason."""


class NotFinite(Refused):
    """A tool ends where numbers are not finite."""


@dataclass(frozen=True)
class Result:
    """A run at the scene's sample times; modes and transitions are computed outside the clock."""

    values: Array  # (samples, states); NaN where the mode lacks the state, or the run ended before
    find_modes: Callable[[], Array]  # gives `modes`
    count: Callable[[], int | None]  # gives `transitions`
    problem: str | None = None  # why the run did not get to its end, in the tool's words; None if it did
    execution: Execution | None = None  # of our own runs

    @property
    def interrupted(self) -> bool:
        """Whether the run was ended from outside; ours keep what they have computed."""
        return self.execution is not None and self.execution.stop.reason == "interrupted"

    @cached_property
    def modes(self) -> Array:
        """The mode at each sample, shape (samples,), empty after the end of the run."""
        return self.find_modes()

    @cached_property
    def transitions(self) -> int | None:
        """The number of transitions; None where the tool does not count them."""
        return self.count()


class Tool(NamedTuple):
    """A tool by its name; ours have a scheme and a method."""

    name: str
    scheme: str = ""
    method: str = ""

    @property
    def label(self) -> str:
        return " ".join(filter(None, (self.name, self.scheme, self.method)))


class Attempt(NamedTuple):
    """One tool at one setting; ``run`` runs it from the start and samples it."""

    tool: Tool
    size: str  # tolerance or step
    value: float
    run: Callable[[], Result]

    @property
    def setting(self) -> str:
        """Its tolerance or step."""
        return f"{self.size} {self.value:.3g}"
