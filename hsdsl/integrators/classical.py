"""Classical explicit methods of fixed step: Euler, midpoint, Heun, Ralston, Runge-Kutta."""

from hsdsl.integrators.tableau import ButcherTableau, fractions

# the simplest one, for teaching and for the paper's error bound at omega = 1
EULER = ButcherTableau(
    name="euler",
    title="Explicit Euler",
    order=1,
    a=((),),
    b=fractions("1"),
    source="Euler 1768",
)
# the method of the paper's oscillator experiments (Sec. V-B)
MIDPOINT = ButcherTableau(
    name="midpoint",
    title="Explicit midpoint",
    order=2,
    a=((), fractions("1/2")),
    b=fractions("0 1"),
    source="Runge 1895, doi:10.1007/BF01446807",
)
HEUN = ButcherTableau(
    name="heun",
    title="Heun (explicit trapezoidal rule)",
    order=2,
    a=((), fractions("1")),
    b=fractions("1/2 1/2"),
    source="Heun 1900",
)
# the least bound on the truncation error among two-stage methods
RALSTON = ButcherTableau(
    name="ralston",
    title="Ralston",
    order=2,
    a=((), fractions("2/3")),
    b=fractions("1/4 3/4"),
    source="Ralston 1962, doi:10.1090/S0025-5718-1962-0150954-0",
)
# cubic Hermite pieces between samples keep its order there
RK4 = ButcherTableau(
    name="rk4",
    title="Classical Runge-Kutta",
    order=4,
    a=((), fractions("1/2"), fractions("0 1/2"), fractions("0 0 1")),
    b=fractions("1/6 1/3 1/3 1/6"),
    source="Kutta 1901",
)
