"""The classical Runge-Kutta method, order 4; cubic Hermite pieces between samples keep its order there."""

from hsdsl.integrators.tableau import ButcherTableau, fractions

RK4 = ButcherTableau(
    name="rk4",
    title="Classical Runge-Kutta",
    order=4,
    a=((), fractions("1/2"), fractions("0 1/2"), fractions("0 0 1")),
    b=fractions("1/6 1/3 1/3 1/6"),
    source="Kutta 1901",
)
