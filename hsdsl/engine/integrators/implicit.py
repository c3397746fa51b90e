"""What is known of implicit methods by their names; how each steps is in a module that is imported by its run."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar, Literal

from hsdsl.base.graphs import Elimination, Variation
from hsdsl.base.numbers.arithmetic import Arithmetic, Number
from hsdsl.engine.kernel import Routine

if TYPE_CHECKING:
    from hsdsl.engine.integrators.stepper import Stepper


@dataclass(frozen=True)
class Derivatives:
    """What implicit steps know of a mode's flow besides its values.

    ``scales`` are those of the states, which grow along the run; ``terms`` is that of a mode;
    ``pattern`` is that of a sparse elimination; ``measured`` is that of a mode; ``varied`` says which states are
    derivatives of others, whose errors may be larger where they do not last for the time ``soon``.
    """

    jacobian: Routine
    scales: Sequence[Number]
    terms: Routine | None = None
    pattern: Elimination | None = None
    measured: Sequence[int] = ()
    varied: Variation | None = None
    soon: Number = 0


@dataclass(frozen=True)
class RadauMethod:
    """The method; its coefficients are made in the number type of a run."""

    name: str = "radau"
    title: str = "Radau IIA, three stages, for stiff flows"
    source: str = "Hairer and Wanner 1996, IV.5 and IV.8, doi:10.1007/978-3-642-05221-7"
    order: int = 5
    error_order: int = 4
    adaptive: bool = True
    digits: int | None = None
    degree: int = 3
    kind: ClassVar[Literal["radau"]] = "radau"
    implicit: ClassVar[bool] = True
    is_series: ClassVar[bool] = False

    def for_tolerance(self, tolerance: Number | None, arithmetic: Arithmetic) -> RadauMethod:
        """Return the method for a tolerance: itself."""
        return self

    def stepper(self, known: Derivatives, tolerance: Number | None, arithmetic: Arithmetic) -> Stepper:
        """Make its step functions, as `hsdsl.engine.integrators.radau.radau_stepper` does."""
        from hsdsl.engine.integrators.radau import radau_stepper

        return radau_stepper(known, tolerance, arithmetic)


RADAU = RadauMethod()
