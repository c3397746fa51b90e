"""What is run, and what comes back, whatever ran it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy.typing as npt

from hsdsl.execution import Execution

Array = npt.NDArray[Any]


class Refused(Exception):
    """A tool cannot run a model; the text says why."""


@dataclass(frozen=True)
class Result:
    """A run at the scene's sample times.

    Attributes
    ----------
    values : array, shape (samples, states of the scene)
        NaN where the run has no value (its mode lacks the state, or it ended before).
    modes : array of str, shape (samples,)
        The mode at each sample, empty where the run had ended.
    transitions : int or None
        How many were made; None where the tool cannot say.
    problem : str or None
        Why the run did not get to its end, in the tool's words; None if it did.
    execution : Execution or None
        Of our own runs.
    """

    values: Array
    modes: Array
    transitions: int | None
    problem: str | None = None
    execution: Execution | None = None


@dataclass(frozen=True)
class Attempt:
    """One tool at one setting; ``run`` runs it from the start and samples it."""

    tool: str
    scheme: str
    method: str
    size: str  # tolerance or step
    value: float
    run: Callable[[], Result]

    @property
    def label(self) -> str:
        """What a person calls it."""
        return " ".join(part for part in (self.tool, self.scheme, self.method) if part)

    @property
    def setting(self) -> str:
        """Its setting in words."""
        return f"{self.size} {self.value:.3g}"
