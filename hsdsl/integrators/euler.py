"""Explicit Euler, order 1: the simplest integrator, for teaching and for the paper's error bound at omega = 1."""

from hsdsl.integrators.tableau import ButcherTableau, fractions

EULER = ButcherTableau(
    name="euler",
    title="Explicit Euler",
    order=1,
    a=((),),
    b=fractions("1"),
    source="Euler 1768",
)
