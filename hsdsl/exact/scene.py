"""What an exact execution is before it is cut into pieces: stretches of a formula, one after the other."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from hsdsl.exact.numbers import DIGITS, Number, Vector
from hsdsl.execution import Verdict


@dataclass(frozen=True)
class Stretch:
    """The closed form between two jumps, over [start, end] in one mode.

    Attributes
    ----------
    first, last : Vector
        The values at start and end, from within.
    at : callable or None
        The state at a time; None where it is the line from ``first`` to ``last``.
    derivative : callable
        ``derivative(n)``: bounds on the absolute n-th derivatives of the states over the stretch.
    edge : str or None
        The transition that ends it; None where the state goes on, or the run ends.
    alternatives : tuple of str
        Edges reached at the same time and passed over.
    slack : float
        How far the truth may be from what the stretch says (an infinity of bounces put down as a line).
    """

    mode: str
    start: Number
    end: Number
    first: Vector
    last: Vector
    at: Callable[[Number], Vector] | None
    derivative: Callable[[int], Vector]
    edge: str | None = None
    alternatives: tuple[str, ...] = ()
    slack: float = 0.0


@dataclass(frozen=True)
class Scene:
    """An exact execution before it is cut into pieces.

    Attributes
    ----------
    states : mapping
        The states of each mode, in the model's order.
    degree : int
        Of the pieces; 0 for an execution that is straight everywhere.
    method : str
        How it was solved.
    digits : int
        To how many digits it was solved.
    final : str or None
        The mode whose entry ends it; its states are those of the last stretch.
    """

    name: str
    title: str
    source: str
    states: Mapping[str, tuple[str, ...]]
    stretches: Sequence[Stretch]
    verdict: Verdict
    degree: int
    method: str = "closed form"
    digits: int = DIGITS
    final: str | None = None
