"""Integrators: one file a method, most of them tables; METHODS is what models and the command line may name."""

from hsdsl.integrators.dop853 import DOP853
from hsdsl.integrators.dopri5 import DOPRI5
from hsdsl.integrators.euler import EULER
from hsdsl.integrators.heun import HEUN
from hsdsl.integrators.midpoint import MIDPOINT
from hsdsl.integrators.radau import RADAU, RadauMethod
from hsdsl.integrators.ralston import RALSTON
from hsdsl.integrators.rk4 import RK4
from hsdsl.integrators.tableau import ButcherTableau
from hsdsl.integrators.taylor import TAYLOR, TaylorMethod

INTEGRATORS: dict[str, ButcherTableau] = {
    table.name: table for table in (EULER, MIDPOINT, HEUN, RALSTON, RK4, DOPRI5, DOP853)
}
Method = ButcherTableau | TaylorMethod | RadauMethod
METHODS: dict[str, Method] = {**INTEGRATORS, TAYLOR.name: TAYLOR, RADAU.name: RADAU}
AUTO = DOPRI5.name  # what `method: auto` means while there is no fast engine for the others

__all__ = ["AUTO", "INTEGRATORS", "METHODS", "RADAU", "ButcherTableau", "Method", "RadauMethod", "TaylorMethod"]
