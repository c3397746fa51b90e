"""What an execution is made of: arcs, transitions, how it stopped, and what may be said about it."""

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
    """One transition.

    ``time`` is when the guard was reached and ``resumed`` when flow went on (None when the run ended in the
    strip, and then ``after`` is None too). ``alternatives`` are the edges that were reached within the tie
    tolerance and passed over. ``entry`` says that it fired at once because the state entered its mode beyond
    the surface.
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
    """Why and when a run ended.

    Attributes
    ----------
    reason : str
        ``until`` or ``final``; ``left_domain`` or ``zeno``, where the execution itself ends; ``transition_limit``,
        ``waiting_limit``, ``memory_limit``, ``not_finite``, ``step_underflow`` or ``interrupted``.
    time : number
        When.
    message : str
        A sentence for a person.
    """

    reason: str
    time: Any
    message: str

    @property
    def complete(self) -> bool:
        """Whether the run got to where it was going (exit code 0)."""
        return self.reason in COMPLETE


COMPLETE = ("until", "final")  # the run got to where it was going
LEFT = ("left_domain", "zeno")  # the execution itself ends there
INCOMPLETE = ("transition_limit", "waiting_limit", "memory_limit", "not_finite", "step_underflow", "interrupted")
REASONS = (*COMPLETE, *LEFT, *INCOMPLETE)


@dataclass(frozen=True)
class RunWarning:
    """Something about a run that its reader should know first.

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
    """What can be said about the theorem's hypotheses for this run: ``holds``, ``left`` or ``unknown``.

    ``reasons`` are all of them; ``warnings`` are what the look at the run has found besides.
    """

    theorem: Literal["holds", "left", "unknown"]
    reasons: tuple[str, ...]
    warnings: tuple[RunWarning, ...] = field(default_factory=tuple[RunWarning, ...])


@dataclass(frozen=True)
class Point:
    """The value of an execution at one time. ``state`` and ``outputs`` are by name; indexing finds either."""

    time: Any
    mode: str
    jump: int
    kind: Kind
    state: dict[str, Any]
    outputs: dict[str, Any]

    def __getitem__(self, name: str) -> Any:
        return self.state[name] if name in self.state else self.outputs[name]
