"""What a simulator may call: one mode's routines with parameters and input segment bound, and who binds them.

Any engine's kernel fits here (generated Python over float or mpmath today), so exchanging
kernels tells a fault of the loop from one of the code generator.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

from hsdsl.base.numbers.arithmetic import Arithmetic, Number

Vector = tuple[Number, ...]
Routine = Callable[..., Vector]  # called as routine(t, x0, ..., x{n-1})
Series = Sequence[Number]  # Taylor coefficients 0, 1, 2, ... in time


@dataclass(frozen=True)
class Taylor:
    """Taylor coefficients along one mode's flow, data bound.

    Attributes
    ----------
    flow : callable
        ``flow(order, t, x)`` gives the series of all lines that the flow needs, of the solution through (t, x): line 0
        is time, lines 1 to n are the states, with coefficients 0 to order + 1.
    surfaces : callable
        ``surfaces(order, lines)`` gives the coefficients 0 to order of each surface along that solution; None for one
        that is kinked.
    """

    flow: Callable[[int, Number, Vector], tuple[Series, ...]]
    surfaces: Callable[[int, tuple[Series, ...]], tuple[Series | None, ...]]


@dataclass(frozen=True)
class ModeKernel:
    """One mode's routines, data bound; `ModeProgram` has what each routine returns."""

    flow: Routine
    surfaces: Routine
    magnitudes: Routine
    outputs: Routine
    gradients: Sequence[Routine]
    rates: Sequence[Routine]
    conditions: Sequence[Callable[..., tuple[bool, ...]]]
    resets: Sequence[Routine]
    spreads: Sequence[Routine]


class Kernel(Protocol):
    """A program compiled for one number type."""

    @property
    def arithmetic(self) -> Arithmetic: ...

    @property
    def enclosing(self) -> Kernel:
        """The same program over interval arithmetic (`hsdsl.base.numbers.enclosures`), many boxes at once."""
        ...

    def over(self, arithmetic: Arithmetic) -> Kernel:
        """The same program over another number type."""
        ...

    def constant(self, name: str, parameters: Sequence[Number]) -> Vector:
        """Evaluate one of ``Program.constants``' routines at parameter values."""
        ...

    def switching(self, data: Sequence[Number]) -> Mapping[str, Routine]:
        """Return the routines of ``Program.switching`` by name."""
        ...

    def enclosed_switching(self, data: Sequence[Any]) -> Mapping[str, Routine]:
        """Return them over ranges of numbers (`backends.enclosures`), many at once."""
        ...

    def bind(self, mode: int, data: Sequence[Number]) -> ModeKernel:
        """Bind a mode to ``data``: parameters, (a, b, c) of each sampled input's segment, numbers of switches."""
        ...

    def taylor(self, mode: int, data: Sequence[Number]) -> Taylor | None:
        """Return Taylor coefficients along a mode's flow; None where the flow is kinked."""
        ...

    def jacobian(self, mode: int, data: Sequence[Number]) -> Routine:
        """Return the derivatives of a mode's flow by its states, n * n of them row by row."""
        ...

    def terms(self, mode: int, data: Sequence[Number]) -> Routine | None:
        """Return the sizes of the terms of a mode's flow, by time, states and their sizes; None if last digits tell."""
        ...

    def expressions(self, mode: int, data: Sequence[Number]) -> Sequence[tuple[str, Routine]]:
        """Return a mode's expressions one by one, named for a person: which of them is not finite?"""
        ...
