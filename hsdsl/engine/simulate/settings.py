"""Settings of one run, in numbers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from hsdsl.base.limits import DEFAULT
from hsdsl.base.numbers.arithmetic import Number
from hsdsl.engine.integrators import Method


@dataclass(frozen=True)
class OneStop:
    """A mass against one stop: x'' = f(t) - 2 damping x' - stiffness x, and x' -> -restitution x' at x = level.

    ``position`` is the index (0 or 1) of x among the mode's states, x' being the other; ``above`` says that the stop
    bounds x from above. f is the flow of x' at rest in the origin.
    """

    position: int
    above: bool
    level: Number
    restitution: Number
    damping: Number
    stiffness: Number


@dataclass(frozen=True)
class Settings:
    """Settings of one run, resolved and checked.

    Exactly one of ``step`` (fixed) and ``tolerance`` (adaptive: local error relative to the largest
    size that each state has had) is given.
    ``relaxation`` is the paper's epsilon: a depth in the model's own units, and a time. ``samples`` (how many equally
    spaced times, or the times) says what tables of the execution are written at; it does not change the run.
    ``scale`` has the given sizes of states: the scale of a state is this size until the state has been larger.
    ``method_chosen`` says which method `auto` is here, and why; None where the method was named.
    ``overrides`` are the values given beyond the model's file, as written, by the names of `--set`.
    ``memory`` is how many bytes of rows a run may keep.
    ``completion`` is `none` where no state moves along a guard that holds it.
    ``longest_step`` bounds the steps of an adaptive method further, ``first_steps`` the first ones of each arc of flow,
    0 where it does not: by this number, then twice, then four times as much.
    ``moves`` is whether round-off moves the run, as one that another is compared with (`hsdsl.engine.simulate.moving`).
    ``method`` is None and ``one_stop`` is given for the scheme that has its own formula, `paoli_schatzman`.
    """

    scheme: str
    method: Method | None
    step: Number | None
    tolerance: Number | None
    relaxation: Number
    until: Number
    max_transitions: int
    scale: Mapping[str, Number] = field(default_factory=dict[str, Number])
    samples: int | tuple[Number, ...] | None = None
    one_stop: OneStop | None = None
    method_chosen: str | None = None
    overrides: Mapping[str, Any] = field(default_factory=dict[str, Any], compare=False)
    memory: int = DEFAULT.memory
    completion: str = "contact"
    longest_step: Number | None = None
    first_steps: Sequence[Number] = ()
    moves: bool = False

    def __post_init__(self) -> None:
        if (self.step is None) == (self.tolerance is None):
            raise ValueError("exactly one of step and tolerance")
        if self.tolerance is not None and (self.method is None or not self.method.adaptive):
            raise ValueError(f"{self.method.name if self.method else self.scheme} has no error estimate")
        if not self.relaxation > 0 or not self.until >= 0:
            raise ValueError("relaxation must be positive and until not negative")
