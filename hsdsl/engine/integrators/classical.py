"""Classical explicit methods of fixed step: Euler, midpoint, Heun, Ralston, Runge-Kutta.

The paper's error bound at omega = 1 is shown with `euler`, its oscillator (Sec. V-B) with `midpoint`. `ralston` has the
least bound on the truncation error among methods of two stages.
"""

from hsdsl.engine.integrators.tableau import ButcherTableau, fractions

_ROWS = ((), fractions("1/2"), fractions("0 1/2"), fractions("0 0 1"))
_HEUN = "Heun (explicit trapezoidal rule)"
_RALSTON = "Ralston 1962, doi:10.1090/S0025-5718-1962-0150954-0"
_RUNGE = "Runge 1895, doi:10.1007/BF01446807"

EULER = ButcherTableau("euler", "Explicit Euler", 1, ((),), fractions("1"), "Euler 1768")
MIDPOINT = ButcherTableau("midpoint", "Explicit midpoint", 2, _ROWS[:2], fractions("0 1"), _RUNGE)
HEUN = ButcherTableau("heun", _HEUN, 2, ((), fractions("1")), fractions("1/2 1/2"), "Heun 1900")
RALSTON = ButcherTableau("ralston", "Ralston", 2, ((), fractions("2/3")), fractions("1/4 3/4"), _RALSTON)
RK4 = ButcherTableau("rk4", "Classical Runge-Kutta", 4, _ROWS, fractions("1/6 1/3 1/3 1/6"), "Kutta 1901")
