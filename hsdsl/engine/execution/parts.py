"""The parts of an execution: arcs, transitions, stop, verdict and warnings."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Literal

from hsdsl.engine.execution.records import Deferred

Kind = Literal["flow", "strip"]


@dataclass(frozen=True)
class Arc:
    """Rows ``first..last`` (inclusive) of an execution, in one mode, with one jump counter."""

    mode: str
    states: tuple[str, ...]
    kind: Kind
    jump: int
    first: int
    last: int


@dataclass(frozen=True)
class Transition:
    """A transition that a run made.

    ``time`` is the time at which the guard was reached, ``resumed`` that at which the flow continued. If the run ended
    in the strip, ``resumed`` and ``after`` are None. ``alternatives`` are the edges reached within the tie tolerance
    and not taken. ``entry`` says that the transition fired at once because the state entered its mode beyond the
    surface.
    """

    index: int
    time: Any
    resumed: Any | None
    edge: str
    source: str
    target: str
    before: dict[str, Any]
    after: dict[str, Any] | None
    alternatives: tuple[str, ...]
    entry: bool = False


@dataclass(frozen=True)
class Stop:
    """The reason and time of a run's end.

    Attributes
    ----------
    reason : str
        ``until`` or ``final``; ``left_domain`` or ``zeno``, at which the execution itself ends; ``transition_limit``,
        ``waiting_limit``, ``memory_limit``, ``not_finite``, ``step_underflow`` or ``interrupted``.
    time : number
        The time of the end.
    message : str
        A sentence for a person.
    """

    reason: str
    time: Any
    message: str

    @property
    def complete(self) -> bool:
        """Whether the run reached its end (exit code 0)."""
        return self.reason in COMPLETE


COMPLETE = ("until", "final")  # the run got to where it was going
LEFT = ("left_domain", "zeno")  # the execution itself ends there
INCOMPLETE = ("transition_limit", "waiting_limit", "memory_limit", "not_finite", "step_underflow", "interrupted")
REASONS = (*COMPLETE, *LEFT, *INCOMPLETE)


@dataclass(frozen=True)
class RunWarning(Deferred):
    """A warning about a run, which is reported before its verdict.

    Attributes
    ----------
    code : str
        One of `hsdsl.base.errors.WARNINGS`; `hsdsl explain CODE` prints its page.
    time : number or None
        When it was first so.
    edge : str or None
        The transition that it is about.
    message : str
        A sentence for a person.
    """

    code: str
    time: Any | None
    edge: str | None
    message: str


@dataclass(frozen=True)
class Verdict(Deferred):
    """Whether the theorem's hypotheses hold for a run: ``holds``, ``left`` or ``unknown``.

    ``reasons`` has all reasons; ``warnings`` has the warnings found with the verdict.
    """

    theorem: Literal["holds", "left", "unknown"]
    reasons: tuple[str, ...]
    warnings: tuple[RunWarning, ...] = field(default_factory=tuple[RunWarning, ...])


@dataclass(frozen=True)
class Point:
    """The value of an execution at one time. ``state`` and ``outputs`` are keyed by name; indexing accepts both."""

    time: Any
    mode: str
    jump: int
    kind: Kind
    state: dict[str, Any]
    outputs: dict[str, Any]

    def __getitem__(self, name: str) -> Any:
        return self.state[name] if name in self.state else self.outputs[name]
