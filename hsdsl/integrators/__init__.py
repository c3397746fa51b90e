"""Integrators: one file a method, each a table; this dictionary is what models and the command line may name."""

from hsdsl.integrators.dop853 import DOP853
from hsdsl.integrators.dopri5 import DOPRI5
from hsdsl.integrators.euler import EULER
from hsdsl.integrators.heun import HEUN
from hsdsl.integrators.midpoint import MIDPOINT
from hsdsl.integrators.ralston import RALSTON
from hsdsl.integrators.rk4 import RK4
from hsdsl.integrators.tableau import ButcherTableau

INTEGRATORS: dict[str, ButcherTableau] = {
    table.name: table for table in (EULER, MIDPOINT, HEUN, RALSTON, RK4, DOPRI5, DOP853)
}
AUTO = DOPRI5.name  # what `method: auto` means while there is one adaptive method

__all__ = ["AUTO", "INTEGRATORS", "ButcherTableau"]
