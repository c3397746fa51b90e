"""Heun's method of order 2: the explicit trapezoidal rule."""

from hsdsl.integrators.tableau import ButcherTableau, fractions

HEUN = ButcherTableau(
    name="heun",
    title="Heun (explicit trapezoidal rule)",
    order=2,
    a=((), fractions("1")),
    b=fractions("1/2 1/2"),
    source="Heun 1900",
)
