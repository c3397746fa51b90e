"""Tools, attempts of them at one setting each, and their results."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

from hsdsl.engine.execution import Array, Execution


class Refused(Exception):
    """A tool cannot run a model; the text gives the reason."""


class NotFinite(Refused):
    """A tool ends where numbers are not finite."""


@dataclass(frozen=True)
class Result:
    """A run at the scene's sample times; modes and transitions are computed outside the clock.

    Attributes
    ----------
    values : array, shape (samples, states of the scene)
        NaN where the run has no value (its mode lacks the state, or it ended before).
    find_modes, count : callable
        They give `modes` and `transitions`.
    problem : str or None
        Why the run did not get to its end, in the tool's words; None if it did.
    execution : Execution or None
        Of our own runs.
    """

    values: Array
    find_modes: Callable[[], Array]
    count: Callable[[], int | None]
    problem: str | None = None
    execution: Execution | None = None

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


@dataclass(frozen=True)
class Tool:
    """A tool by its name; ours have a scheme and a method."""

    name: str
    scheme: str = ""
    method: str = ""

    @property
    def label(self) -> str:
        """Name, scheme and method."""
        return " ".join(filter(None, (self.name, self.scheme, self.method)))


@dataclass(frozen=True)
class Attempt:
    """One tool at one setting; ``run`` runs it from the start and samples it."""

    tool: Tool
    size: str  # tolerance or step
    value: float
    run: Callable[[], Result]

    @property
    def setting(self) -> str:
        """Its tolerance or step."""
        return f"{self.size} {self.value:.3g}"
